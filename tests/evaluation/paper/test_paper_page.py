"""Tables and files of the reproduction, against sums by hand."""

import numpy as np
import pytest

from kinarm.evaluation.paper.claims import assess
from kinarm.evaluation.paper.page import claims_document, reproduction_page, run_rows
from kinarm.evaluation.paper.results import LITERAL, Reading
from kinarm.evaluation.report.templating import template


def test_a_line_for_each_training(results_of, made_up_run):
    distance = np.array([0.01, 0.05, 0.08, 0.16, 0.30])
    results = results_of(lambda _: made_up_run(distance))
    rows = run_rows(results)
    assert [row["training"] for row in rows] == [run.name for run in results.runs]
    first = rows[0]
    assert first["training"] == "sweep-rate0.05-perturb16-left-seed0"
    assert [first[f"within_{limit}"] for limit in ("0.05", "0.1", "0.2")] == [0.4, 0.6, 0.8]
    assert (first["mean_distance"], first["median_distance"]) == ("0.1200", "0.0800")
    assert (first["environment_steps"], first["contact"]) == (4000, 0.0)


def test_readings_without_ppo_leave_its_claims_out(results_of, made_up_run):
    results = results_of(lambda _: made_up_run(np.full(200, 0.1)))
    other = Reading(sharing="pair")
    claims = {LITERAL: assess(results), other: assess(results, other)[:4]}
    page = reproduction_page(results, claims, claims_document(results, claims, "", []))
    _, table = page.split("## Other readings of the paper")
    header, _, *rows = (line for line in table.splitlines() if line.startswith("|"))
    columns = [[cell.strip() for cell in line.split("|")[1:-1]] for line in (header, *rows)]
    names, literal, shared = columns
    assert names[4:8] == ["`ars-left`", "`ars-right`", "`ars-both`", "`ars-one-bench`"]
    assert literal[3] == shared[3] == "100 / 100 / 100"
    assert literal[:3] == ["1", "progress", "none"]
    assert all(literal[4:-1])
    assert shared[4:8] == literal[4:8]
    assert shared[8:-1] == [""] * 3
    assert [literal[-1], shared[-1]] == ["2", "2"]


@pytest.mark.parametrize(
    ("steps", "cell"),
    [
        ([np.inf] * 3, "never"),
        ([1000, 2000, 9000], "2 thousand"),
        ([1000, 2000, np.inf], "2 thousand (2 of 3 seeds)"),
        ([1000, np.inf, np.inf], "most never (1 of 3 seeds)"),
    ],
)
def test_median_over_seeds_says_how_many_got_there(steps, cell):
    cells = template("cells.md").make_module({"median": np.median})
    assert cells.median_steps(np.array(steps)) == cell
