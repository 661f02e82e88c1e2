"""The document of an evaluation holds what it promises, and the table shows all of it."""

import json
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from kinarm.arm import Arm
from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.entrants import ORACLE, Entrant
from kinarm.evaluation.evaluations import evaluate, run_trials
from kinarm.evaluation.report import evaluation_document, print_table
from kinarm.reference import ReferenceSimulator
from kinarm.simulator import Simulator

RESULT_FIELDS = {
    "policy": str,
    "algorithm": str,
    "recipe": str,
    "task": str,
    "trials": int,
    "final_distance": dict,
    "success": dict,
    "within": dict,
    "collision": dict,
    "steps": dict,
}


@pytest.fixture(scope="module", params=["evaluations", "bounded_evaluations"])
def document(request):
    """With and without bounds."""
    return evaluation_document(request.getfixturevalue(request.param), "kinarm-eval --matrix")


@pytest.fixture(scope="module")
def bounded_document(bounded_evaluations):
    """With a row for the oracle, too."""
    trial_sets = {each.task: each.trials for each in bounded_evaluations}
    oracle = [run_trials(ORACLE, trials, oracle=True) for trials in trial_sets.values()]
    return evaluation_document([*bounded_evaluations, *oracle], "kinarm-eval")


def printed(document, width: int = 250, **settings) -> str:
    console = Console(file=StringIO(), width=width)
    print_table(document, console, **settings)
    return console.file.getvalue()


def shown(document) -> list[dict[str, str]]:
    """Rows of the table as a reader sees them, by heading."""
    lines = printed(document).splitlines()
    (heading,) = (line for line in lines if line.startswith("┃"))
    return [
        dict(zip(cells(heading, "┃"), cells(line, "│"), strict=True))
        for line in lines
        if line.startswith("│")
    ]


def cells(line: str, border: str) -> list[str]:
    inside = line.strip().removeprefix(border).removesuffix(border)
    return [cell.strip() for cell in inside.split(border)]


def test_document_is_plain_json_without_nan(document):
    assert json.loads(json.dumps(document, allow_nan=False)) == document


def test_document_has_protocol_and_results_at_the_top(document):
    assert {"protocol", "results"} <= set(document)


def test_results_are_one_per_policy_and_task(document):
    assert [(row["policy"], row["task"]) for row in document["results"]] == [
        ("made-right-seed0", "right"),
        ("made-right-seed1", "right"),
        ("made-right-seed2", "right"),
        ("zero", "right"),
        ("made-left-seed0", "left"),
    ]


def test_every_result_has_every_field(document):
    for row in (*document["results"], *document["pooled"]):
        for name, kind in RESULT_FIELDS.items():
            assert type(row[name]) is kind, name
        assert {"mean", "median", "iqm", "p95", "max", "ci95"} <= set(row["final_distance"])
        assert set(row["final_distance"]["ci95"]) == {"mean", "median", "iqm", "p95"}
        assert set(row["within"]) == {"0.1", "0.2"}
        assert {"mean", "median"} <= set(row["steps"])
        for share in (row["success"], row["collision"], *row["within"].values()):
            assert 0 <= share["ci95"][0] <= share["rate"] <= share["ci95"][1] <= 1


def test_protocol_tells_how_it_was_done(document, evaluations):
    protocol = document["protocol"]
    assert protocol["command"] == "kinarm-eval --matrix"
    assert (protocol["seed"], protocol["arm"]) == (5, "paper")
    assert protocol["arm_digest"] == Arm.load().digest
    assert {"python", "numpy", "numba", "pin", "coal", "kinarm"} <= set(protocol["versions"])
    assert isinstance(protocol["commit"], str)
    assert set(protocol["tasks"]) == {"right", "left"}
    assert protocol["tasks"]["right"]["trial_set_hash"] == evaluations[0].trials.digest
    assert protocol["tasks"]["left"]["trial_set_hash"] == evaluations[-1].trials.digest


def test_every_trial_of_every_result_is_listed(document):
    for row in document["results"]:
        entry, outcomes = document["protocol"]["tasks"][row["task"]], row["outcomes"]
        lengths = {len(column) for column in (entry["starts"], entry["goals"], *outcomes.values())}
        assert lengths == {row["trials"]}
        assert {"final_distance", "steps", "outcome", "contact"} <= set(outcomes)
        assert row["success"]["rate"] == outcomes["outcome"].count("success") / row["trials"]
        for outcome, contact in zip(outcomes["outcome"], outcomes["contact"], strict=True):
            assert (contact is not None) == (outcome == "collision")


def test_listed_trials_can_be_simulated_again(document, skilled):
    """By the reference path, from nothing but the numbers in the document."""
    document = json.loads(json.dumps(document))
    entry, row = document["protocol"]["tasks"]["right"], document["results"][1]
    reference = ReferenceSimulator(Simulator(document["protocol"]["arm"], "right"))
    for i in range(row["trials"]):
        start, goal = np.array(entry["starts"][i]), np.array(entry["goals"][i])
        episode = reference.rollout(skilled, start, goal)
        assert row["outcomes"]["final_distance"][i] == pytest.approx(episode.distance, abs=1e-9)
        assert row["outcomes"]["steps"][i] == len(episode.rewards)
        assert row["outcomes"]["contact"][i] == (episode.contact and list(episode.contact))


def test_training_seeds_are_recorded(document):
    assert [row["training_seed"] for row in document["results"]] == [0, 1, 2, None, 0]
    assert document["pooled"][0]["training_seeds"] == [0, 1, 2]


def test_table_has_a_column_per_figure(document):
    headings = list(shown(document)[0])
    figures = ("success", "seeds", "0.1", "0.2", "median", "mean", "p95", "contact", "steps")
    for name in ("task", "policy", *figures, "of oracle", "step ratio"):
        assert any(name in heading for heading in headings), name


def test_table_has_a_row_per_recipe_and_baseline(document):
    rows = [(row["task"], row["policy"]) for row in shown(document)]
    assert sorted(rows) == [("left", "made-left-seed0"), ("right", "made-right"), ("right", "zero")]


def test_table_shows_the_figures_of_the_document(document):
    row = next(row for row in shown(document) if row["policy"] == "made-right")
    pooled = document["pooled"][0]
    low, high = (100 * end for end in pooled["success"]["ci95"])
    for end in (100 * pooled["success"]["rate"], low, high):
        assert f"{end:.1f}" in row["success %"]
    assert row["<= 0.1 m"] == f"{100 * pooled['within']['0.1']['rate']:.1f}"
    assert row["<= 0.2 m"] == f"{100 * pooled['within']['0.2']['rate']:.1f}"
    assert row["median m"].startswith(f"{pooled['final_distance']['median']:.3f} ")
    assert row["mean m"] == f"{pooled['final_distance']['mean']:.3f}"
    assert row["contact %"] == f"{100 * pooled['collision']['rate']:.1f}"
    worst, best = (100 * pooled["spread"]["success"][end] for end in ("min", "max"))
    assert row["seeds: range %"] == f"3: {worst:.1f}..{best:.1f}"


def test_results_stand_beside_the_oracle(bounded_document, bounded_evaluations):
    assert json.loads(json.dumps(bounded_document, allow_nan=False)) == bounded_document
    for row, evaluation in zip(bounded_document["results"], bounded_evaluations, strict=False):
        ratios = evaluation.step_ratio
        assert row["oracle"]["relative_success"] == row["success"]["rate"]
        assert row["oracle"]["step_ratio"] == {
            "trials": len(ratios),
            "median": np.median(ratios) if len(ratios) else None,
            "p95": np.percentile(ratios, 95) if len(ratios) else None,
        }


def test_protocol_tells_the_bounds_of_its_tasks(bounded_document, bounded_evaluations):
    tasks = bounded_document["protocol"]["tasks"]
    for evaluation in bounded_evaluations:
        expected = json.loads(json.dumps(bounds_document(evaluation.bounds)))
        assert tasks[evaluation.task]["oracle"] == expected
        column = tasks[evaluation.task]["oracle"]["trials"]["steps_lower_bound"]
        assert len(column) == len(tasks[evaluation.task]["starts"])


def test_without_bounds_there_are_none(evaluations):
    document = evaluation_document(evaluations, "")
    assert all(entry["oracle"] is None for entry in document["protocol"]["tasks"].values())
    assert all(row["oracle"] is None for row in (*document["results"], *document["pooled"]))
    assert {row["of oracle %"] + row["step ratio"] for row in shown(document)} == {""}


def test_table_shows_the_bounds(bounded_document):
    rows = {(row["task"], row["policy"]): row for row in shown(bounded_document)}
    pooled = bounded_document["pooled"][0]["oracle"]
    row = rows["right", "made-right"]
    assert row["of oracle %"] == f"{100 * pooled['relative_success']:.1f}"
    median, p95 = (pooled["step_ratio"][name] for name in ("median", "p95"))
    assert row["step ratio"] == f"{median:.2f} (p95 {p95:.2f})"
    assert (rows["right", "zero"]["of oracle %"], rows["right", "zero"]["step ratio"]) == (
        "0.0",
        "",
    )


def test_table_has_one_row_a_task_for_the_oracle(bounded_document):
    rows = [row for row in shown(bounded_document) if row["policy"] == "oracle"]
    assert [(row["task"], row["of oracle %"]) for row in rows] == [
        ("right", "100.0"),
        ("left", "100.0"),
    ]
    assert all(row["step ratio"].startswith("1.") for row in rows)
    assert all(row["success %"].startswith("100.0 ") for row in rows)


def test_table_is_sorted_by_success(document):
    rates = {row["policy"]: row["success"]["rate"] for row in document["results"]}
    rates |= {row["policy"]: row["success"]["rate"] for row in document["pooled"]}
    right = [rates[row["policy"]] for row in shown(document) if row["task"] == "right"]
    assert right == sorted(right, reverse=True)
    assert right[0] > right[-1]


def test_table_keeps_a_policy_beside_a_group_of_its_recipe(evaluations, skilled, trials):
    """One's own policy does not vanish because shipped seeds share its recipe."""
    mine = run_trials(Entrant.from_policy("mine", skilled), trials)
    document = evaluation_document([*evaluations, mine], "")
    assert "mine" in [row["policy"] for row in shown(document)]


def test_table_works_for_a_single_trial(skilled):
    document = evaluation_document([evaluate(skilled, trials=1)], "")
    assert [row["task"] for row in shown(document)] == ["right"]


@pytest.mark.parametrize("width", [80, 100, 120, 160])
def test_a_narrow_table_has_fewer_columns_but_whole_figures(document, width):
    text = printed(document, width)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    for name in ("task", "policy", "success", "median", "made-right", "made-left-seed0"):
        assert name in text


def test_a_wider_table_has_no_fewer_columns(document):
    counts = [printed(document, width).splitlines()[0].count("┳") for width in range(60, 180, 10)]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_markdown_holds_the_same_rows_at_every_width(document):
    for width in (60, 250):
        heading, rule, *lines = printed(document, width, markdown=True).strip().splitlines()
        assert set(rule) <= set("|-: ")
        names = cells(heading, "|")
        rows = [dict(zip(names, cells(line, "|"), strict=True)) for line in lines]
        assert rows == shown(document)
