"""Tables, curves and figures of trainings that never took place."""

import csv
import io
import json
import math

import numpy as np
import pytest

from kinarm.evaluation.comparison.document import (
    comparison_document,
    comparison_page,
    curves_csv,
    write_all,
)
from kinarm.evaluation.comparison.figures import final_success, learning_curves
from kinarm.evaluation.comparison.learners import read_learners
from kinarm.evaluation.comparison.results import Comparison
from kinarm.evaluation.comparison.runs import CurvePoint, Protocol, planned_runs
from kinarm.evaluation.schemas import document_schema
from kinarm.evaluation.statistics import Estimate
from kinarm.problem import PROBLEMS

HITS = {0: (0, 4, 9), 1: (0, 5, 7), 2: (2, 3, 8)}
"""Successes in ten trials after 1000, 2000 and 3000 steps, by seed."""


def curve(hits):
    return tuple(
        CurvePoint(1000 * k, 60.0 * k, 30.0 * k, successes, 1, 0.1, 7.0 + k)
        for k, successes in enumerate(hits, start=1)
    )


@pytest.fixture(scope="module")
def comparison():
    table = read_learners()
    chosen = [table["ars-paper"], table["sb3-sac"]]
    problems = [PROBLEMS["right"], PROBLEMS["both"]]
    runs = planned_runs(chosen, problems, 3, None, Protocol(trials=10))
    return Comparison({run: curve(HITS[run.seed]) for run in runs})


def test_series_are_the_seeds_of_a_learner_on_a_problem(comparison):
    names = [(series.problem.name, series.learner.name) for series in comparison.series]
    expected = [(p, learner) for p in ("right", "both") for learner in ("ars-paper", "sb3-sac")]
    assert names == expected
    assert all(len(series.curves) == 3 for series in comparison.series)


def test_success_is_that_of_the_last_policies(comparison):
    hits = np.arange(10) < np.array([[9], [7], [8]])
    assert comparison.series[0].success == Estimate.share(hits)
    assert comparison.series[0].last("environment_steps") == 3000


def test_steps_and_time_until_a_level(comparison):
    series = comparison.series[0]
    assert series.until(0.5, "environment_steps") == 3000  # of 3000, 2000 and 3000
    assert series.until(0.5, "seconds") == 180
    assert series.until(0.8, "environment_steps") == 3000  # of 3000, never and 3000
    assert math.isinf(series.until(0.9, "environment_steps"))
    assert series.until(0.0, "environment_steps") == 1000


def test_curves_are_linear_between_their_points(comparison):
    success = comparison.series[0].success_at("environment_steps", np.array([500, 1500, 3000.0]))
    np.testing.assert_allclose(success[0], [math.nan, 0.2, 0.9])
    np.testing.assert_allclose(success[:, 2], [0.9, 0.7, 0.8])


def test_curves_as_csv(comparison):
    rows = list(csv.DictReader(io.StringIO(curves_csv(comparison))))
    assert len(rows) == 2 * 2 * 3 * 3
    last = [row for row in rows if (row["problem"], row["seed"]) == ("both", "1")][-1]
    assert (last["learner"], last["environment_steps"], last["successes"]) == (
        *("sb3-sac", "3000", "7"),
    )


def test_files(comparison, tmp_path):
    write_all(comparison, tmp_path, "kinarm-compare --seeds 3")
    names = {path.name for path in tmp_path.iterdir()}
    figures = {f"{name}.{end}" for name in ("learners", "final_success") for end in ("png", "svg")}
    assert names == figures | {"learners.json", "learners.csv", "LEARNERS.md"}
    document = json.loads((tmp_path / "learners.json").read_text())
    assert document["command"] == "kinarm-compare --seeds 3"
    assert document["results"][0]["success"]["value"] == pytest.approx(0.8)
    assert document["results"][0]["until"][1] == {
        "success": 0.8,
        "environment_steps": 3000.0,
        "seconds": 180.0,
        "processor_seconds": 90.0,
    }
    assert set(document["reachable"]) == {"right", "both"}
    page = (tmp_path / "LEARNERS.md").read_text()
    share = 80 / document["reachable"]["right"]
    cells = f"80.0 (49.0..94.3) | {share:.1f} | 90 70 80 | 10.0 | 10.0"
    assert f"| right | ARS, paper | {cells} |" in page
    assert document["results"][0]["steps_to_success"] == 10.0
    assert "| both | oracle |" in page
    assert "gradient_steps" in page


def test_document_is_as_its_schema_says(comparison):
    jsonschema = pytest.importorskip("jsonschema")
    document = json.loads(json.dumps(comparison_document(comparison, "a test")))
    jsonschema.Draft202012Validator(document_schema("comparison")).validate(document)


def test_page_says_what_never_happened(comparison):
    never = Comparison({run: curve((0, 0, 0)) for run in comparison.curves})
    document = {"protocol": {"trials": 10, "seed": 0}, "versions": {}, "command": "", "commit": ""}
    assert "| never | never |" in comparison_page(never, document)


def test_figure_has_a_row_per_problem(comparison):
    figure = learning_curves(comparison)
    assert [axes.get_title() for axes in figure.axes] == ["right", "right", "both", "both"]
    lines = figure.axes[0].get_lines()
    assert [line.get_label() for line in lines[:2]] == ["ARS, paper", "SAC (SB3)"]
    assert lines[0].get_ydata()[-1] == pytest.approx(0.8)


def test_the_best_are_on_top(comparison):
    panel = final_success(comparison).axes[0]
    titles = [label.get_text() for label in panel.get_yticklabels()]
    ranked = sorted(comparison.series[:2], key=lambda series: series.success.value)
    assert titles == [series.learner.title for series in ranked]
    best = titles.index("ARS, paper")
    interval, seeds = panel.get_lines()[2 * best : 2 * best + 2]
    np.testing.assert_allclose(sorted(seeds.get_xdata()), [70, 80, 90])
    np.testing.assert_allclose(interval.get_xdata(), [49.0, 94.3], atol=0.05)
