"""The shipped policies, and loading by name, group or file."""

import json
from pathlib import Path

import pytest

import kinarm.data
from kinarm._files import shipped_files
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies import library
from kinarm.policies.library import (
    best_policy,
    group_of,
    load_policy,
    policy_files,
    policy_names,
)
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_options import ProblemOptions

NAMES = ("ars-paper-left-seed0", "ars-tuned-right-seed0", "ars-tuned-right-seed10", "ppo-both")

OTHERS = [
    ProblemOptions(problem="right", arm="paper_flange").resolve(),
    ProblemOptions(problem="right", scene="table").resolve(),
]
"""An arm and a scene that no policy ships for; for the left bench, none is ranked."""


@pytest.fixture
def shipped(monkeypatch, tmp_path, make_policy):
    """A library of four policies."""
    (tmp_path / "policies").mkdir()
    for seed, name in enumerate(NAMES):
        make_policy(seed=seed).save(tmp_path / "policies" / f"{name}.npz")
    (tmp_path / "policies" / "notes.txt").write_text("no policy")
    monkeypatch.setattr(library.resources, "files", lambda _: tmp_path)
    shipped_files.cache_clear()
    yield tmp_path / "policies"
    monkeypatch.undo()
    shipped_files.cache_clear()


def test_load_by_name(shipped, make_policy):
    loaded = load_policy("ars-tuned-right-seed0")
    assert loaded.mean.tobytes() == make_policy(seed=1).mean.tobytes()


def test_group_has_the_files_of_all_its_seeds(shipped):
    files = policy_files("ars-tuned-right")
    assert [file.stem for file in files] == ["ars-tuned-right-seed0", "ars-tuned-right-seed10"]


def test_a_folder_holds_its_policies_in_the_order_of_their_numbers(tmp_path):
    with pytest.raises(InvalidInputError, match=r"no policy \(.npz\) in the folder"):
        policy_files(tmp_path)
    for name in ("b10", "b9"):
        (tmp_path / f"{name}.npz").touch()
    assert [file.stem for file in policy_files(tmp_path)] == ["b9", "b10"]


def test_unknown_name_lists_the_groups(shipped):
    with pytest.raises(UnknownNameError) as caught:
        load_policy("ars-mine")
    message = str(caught.value)
    assert "unknown policy 'ars-mine'" in message
    assert "best, ars-paper-left, ars-tuned-right, ppo-both, path/to/policy.npz" in message


def test_group_is_the_name_without_the_seed():
    assert [group_of(f"a{end}") for end in ("-seed123", "", "-seed0-b")] == ["a", "a", "a-seed0-b"]


def test_every_shipped_policy_loads_and_fits_its_arm(shipped_arms):
    shipped_files.cache_clear()
    for name in policy_names():
        policy = load_policy(name)
        made = policy.provenance
        policy.check_arm(shipped_arms[made.problem.arm.name])
        shipped = ReachProblem.load(made.problem.name)
        assert made.problem.faced_as(shipped).first_difference(shipped) is None
        assert made.problem.arm.digest == shipped.arm_digest
        assert name == f"{made.algorithm}-{made.recipe}-{made.problem.name}-seed{made.seed}"


@pytest.fixture
def ranked(shipped):
    """Some of them are ranked, on two problems."""
    best = {"right": NAMES[2], "both": "ppo-both"}
    (shipped / "leaderboard.json").write_text(json.dumps({"best": best}))
    (shipped.parent / "arms").symlink_to(Path(kinarm.data.__file__).parent / "arms")
    return shipped


def test_the_best_policy_is_the_recorded_one(ranked, make_policy):
    assert best_policy("right") == "ars-tuned-right-seed10"
    assert best_policy(PROBLEMS["both"]) == "ppo-both"
    loaded = load_policy("best", "right")
    assert loaded.mean.tobytes() == make_policy(seed=2).mean.tobytes()
    assert [file.stem for file in policy_files("best", "both")] == ["ppo-both"]


def test_tolerance_horizon_reward_and_starts_do_not_change_the_best(ranked):
    changed = PROBLEMS["right"].replace(tolerance=0.01, horizon=100, start_spread=0.5, name="mine")
    assert best_policy(changed) == "ars-tuned-right-seed10"


@pytest.mark.parametrize("problem", [*OTHERS, "left"])
def test_other_arms_and_scenes_have_no_best_policy(ranked, problem):
    with pytest.raises(InvalidInputError, match="no shipped policy is for .*: they are for right"):
        best_policy(problem)


def test_the_best_is_for_a_problem(ranked):
    with pytest.raises(InvalidInputError, match="'best' is the best policy for a problem: name a"):
        load_policy("best")
