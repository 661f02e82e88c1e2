"""The document of an evaluation holds what it promises, and the table shows all of it."""

import re
from io import StringIO

import msgspec
import numpy as np
import pytest
from rich.console import Console

from kinarm.errors import InvalidInputError
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.evaluation import evaluate
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.summary import evaluation_document
from kinarm.evaluation.table import print_table
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.simulator import Simulator
from tests.helpers.reference import ReferenceSimulator


def made_of(evaluations, command=""):
    """The document as a file holds it."""
    return evaluation_document(evaluations, command).to_json()


@pytest.fixture(scope="module", params=["evaluations", "bounded_evaluations"])
def document(request):
    """With and without bounds."""
    return made_of(request.getfixturevalue(request.param), "kinarm-eval --matrix")


def printed(document, width: int = 320, **settings) -> str:
    console = Console(file=StringIO(), width=width)
    print_table(msgspec.convert(document, EvaluationDocument), console, **settings)
    return console.file.getvalue()


def shown(document) -> list[dict[str, str]]:
    """Rows of the table as a reader sees them, by heading."""
    heading, _, *lines = map(cells, printed(document, 60, markdown=True).strip().splitlines())
    return [dict(zip(heading, line, strict=True)) for line in lines]


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_every_result_has_every_field(document):
    for row in (*document["results"], *document["pooled"]):
        assert list(row["metrics"]) == list(METRICS)
        for name, metric in METRICS.items():
            value, ci95 = row["metrics"][name]["value"], row["metrics"][name]["ci95"]
            told = metric.interval is not None and not metric.needs_holding
            assert (ci95 is not None) == told, name
            if ci95:
                assert ci95[0] <= value <= ci95[1], name


def test_protocol_tells_how_it_was_done(document, evaluations):
    protocol = document["protocol"]
    assert protocol["command"] == "kinarm-eval --matrix"
    assert protocol["seed"] == 5
    assert {"python", "numpy", "numba", "pin", "coal", "kinarm"} <= set(protocol["versions"])
    assert isinstance(protocol["commit"], str)
    assert set(protocol["problems"]) == {"right", "left"}
    for evaluation in evaluations:
        entry, problem = protocol["problems"][evaluation.problem.name], evaluation.problem
        assert entry["trial_set_hash"] == evaluation.trials.digest
        assert (entry["arm"], entry["digest"]) == ("paper", problem.digest)
        assert ReachProblem.from_json(entry["problem"]) == problem.pinned


def test_listed_trials_can_be_simulated_again(evaluations, skilled, monkeypatch):
    """By the reference path, from nothing but the numbers in the document."""
    monkeypatch.setattr("tests.helpers.reference.SAMPLES", 60)
    document = made_of(evaluations)
    entry, row = document["protocol"]["problems"]["right"], document["results"][1]
    reference = ReferenceSimulator(Simulator(ReachProblem.from_json(entry["problem"])))
    for i in range(12):
        start, goal = np.array(entry["starts"][i]), np.array(entry["goals"][i])
        episode = reference.rollout(skilled, start, goal)
        outcomes = {name: values[i] for name, values in row["outcomes"].items()}
        assert outcomes["final_distance"] == pytest.approx(episode.distance, abs=1e-9)
        assert outcomes["steps"] == len(episode.rewards)
        expected = "success" if episode.success else "collision" if episode.contact else "truncated"
        assert outcomes["outcome"] == expected
        assert outcomes["contact"] == (episode.contact and list(episode.contact))


def test_table_is_sorted_by_success(document):
    rows = (*document["results"], *document["pooled"])
    rates = {row["policy"]: row["metrics"]["success"]["value"] for row in rows}
    right = [rates[row["policy"]] for row in shown(document) if row["problem"] == "right"]
    assert right == sorted(right, reverse=True)
    assert right[0] > right[-1]


@pytest.mark.parametrize("width", [80, 100, 120, 160])
def test_a_narrow_table_has_fewer_columns_but_whole_figures(document, width):
    text = printed(document, width)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    for name in ("problem", "policy", "success", "median", "made-right", "made-left-seed0"):
        assert name in text


def test_a_wide_table_holds_what_markdown_does(document):
    heading, *lines = printed(document, 320).splitlines()
    rows = shown(document)
    assert re.split(" {2,}", heading) == [*rows[0]]
    told = [re.split(" {2,}", line.strip()) for line in lines if line.strip()]
    assert told == [[cell for cell in row.values() if cell] for row in rows]


def test_two_problems_of_one_name_are_refused(skilled):
    both = [evaluate(skilled, trials=2, tolerance=tolerance) for tolerance in (0.05, 0.1)]
    with pytest.raises(InvalidInputError, match=r"called 'right': .* task.tolerance is 0.1, not"):
        evaluation_document(both, "")
    named = evaluate(skilled, PROBLEMS["right"].replace(name="lax", tolerance=0.1), trials=2)
    assert len(made_of([both[0], named])["protocol"]["problems"]) == 2
