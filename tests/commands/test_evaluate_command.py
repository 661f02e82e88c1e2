"""``kinarm-eval``: what it prints, what it writes, and that both are what the library computes."""

import json

import numpy as np
import pytest
from oracle_calls import count_calls

from kinarm.errors import InvalidInputError
from kinarm.evaluation.bounds import bounds_document
from kinarm.evaluation.commands.evaluate import EvaluationRequest
from kinarm.evaluation.evaluation import evaluate
from kinarm.problem import PROBLEMS

FILES = {"evaluation.json", "final_distance.png", "final_distance.svg"}


@pytest.fixture
def evaluated(run):
    """Run ``kinarm-eval --json`` and return the document."""

    def call(*arguments):
        answer = run("kinarm-eval", "--json", *arguments)
        assert (answer.status, answer.err) == (0, "")
        return json.loads(answer.out)

    return call


@pytest.fixture
def solved(monkeypatch) -> list[int]:
    """How many trials the oracle is asked to solve, call by call."""
    return count_calls(monkeypatch)


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def relative_success(row):
    """Success over that of the oracle, as a row of a document says."""
    return row["metrics"]["relative_success"]["value"]


def faced(document) -> list[tuple[str, str]]:
    return [(row["policy"], row["problem"]) for row in document["results"]]


def test_json_alone_is_printed_and_equals_the_library(evaluated, policy_folder):
    document = evaluated("--policy", policy_folder / "mine-seed0.npz", "--trials", 9, "--seed", 4)
    expected, oracle = (
        evaluate(entrant, "right", trials=9, seed=4, oracle=True)
        for entrant in (policy_folder / "mine-seed0.npz", "oracle")
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


def test_folder_is_created_and_filled(run, policy_folder, tmp_path):
    out = tmp_path / "deep" / "results"
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--trials", 4, "--out", out)
    answer = run("kinarm-eval", *arguments, "--json")
    assert {path.name for path in out.iterdir()} == FILES
    assert json.loads((out / "evaluation.json").read_text()) == json.loads(answer.out)


def test_earlier_results_are_replaced_when_asked_for(run, tmp_path):
    (tmp_path / "evaluation.json").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    arguments = ("--policy", "zero", "--problem", "left", "--trials", 2, "--out", tmp_path)
    refused = run("kinarm-eval", *arguments)
    assert refused.status == 2
    assert "evaluation.json' exists: --overwrite replaces it" in refused.err
    assert (tmp_path / "evaluation.json").read_text() == "old"
    run("kinarm-eval", *arguments, "--overwrite")
    assert json.loads((tmp_path / "evaluation.json").read_text())["protocol"]["trials"] == 2
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_report_is_one_page(run, policy_folder, tmp_path):
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--trials", 4)
    answer = run("kinarm-eval", *arguments, "--report", tmp_path / "new" / "report")
    assert (answer.status, answer.err) == (0, "")
    (page,) = (tmp_path / "new" / "report").iterdir()
    assert page.name == "index.html"
    assert str(page) in "".join(answer.out.split("\n"))
    text = page.read_text(encoding="utf-8")
    assert "mine-seed0" in text
    assert evaluate("zero", "right", trials=4).trials.digest in text
    assert "kinarm-eval --policy" in text


def test_report_and_results_share_a_folder(run, tmp_path):
    arguments = ("--policy", "zero", "--task", "left", "--trials", 2, "--json")
    answer = run("kinarm-eval", *arguments, "--out", tmp_path, "--report", tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {*FILES, "index.html"}
    assert json.loads(answer.out) == json.loads((tmp_path / "evaluation.json").read_text())


def test_report_is_the_same_from_every_process(run, run_outside, policy_folder, tmp_path):
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--trials", 9)
    arguments = (*arguments, "--report", tmp_path / "report", "--overwrite")
    pages = []
    for call in (run, run_outside):
        assert call("kinarm-eval", *arguments).status == 0
        pages.append((tmp_path / "report" / "index.html").read_bytes())
    assert pages[0] == pages[1]


def test_files_are_the_same_from_every_process(run, run_outside, policy_folder, tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    arguments = ("--policy", policy_folder / "mine-seed0.npz", "--policy", "zero", "--trials", 9)
    assert run("kinarm-eval", *arguments, "--out", one).status == 0
    assert run_outside("kinarm-eval", *arguments, "--out", other)[0] == 0
    for name in FILES - {"evaluation.json"}:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
    first, second = (json.loads((path / "evaluation.json").read_text()) for path in (one, other))
    assert first["results"] == second["results"]
    assert first["protocol"]["problems"] == second["protocol"]["problems"]
    assert first["protocol"]["versions"] == second["protocol"]["versions"]


def test_without_policies_all_fitting_ones_and_the_baselines_take_part(evaluated):
    names = {name for name, _ in faced(evaluated("--trials", 1, "--arm", "paper_flange"))}
    assert names == {"random", "zero", "oracle"}


def test_the_oracle_alone(evaluated):
    document = evaluated("--policy", "oracle", "--task", "right", "--trials", 5)
    (row,) = document["results"]
    assert (row["policy"], row["algorithm"], row["problem"]) == ("oracle", "oracle", "right")
    assert (row["trained_on"], row["training_seed"]) == (None, None)
    figures = {name: entry["value"] for name, entry in row["metrics"].items()}
    assert (figures["success"], figures["collision"]) == (1, 0)
    assert relative_success(row) == 1
    bounds = document["protocol"]["problems"]["right"]["oracle"]
    assert row["outcomes"]["steps"] == bounds["trials"]["steps"]
    assert row["outcomes"]["final_distance"] == bounds["trials"]["final_distance"]


def test_the_oracle_lists_what_it_cannot_solve(evaluated):
    arguments = ("--policy", "oracle", "--task", "right", "--arm", "paper_flange", "--seed", 2)
    document = evaluated(*arguments, "--trials", 12)
    (row,) = document["results"]
    bounds = document["protocol"]["problems"]["right"]["oracle"]
    solved = row["outcomes"]["outcome"].count("success")
    success = row["metrics"]["success"]["value"]
    assert 0 < success == bounds["success"]["value"] == solved / 12 < 1
    assert relative_success(row) == 1
    unsolved = [i for i, reachable in enumerate(bounds["trials"]["reachable"]) if not reachable]
    assert [entry["trial"] for entry in bounds["unsolved"]] == unsolved
    assert len(unsolved) == 12 - solved
    assert any("proven" in entry["reason"] for entry in bounds["unsolved"])
    assert all(row["outcomes"]["final_distance"][trial] > 0.05 for trial in unsolved)


@pytest.mark.parametrize(
    ("arguments", "tasks"),
    [
        (["zero"], ["left", "right", "both"]),
        (["zero", "oracle"], ["left", "right", "both"]),
        (["oracle"], ["left", "right", "both"]),
        (["oracle", "oracle", "--problem", "left", "--problem", "left"], ["left"]),
        (["zero", "oracle", "--problem", "both", "--problem", "left"], ["both", "left"]),
        (["oracle", "zero", "--matrix"], ["left", "right", "both"]),
    ],
)
def test_the_oracle_faces_every_task_in_play_once(evaluated, arguments, tasks):
    words = (
        word for name in arguments if name in ("zero", "oracle") for word in ("--policy", name)
    )
    others = [word for word in arguments if word not in ("zero", "oracle")]
    document = evaluated(*words, *others, "--trials", 2)
    assert [task for name, task in faced(document) if name == "oracle"] == tasks
    assert list(document["protocol"]["problems"]) == tasks


def test_the_oracle_joins_those_who_are_entered_by_default(evaluated):
    document = evaluated("--task", "left", "--trials", 2)
    assert faced(document).count(("oracle", "left")) == 1
    assert {task for _, task in faced(document)} == {"left"}
    for row in (*document["results"], *document["pooled"]):
        assert relative_success(row) is not None


def test_without_the_oracle_nothing_is_solved(evaluated, solved, empty_cache):
    document = evaluated("--policy", "zero", "--trials", 2, "--no-oracle")
    assert faced(document) == [("zero", task) for task in ("left", "right", "both")]
    assert all(entry["oracle"] is None for entry in document["protocol"]["problems"].values())
    assert all(relative_success(row) is None for row in document["results"])
    assert solved == []
    assert not empty_cache.exists()


def test_the_oracle_may_be_named_and_its_bounds_left_out(evaluated):
    document = evaluated("--policy", "oracle", "--task", "left", "--trials", 2, "--no-oracle")
    (row,) = document["results"]
    assert (row["metrics"]["success"]["value"], relative_success(row)) == (1, None)
    assert document["protocol"]["problems"]["left"]["oracle"] is None


def test_trials_are_solved_once_and_then_looked_up(evaluated, solved, empty_cache):
    arguments = ("--policy", "zero", "--policy", "random", "--task", "right", "--trials", 3)
    first, second = evaluated(*arguments), evaluated(*arguments)
    assert solved == [3]
    assert len(list(empty_cache.iterdir())) == 1
    assert first == second


def test_an_empty_cache_is_filled_without_a_word(run_outside, empty_cache):
    arguments = ("--policy", "zero", "--task", "right", "--trials", 2)
    answer = run_outside("kinarm-eval", *arguments)
    assert (answer.status, answer.err) == (0, "")
    assert len(list(empty_cache.iterdir())) == 1


def test_a_cache_that_cannot_be_used_is_done_without(evaluated, tmp_path, monkeypatch):
    arguments = ("--policy", "zero", "--task", "right", "--trials", 2)
    expected = evaluated(*arguments)
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "file"))
    assert evaluated(*arguments) == expected
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["--policy", "lefty.npz", "--policy", "flange.npz", "--matrix"],
            ["called 'right'", "arm"],
        ),
        (["--policy", "flange.npz", "--problem", "right"], ["'paper_flange'", "'paper'"]),
        (["--policy", "flange.npz", "--problem", "left"], ["'paper_flange'", "'paper'"]),
        (["--policy", "lefty.npz", "--arm", "paper_flange"], ["'paper_flange'", "'paper'"]),
        (["--policy", "zero", "--task", "left", "--out", "lefty.npz"], ["lefty.npz"]),
        (["--policy", "zero", "--task", "left", "--report", "lefty.npz"], ["lefty.npz"]),
        (["--policy", "zero", "--policy", "nobody"], ["'nobody'", "random, zero, oracle"]),
    ],
)
def test_what_is_refused_is_refused_before_trials_are_solved(
    run, policy_folder, solved, empty_cache, arguments, words
):
    paths = [policy_folder / word if word.endswith(".npz") else word for word in arguments]
    answer = run("kinarm-eval", "--trials", 2, *paths)
    assert (answer.status, answer.out, len(answer.err.splitlines())) == (2, "", 1)
    for word in words:
        assert word in answer.err
    assert solved == []
    assert not empty_cache.exists()


def test_a_file_called_oracle_is_not_mixed_up_with_the_oracle(run, policy, tmp_path):
    """Either the clash is refused or one can tell the rows apart."""
    policy.save(tmp_path / "oracle.npz")
    answer = run("kinarm-eval", "--json", "--policy", tmp_path / "oracle.npz", "--trials", 2)
    if answer.status == 0:
        rows = json.loads(answer.out)["results"]
        assert len({row["policy"] for row in rows}) == len(rows)
    else:
        assert "two policies are called 'oracle'" in answer.err


def test_table_tells_how_far_the_proofs_got(run):
    arguments = ("--policy", "zero", "--task", "right", "--trials", 5)
    share = evaluate("zero", "right", trials=5, oracle=True).bounds.tight.mean()
    beside, alone = (run("kinarm-eval", *arguments, *more).out for more in ([], ["--no-oracle"]))
    assert f"proofs complete: right {100 * share:.1f} %" in beside
    assert "proofs complete" not in alone


def test_histograms_leave_out_the_oracle_unless_it_is_alone(run, policy_folder, tmp_path):
    for folder, more in (("beside", []), ("alone", ["--no-oracle"])):
        arguments = ("--policy", policy_folder / "lefty.npz", "--trials", 4, *more)
        assert run("kinarm-eval", *arguments, "--out", tmp_path / folder).status == 0
    name = "final_distance.svg"
    assert (tmp_path / "beside" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()
    arguments = ("--policy", "oracle", "--task", "left", "--trials", 4, "--out", tmp_path / "only")
    assert run("kinarm-eval", *arguments).status == 0
    assert "oracle" in (tmp_path / "only" / name).read_text()


def test_what_is_being_done_is_told(empty_cache):
    told = []
    request = EvaluationRequest(policies=("zero",), problem="right", trials=3)
    request.evaluate(told.append)
    request.evaluate(told.append)
    solving, *evaluating = told
    assert "right" in solving
    assert "3 of 3 trials solved" in solving
    assert evaluating == ["evaluating on right"] * 2


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
    faced = [(entrant.name, problem) for entrant, problem in request.pairs()]
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
