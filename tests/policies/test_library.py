"""The shipped policies, and loading by name, group or file."""

from importlib import resources

import pytest

from kinarm._files import shipped_files
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies.library import (
    group_of,
    load_policy,
    policy_files,
    policy_names,
)
from kinarm.problem import ReachProblem

NAMES = ("ars-paper-left-seed0", "ars-tuned-right-seed0", "ars-tuned-right-seed10", "ppo-both")


@pytest.fixture
def shipped(monkeypatch, tmp_path, make_policy):
    """A library of four policies."""
    (tmp_path / "policies").mkdir()
    for seed, name in enumerate(NAMES):
        make_policy(seed=seed).save(tmp_path / "policies" / f"{name}.npz")
    (tmp_path / "policies" / "notes.txt").write_text("no policy")
    monkeypatch.setattr(resources, "files", lambda _: tmp_path)
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
    assert "ars-paper-left, ars-tuned-right, ppo-both, path/to/policy.npz" in message


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
