"""The document of an evaluation holds what it promises, and the table shows all of it."""

from io import StringIO

import msgspec
import numpy as np
import pytest
from rich.console import Console

from kinarm.errors import InvalidInputError
from kinarm.evaluation.bounds import bounds_document, oracle_bounds
from kinarm.evaluation.contestants import ORACLE
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.evaluation import evaluate, evaluation_document, run_trials
from kinarm.evaluation.metrics import METRICS, Metric
from kinarm.evaluation.table import print_table
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.reference import ReferenceSimulator
from kinarm.simulator import Simulator


def made_of(evaluations, command=""):
    """The document as a file holds it."""
    return evaluation_document(evaluations, command).to_json()


@pytest.fixture(scope="module", params=["evaluations", "bounded_evaluations"])
def document(request):
    """With and without bounds."""
    return made_of(request.getfixturevalue(request.param), "kinarm-eval --matrix")


@pytest.fixture(scope="module")
def bounded_document(bounded_evaluations):
    """With a row for the oracle, too."""
    trial_sets = {each.problem.name: each.trials for each in bounded_evaluations}
    oracle = [
        run_trials(ORACLE, trials, bounds=oracle_bounds(trials)) for trials in trial_sets.values()
    ]
    return made_of([*bounded_evaluations, *oracle], "kinarm-eval")


def printed(document, width: int = 320, **settings) -> str:
    console = Console(file=StringIO(), width=width)
    print_table(msgspec.convert(document, EvaluationDocument), console, **settings)
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


def test_results_are_one_per_policy_and_task(document):
    assert [(row["policy"], row["problem"]) for row in document["results"]] == [
        ("made-right-seed0", "right"),
        ("made-right-seed1", "right"),
        ("made-right-seed2", "right"),
        ("zero", "right"),
        ("made-left-seed0", "left"),
    ]


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


def test_every_trial_of_every_result_is_listed(document):
    for row in document["results"]:
        entry, outcomes = document["protocol"]["problems"][row["problem"]], row["outcomes"]
        lengths = {len(column) for column in (entry["starts"], entry["goals"], *outcomes.values())}
        assert lengths == {row["trials"]}
        assert {"final_distance", "steps", "outcome", "contact"} <= set(outcomes)
        assert (
            row["metrics"]["success"]["value"]
            == outcomes["outcome"].count("success") / row["trials"]
        )
        for outcome, contact in zip(outcomes["outcome"], outcomes["contact"], strict=True):
            assert (contact is not None) == (outcome == "collision")


def test_listed_trials_can_be_simulated_again(document, skilled):
    """By the reference path, from nothing but the numbers in the document."""
    entry, row = document["protocol"]["problems"]["right"], document["results"][1]
    reference = ReferenceSimulator(Simulator(ReachProblem.from_json(entry["problem"])))
    for i in range(row["trials"]):
        start, goal = np.array(entry["starts"][i]), np.array(entry["goals"][i])
        episode = reference.rollout(skilled, start, goal)
        assert row["outcomes"]["final_distance"][i] == pytest.approx(episode.distance, abs=1e-9)
        assert row["outcomes"]["steps"][i] == len(episode.rewards)
        assert row["outcomes"]["contact"][i] == (episode.contact and list(episode.contact))


def test_table_shows_the_figures_of_the_document(document):
    row = next(row for row in shown(document) if row["policy"] == "made-right")
    figures, spread = document["pooled"][0]["metrics"], document["pooled"][0]["spread"]
    low, high = (100 * end for end in figures["success"]["ci95"])
    for end in (100 * figures["success"]["value"], low, high):
        assert f"{end:.1f}" in row["success %"]
    assert row["within 0.1 m %"] == f"{100 * figures['within_0.1']['value']:.1f}"
    assert row["within 0.2 m %"] == f"{100 * figures['within_0.2']['value']:.1f}"
    assert row["median distance m"].startswith(f"{figures['median_distance']['value']:.3f} ")
    assert row["mean distance m"] == f"{figures['mean_distance']['value']:.3f}"
    assert row["collision %"] == f"{100 * figures['collision']['value']:.1f}"
    worst, best = (100 * spread["success"][end] for end in ("min", "max"))
    assert row["worst..best seed %"] == f"{worst:.1f}..{best:.1f} (3 seeds)"


def test_results_stand_beside_the_oracle(bounded_document, bounded_evaluations):
    for row, evaluation in zip(bounded_document["results"], bounded_evaluations, strict=False):
        ratios = evaluation.step_ratio
        figures = {name: entry["value"] for name, entry in row["metrics"].items()}
        assert figures["relative_success"] == figures["success"]
        assert figures["step_ratio"] == (np.median(ratios) if len(ratios) else None)
        assert figures["step_ratio_p95"] == (np.percentile(ratios, 95) if len(ratios) else None)


def test_protocol_tells_the_bounds_of_its_tasks(bounded_document, bounded_evaluations):
    entries = bounded_document["protocol"]["problems"]
    for evaluation in bounded_evaluations:
        expected = bounds_document(evaluation.bounds).to_json()
        assert entries[evaluation.problem.name]["oracle"] == expected
        column = entries[evaluation.problem.name]["oracle"]["trials"]["steps_lower_bound"]
        assert len(column) == len(entries[evaluation.problem.name]["starts"])


def test_table_shows_the_bounds(bounded_document):
    rows = {(row["problem"], row["policy"]): row for row in shown(bounded_document)}
    pooled = bounded_document["pooled"][0]["metrics"]
    row = rows["right", "made-right"]
    assert row["relative success %"] == f"{100 * pooled['relative_success']['value']:.1f}"
    median, p95 = (pooled[name]["value"] for name in ("step_ratio", "step_ratio_p95"))
    assert row["step ratio"] == f"{median:.2f} (p95 {p95:.2f})"
    assert (rows["right", "zero"]["relative success %"], rows["right", "zero"]["step ratio"]) == (
        "0.0",
        "",
    )


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


def test_markdown_holds_the_same_rows_at_every_width(document):
    for width in (60, 320):
        heading, rule, *lines = printed(document, width, markdown=True).strip().splitlines()
        assert set(rule) <= set("|-: ")
        names = cells(heading, "|")
        rows = [dict(zip(names, cells(line, "|"), strict=True)) for line in lines]
        assert rows == shown(document)


def test_a_new_metric_is_one_entry(evaluations, monkeypatch):
    """Documents and tables show whatever the table of metrics holds."""
    metric = Metric(
        meaning="share of all trials that end within half a metre",
        definition="|{i : dᵢ ≤ 0.5 m}| / n",
        formula=lambda trials: (trials.distance <= 0.5).mean(axis=-1),
        unit="%",
        interval="Wilson",
        heading="within 0.5 m %",
        digits=1,
        spread_heading="spread of it %",
    )
    monkeypatch.setitem(METRICS, "within_0.5", metric)
    again = [type(each)(each.contestant, each.trials, each.rollouts) for each in evaluations]
    document = made_of(again)
    for row, evaluation in zip(document["results"], again, strict=True):
        assert row["metrics"]["within_0.5"] == evaluation.within(0.5).to_json()
    rates = [100 * each.within(0.5).value for each in again[:3]]
    row = next(row for row in shown(document) if row["policy"] == "made-right")
    assert row["within 0.5 m %"] == f"{sum(rates) / 3:.1f}"
    assert row["spread of it %"] == f"{min(rates):.1f}..{max(rates):.1f} (3 seeds)"


def test_two_problems_of_one_name_are_refused(skilled):
    both = [evaluate(skilled, trials=2, tolerance=tolerance) for tolerance in (0.05, 0.1)]
    with pytest.raises(InvalidInputError, match=r"called 'right': .* task.tolerance is 0.1, not"):
        evaluation_document(both, "")
    named = evaluate(skilled, PROBLEMS["right"].replace(name="lax", tolerance=0.1), trials=2)
    assert len(made_of([both[0], named])["protocol"]["problems"]) == 2
