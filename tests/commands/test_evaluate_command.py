"""``kinarm-eval``: what it prints, what it writes, and that both are what the library computes."""

import json

import numpy as np
from documents import faced

from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.evaluation import evaluate
from kinarm.evaluation.request import EvaluationRequest
from kinarm.evaluation.selection import select_pairs
from kinarm.policies import recipe, train_policy
from kinarm.policies.library import group_of
from kinarm.problem import PROBLEMS


def test_json_alone_is_printed_and_equals_the_library(evaluated, policy_folder):
    document = evaluated("--policy", policy_folder / "mine-seed0.npz", "--trials", 9, "--seed", 4)
    expected, oracle = (
        evaluate(contestant, "right", trials=9, seed=4, oracle=True)
        for contestant in (policy_folder / "mine-seed0.npz", "oracle")
    )
    assert document["results"] == [expected.result.to_json(), oracle.result.to_json()]
    entry = document["protocol"]["problems"]["right"]
    assert entry["oracle"] == bounds_document(expected.bounds).to_json()
    assert entry["trial_set_hash"] == expected.trials.digest
    np.testing.assert_array_equal(entry["starts"], expected.trials.starts)


def test_a_problem_without_policies_is_told(run):
    answer = run("kinarm-eval", "--problem", "table-paper", "--trials", 1, "--no-oracle")
    assert (answer.status, answer.err) == (0, "")
    assert answer.out.splitlines()[-1] == "no shipped policy was trained for this"


def test_what_ships_for_a_problem_takes_part_where_it_is_named():
    request = EvaluationRequest(problems=("hard-paper", "left"), plant="ideal", oracle=False)
    groups = {(group_of(each.name), problem.name) for each, problem in select_pairs(request)}
    assert ("ppo-best-hard-paper", "hard-paper") in groups
    assert ("ppo-best-both", "left") in groups
    assert {name for name, problem in groups if problem == "hard-paper"} == {
        *("ppo-best-hard-paper", "ppo-best-hard-paper+shield", "random", "zero"),
    }


def test_how_steps_were_tested_in_training_is_told(run, tmp_path):
    problem = PROBLEMS["right"].replace(tested_configurations=4)
    policy = train_policy(recipe("ars", "tuned", problem=problem, iterations=1)).policy
    policy.save(tmp_path / "ars-tuned-right-seed0.npz")
    answer = run("kinarm-eval", "--policy", tmp_path, "--trials", 1, "--no-oracle")
    assert answer.status == 0, answer.err
    assert "training tested steps for contact at 4 configurations" in answer.out.splitlines()


def test_policies_need_no_option(evaluated, policy_folder):
    few = ("--problem", "right", "--trials", 2, "--no-oracle")
    names = (policy_folder / "mine-seed0.npz", "zero")
    expected = evaluated("--policy", *names, *few)["results"]
    assert evaluated(*names, *few)["results"] == expected
    assert evaluated(*few, *names)["results"] == expected
    assert evaluated(names[0], *few, "--policy", names[1])["results"] == expected


def test_without_policies_all_fitting_ones_and_the_baselines_take_part(evaluated):
    names = {name for name, _ in faced(evaluated("--trials", 1, "--arm", "paper_flange"))}
    assert names == {"random", "zero", "oracle"}


def test_the_request_does_as_the_command_does(evaluated, policy_folder, tmp_path):
    path = str(policy_folder / "mine-seed0.npz")
    request = EvaluationRequest(policies=(path,), trials=4, tolerance=0.1, out=tmp_path)
    document = request.run().to_json()
    printed = evaluated("--policy", path, "--trials", 4, "--tolerance", 0.1)
    assert document["results"] == printed["results"]
    assert json.loads((tmp_path / "evaluation.json").read_text()) == document
    assert "EvaluationRequest(" in document["protocol"]["command"]


def test_changes_apply_to_what_policies_were_trained_for(policy_folder):
    files = tuple(str(policy_folder / f"{name}.npz") for name in ("lefty", "mine-seed0"))
    request = EvaluationRequest(policies=(*files, "zero"), tolerance=0.2, oracle=False)
    faced = [(contestant.name, problem) for contestant, problem in select_pairs(request)]
    assert [(name, problem.name) for name, problem in faced] == [
        ("lefty", "left"),
        ("zero", "left"),
        ("mine-seed0", "right"),
        ("zero", "right"),
    ]
    for _, problem in faced:
        assert problem.digest == PROBLEMS[problem.name].replace(tolerance=0.2).digest


def problems_of(document):
    return document["protocol"]["problems"].values()


def compared(document) -> list[tuple[str, str, str]]:
    return [(row["policy"], row["reference"], row["problem"]) for row in document["differences"]]


def test_the_first_that_is_named_is_the_reference(evaluated, run, policy_folder, monkeypatch):
    lefty = policy_folder / "lefty.npz"
    asked = ("--policy", "zero", "--policy", lefty, "--policy", "random", "--problem", "left")
    document = evaluated(*asked, "--trials", 9)
    assert sorted(compared(document)) == [("lefty", "zero", "left"), ("random", "zero", "left")]
    assert compared(evaluated(*asked[:2], *asked[-2:], "--trials", 2)) == []
    first, second = (evaluate(each, "left", trials=9) for each in (lefty, "zero"))
    (row,) = (row for row in document["differences"] if row["policy"] == "lefty")
    expected = first.difference(second)["success"]
    assert row["metrics"]["success"] == expected.to_json()
    for width in ("80", "120"):
        monkeypatch.setenv("COLUMNS", width)
        table = run("kinarm-eval", *asked, "--trials", 9).out
        assert "less zero" in table
        assert f"{100 * expected.value:+.1f} (" in table
    assert "less zero" in run("kinarm-eval", *asked, "--trials", 9, "--markdown").out
    chosen = run("kinarm-eval", *asked, "--trials", 9, "--columns", "iqm_distance,mean_steps").out
    (heading,) = (line for line in chosen.splitlines() if "less zero" in line)
    assert heading.split()[-3:] == ["iqm", "distance", "m"]
    for columns in ("mean_steps", "success_range"):
        assert "less" not in run("kinarm-eval", *asked, "--trials", 9, "--columns", columns).out
