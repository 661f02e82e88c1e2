"""``kinarm-eval``: what it prints, what it writes, and that both are what the library computes."""

import json
from io import StringIO

import numpy as np
import pytest
from documents import faced, relative_success
from refusals import check_refused
from rich.console import Console

from kinarm.errors import InvalidInputError
from kinarm.evaluation import bounds
from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.evaluation import evaluate
from kinarm.evaluation.request import EvaluationRequest
from kinarm.evaluation.table import print_table
from kinarm.policies.library import best_policy
from kinarm.problem import PROBLEMS


def test_json_alone_is_printed_and_equals_the_library(evaluated, policy_folder):
    document = evaluated("--policy", policy_folder / "mine-seed0.npz", "--trials", 9, "--seed", 4)
    expected, oracle = (
        evaluate(contestant, "right", trials=9, seed=4, oracle=True)
        for contestant in (policy_folder / "mine-seed0.npz", "oracle")
    )
    rows = json.loads(json.dumps([expected.to_json(), oracle.to_json()]))
    assert document["results"] == rows
    entry = document["protocol"]["problems"]["right"]
    assert entry["oracle"] == json.loads(json.dumps(bounds_document(expected.bounds)))
    assert entry["trial_set_hash"] == expected.trials.digest
    np.testing.assert_array_equal(entry["starts"], expected.trials.starts)


def test_few_trials_are_the_beginning_of_many(evaluated, policy_folder):
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--policy", "random", "--seed", 4)
    few, many = (evaluated(*arguments, "--trials", n) for n in (5, 12))
    for short, long in zip(few["results"], many["results"], strict=True):
        for name, column in short["outcomes"].items():
            assert column == long["outcomes"][name][:5], name


def test_defaults(evaluated, run, policy_folder):
    document = evaluated("--policy", "zero", "--task", "left")
    protocol = document["protocol"]
    assert (protocol["trials"], protocol["seed"]) == (200, 0)
    assert protocol["problems"]["left"]["arm"] == "paper"
    assert faced(document) == [("zero", "left"), ("oracle", "left")]
    assert len(protocol["problems"]["left"]["oracle"]["trials"]["steps"]) == 200
    assert all(relative_success(row) is not None for row in document["results"])


def test_a_problem_without_policies_is_told(run):
    answer = run("kinarm-eval", "--problem", "table-paper", "--trials", 1, "--no-oracle")
    assert (answer.status, answer.err) == (0, "")
    assert answer.out.splitlines()[-1] == "no shipped policy was trained for this"


def test_command_is_recorded(evaluated):
    document = evaluated("--policy", "zero", "--trials", 2, "--task", "left")
    assert (
        document["protocol"]["command"] == "kinarm-eval --json --policy zero --trials 2 --task left"
    )


def test_policies_of_several_kinds_at_once(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "mine-seed0.npz", "--policy", "random"),
        *("--policy", policy_folder / "lefty.npz", "--trials", 3),
    )
    assert sorted(faced(document)) == [
        ("lefty", "left"),
        ("mine-seed0", "right"),
        ("oracle", "left"),
        ("oracle", "right"),
        ("random", "left"),
        ("random", "right"),
    ]


def test_named_problem_is_what_named_policies_face(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "lefty.npz", "--problem", "both", "--problem", "right"),
        *("--trials", 3, "--no-oracle"),
    )
    assert faced(document) == [("lefty", "both"), ("lefty", "right")]


def test_matrix_is_every_policy_on_every_problem(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "lefty.npz", "--policy", "zero", "--trials", 3, "--matrix")
    )
    problems = tuple(PROBLEMS)
    assert sorted(faced(document)) == sorted(
        (name, problem) for name in ("lefty", "zero", "oracle") for problem in problems
    )


def test_a_policy_named_twice_is_evaluated_once(evaluated, policy_folder):
    path = policy_folder / "mine-seed0.npz"
    document = evaluated("--policy", path, "--policy", path, "--trials", 2, "--no-oracle")
    assert faced(document) == [("mine-seed0", "right")]


def test_a_problem_named_twice_is_played_once(evaluated):
    document = evaluated(
        "--policy", "zero", "--problem", "left", "--problem", "left", "--trials", 2
    )
    assert faced(document) == [("zero", "left"), ("oracle", "left")]


def test_json_and_markdown_exclude_each_other(run):
    answer = run("kinarm-eval", "--json", "--markdown")
    assert (answer.status, answer.out, answer.err.count("\n")) == (2, "", 1)
    assert "exclude each other" in answer.err


def test_a_file_called_like_a_baseline_does_not_replace_it(run, policy, tmp_path):
    """Either both are evaluated or the clash is refused; nothing vanishes silently."""
    policy.save(tmp_path / "random.npz")
    answer = run(
        *("kinarm-eval", "--json", "--policy", tmp_path / "random.npz", "--policy", "random"),
        *("--trials", 2),
    )
    kinds = {row["algorithm"] for row in json.loads(answer.out or '{"results": []}')["results"]}
    assert answer.status == 2 or kinds == {"ars", "baseline", "oracle"}


def test_a_policy_brings_its_own_arm(evaluated, policy_folder):
    arguments = ("--policy", policy_folder / "flange.npz", "--trials", 3)
    document = evaluated(*arguments)
    assert document["protocol"]["problems"]["right"]["arm"] == "paper_flange"
    assert faced(document) == [("flange", "right"), ("oracle", "right")]


def test_another_arm_when_asked_for(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "flange.npz", "--trials", 3, "--allow-other-arm"),
        *("--arm", "paper"),
    )
    assert document["protocol"]["problems"]["right"]["arm"] == "paper"
    assert faced(document) == [("flange", "right"), ("oracle", "right")]


def test_table_for_people(run, policy_folder):
    answer = run("kinarm-eval", "--policy", policy_folder / "lefty.npz", "--trials", 3)
    assert (answer.status, answer.err) == (0, "")
    for words in ("lefty", "oracle", "left", "3 trials", "seed 0", "arm paper"):
        assert words in answer.out
    assert evaluate("zero", "left", trials=3).trials.digest in answer.out


def test_no_figure_of_the_table_is_cut_off(run, policy_folder):
    answer = run("kinarm-eval", "--policy", policy_folder / "mine-seed0.npz", "--trials", 150)
    assert "…" not in answer.out


def test_markdown_is_a_table_alone(run, policy_folder):
    answer = run(
        *("kinarm-eval", "--markdown", "--policy", policy_folder / "mine-seed0.npz"),
        *("--policy", "zero", "--trials", 3),
    )
    lines = answer.out.splitlines()
    assert len(lines) == 5
    assert all(line.startswith("|") and line.endswith("|") for line in lines)
    assert len({line.count("|") for line in lines}) == 1


def test_without_policies_all_fitting_ones_and_the_baselines_take_part(evaluated):
    names = {name for name, _ in faced(evaluated("--trials", 1, "--arm", "paper_flange"))}
    assert names == {"random", "zero", "oracle"}


def test_the_request_does_as_the_command_does(evaluated, policy_folder, tmp_path):
    path = str(policy_folder / "mine-seed0.npz")
    request = EvaluationRequest(policies=(path,), trials=4, tolerance=0.1, out=tmp_path)
    document = json.loads(json.dumps(request.run()))
    printed = evaluated("--policy", path, "--trials", 4, "--tolerance", 0.1)
    assert document["results"] == printed["results"]
    assert json.loads((tmp_path / "evaluation.json").read_text()) == document
    assert "EvaluationRequest(" in document["protocol"]["command"]


@pytest.mark.parametrize("settings", [{"trials": 0}, {"seed": -1}, {"trials": 2.5}])
def test_bad_numbers_are_refused_where_the_request_is_made(settings):
    with pytest.raises(InvalidInputError, match="whole number"):
        EvaluationRequest(**settings)


def test_changes_apply_to_what_policies_were_trained_for(policy_folder):
    files = tuple(str(policy_folder / f"{name}.npz") for name in ("lefty", "mine-seed0"))
    request = EvaluationRequest(policies=(*files, "zero"), tolerance=0.2, oracle=False)
    faced = [(contestant.name, problem) for contestant, problem in request.pairs()]
    assert [(name, problem.name) for name, problem in faced] == [
        ("lefty", "left"),
        ("zero", "left"),
        ("mine-seed0", "right"),
        ("zero", "right"),
    ]
    for _, problem in faced:
        assert problem.digest == PROBLEMS[problem.name].replace(tolerance=0.2).digest


def test_a_problem_file(evaluated, policy_folder, tmp_path):
    PROBLEMS["right"].replace(name="lax", tolerance=0.3).save(tmp_path / "lax.toml")
    document = evaluated(
        *("--policy", policy_folder / "mine-seed0.npz", "--problem", tmp_path / "lax.toml"),
        *("--problem", "right", "--trials", 3),
    )
    assert set(faced(document)) == {
        (name, problem) for name in ("mine-seed0", "oracle") for problem in ("lax", "right")
    }
    entries = document["protocol"]["problems"]
    assert entries["lax"]["problem"]["task"]["tolerance"] == 0.3
    assert entries["lax"]["starts"] == entries["right"]["starts"]


def test_holding_trials_are_told_beside_the_others(run, evaluated, policy_folder):
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--trials", 6)
    plain, held = evaluated(*arguments), evaluated(*arguments, "--hold")
    assert (plain["protocol"]["hold"], held["protocol"]["hold"]) == (False, True)
    for before, after in zip(plain["results"], held["results"], strict=True):
        assert before["metrics"]["held"] == {"value": None, "ci95": None}
        assert 0 <= after["metrics"]["held"]["value"] <= 1
        assert before["outcomes"] == after["outcomes"]
        assert len(after["held"]["closest"]) == 6
    answer = run("kinarm-eval", *arguments, "--hold")
    for words in ("held %", "median approach m", "success does not end", "aims at 5 mm"):
        assert words in " ".join(answer.out.split())
    assert "held %" not in run("kinarm-eval", *arguments).out


def test_holding_figures_fit_a_narrow_terminal():
    document = EvaluationRequest(
        policies=("zero",), problem="left", trials=3, hold=True, oracle=False
    ).run()
    console = Console(file=StringIO(), width=80)
    print_table(document, console)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    assert "held %" in lines[1]


def test_the_best_shipped_policy_by_name(evaluated):
    document = evaluated("--policy", "best", "--task", "right", "--trials", 2, "--no-oracle")
    assert faced(document) == [(best_policy("right"), "right")]


def test_the_best_of_each_problem(evaluated):
    arguments = ("--policy", "best", "--tolerance", 0.04, "--trials", 1, "--no-oracle")
    expected = [(best_policy(problem), problem) for problem in PROBLEMS]
    assert faced(evaluated(*arguments)) == expected
    some = evaluated(*arguments, "--problem", "left", "--problem", "both", "--policy", "zero")
    assert faced(some) == [
        (best_policy("left"), "left"),
        ("zero", "left"),
        (best_policy("both"), "both"),
        ("zero", "both"),
    ]
    assert {entry["problem"]["task"]["tolerance"] for entry in problems_of(some)} == {0.04}


def problems_of(document):
    return document["protocol"]["problems"].values()


@pytest.mark.parametrize("option", [("--arm", "paper_flange"), ("--scene", "table")])
def test_no_best_policy_for_other_arms_and_scenes(run, option):
    arguments = ("--policy", "best", "--problem", "right", *option, "--trials", 2)
    check_refused(run("kinarm-eval", *arguments), "no shipped policy is for", "left, right")


def test_of_many_trials_the_first_are_bounded(run, evaluated, monkeypatch):
    monkeypatch.setattr(bounds, "MOST_BOUNDED", 4)
    arguments = ("--policy", "zero", "--problem", "left", "--trials", 9)
    document = evaluated(*arguments)
    assert [row["trials"] for row in document["results"]] == [9, 4]
    assert document["protocol"]["problems"]["left"]["oracle"]["bounded"] == 4
    said = " ".join(run("kinarm-eval", *arguments).out.split())
    assert "are of the first 4 trials of 9; --policy oracle bounds all" in said
    whole = evaluated(*arguments, "--policy", "oracle")
    assert [row["trials"] for row in whole["results"]] == [9, 9]
    assert whole["protocol"]["problems"]["left"]["oracle"]["bounded"] == 9
