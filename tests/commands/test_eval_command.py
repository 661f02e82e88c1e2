"""``kinarm-eval``: what it prints, what it writes, and that both are what the library computes."""

import json

import numpy as np
import pytest

from kinarm.evaluation.evaluations import evaluate

FILES = {"evaluation.json", "final_distance.png", "final_distance.svg"}


@pytest.fixture
def evaluated(run):
    """Run ``kinarm-eval --json`` and return the document."""

    def call(*arguments):
        answer = run("kinarm-eval", "--json", *arguments)
        assert (answer.status, answer.err) == (0, "")
        return json.loads(answer.out)

    return call


def faced(document) -> list[tuple[str, str]]:
    return [(row["policy"], row["task"]) for row in document["results"]]


def test_json_alone_is_printed_and_equals_the_library(evaluated, policy_folder):
    document = evaluated("--policy", policy_folder / "mine-seed0.npz", "--trials", 9, "--seed", 4)
    (row,) = document["results"]
    expected = evaluate(policy_folder / "mine-seed0.npz", trials=9, seed=4)
    assert row == json.loads(json.dumps(expected.to_json()))
    entry = document["protocol"]["tasks"]["right"]
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
    assert (protocol["trials"], protocol["seed"], protocol["arm"]) == (200, 0, "paper")


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
        ("random", "left"),
        ("random", "right"),
    ]


def test_named_task_is_what_named_policies_face(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "lefty.npz", "--task", "both", "--task", "right"),
        *("--trials", 3),
    )
    assert faced(document) == [("lefty", "both"), ("lefty", "right")]


def test_matrix_is_every_policy_on_every_task(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "lefty.npz", "--policy", "zero", "--trials", 3, "--matrix")
    )
    tasks = ("left", "right", "both")
    assert sorted(faced(document)) == sorted(
        (name, task) for name in ("lefty", "zero") for task in tasks
    )


def test_a_policy_named_twice_is_evaluated_once(evaluated, policy_folder):
    path = policy_folder / "mine-seed0.npz"
    assert len(evaluated("--policy", path, "--policy", path, "--trials", 2)["results"]) == 1


def test_a_task_named_twice_is_played_once(evaluated):
    document = evaluated("--policy", "zero", "--task", "left", "--task", "left", "--trials", 2)
    assert faced(document) == [("zero", "left")]


def test_training_seeds_of_files_are_pooled(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "mine-seed0.npz"),
        *("--policy", policy_folder / "mine-seed1.npz", "--trials", 3),
    )
    (pooled,) = document["pooled"]
    assert (pooled["policy"], pooled["training_seeds"]) == ("mine", [0, 1])


def test_two_files_of_one_name_are_not_mixed_up(run, policy_folder, policy, tmp_path):
    policy.save(tmp_path / "lefty.npz")
    answer = run(
        *("kinarm-eval", "--policy", policy_folder / "lefty.npz"),
        *("--policy", tmp_path / "lefty.npz", "--trials", 2),
    )
    assert (answer.status, answer.out) == (2, "")
    assert "two policies are called 'lefty'" in answer.err


def test_a_file_called_like_a_baseline_does_not_replace_it(run, policy, tmp_path):
    """Either both are evaluated or the clash is refused; nothing vanishes silently."""
    policy.save(tmp_path / "random.npz")
    answer = run(
        *("kinarm-eval", "--json", "--policy", tmp_path / "random.npz", "--policy", "random"),
        *("--trials", 2),
    )
    kinds = {row["algorithm"] for row in json.loads(answer.out or '{"results": []}')["results"]}
    assert answer.status == 2 or kinds == {"ars", "baseline"}


def test_an_arm_of_ones_choice(evaluated, policy_folder):
    arguments = ("--policy", policy_folder / "flange.npz", "--trials", 3)
    document = evaluated(*arguments, "--arm", "paper_flange")
    assert document["protocol"]["arm"] == "paper_flange"
    assert faced(document) == [("flange", "right")]


def test_another_arm_when_asked_for(evaluated, policy_folder):
    document = evaluated(
        *("--policy", policy_folder / "flange.npz", "--trials", 3, "--allow-other-arm")
    )
    assert (document["protocol"]["arm"], len(document["results"])) == ("paper", 1)


def test_table_for_people(run, policy_folder):
    answer = run("kinarm-eval", "--policy", policy_folder / "lefty.npz", "--trials", 3)
    assert (answer.status, answer.err) == (0, "")
    for words in ("lefty", "left", "3 trials", "seed 0", "arm paper"):
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
    assert len(lines) == 4
    assert all(line.startswith("|") and line.endswith("|") for line in lines)
    assert len({line.count("|") for line in lines}) == 1


def test_folder_is_created_and_filled(run, policy_folder, tmp_path):
    out = tmp_path / "deep" / "results"
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--trials", 4, "--out", out)
    answer = run("kinarm-eval", *arguments, "--json")
    assert {path.name for path in out.iterdir()} == FILES
    assert json.loads((out / "evaluation.json").read_text()) == json.loads(answer.out)


def test_earlier_results_are_replaced(run, tmp_path):
    (tmp_path / "evaluation.json").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    run("kinarm-eval", "--policy", "zero", "--task", "left", "--trials", 2, "--out", tmp_path)
    assert json.loads((tmp_path / "evaluation.json").read_text())["protocol"]["trials"] == 2
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_files_are_the_same_from_every_process(run, run_outside, policy_folder, tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--policy", "zero", "--trials", 9)
    assert run("kinarm-eval", *arguments, "--out", one).status == 0
    assert run_outside("kinarm-eval", *arguments, "--out", other)[0] == 0
    for name in FILES - {"evaluation.json"}:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
    first, second = (json.loads((path / "evaluation.json").read_text()) for path in (one, other))
    assert first["results"] == second["results"]
    assert first["protocol"]["tasks"] == second["protocol"]["tasks"]
    assert first["protocol"]["versions"] == second["protocol"]["versions"]


def test_without_policies_all_fitting_ones_and_the_baselines_take_part(evaluated):
    names = {name for name, _ in faced(evaluated("--trials", 1, "--arm", "paper_flange"))}
    assert names == {"random", "zero"}
