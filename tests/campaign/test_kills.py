"""The small campaign of kills: one of each kind of run."""

import pytest

from .kills import RUNS, campaign


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kills"), [("train, ars", 2), ("compare", 1)])
def test_a_killed_run_ends_as_an_undisturbed_one(name, kills):
    tallies = campaign(kills, seed=0, names=[name], each=kills)
    assert tallies[name].examples == {}
    assert tallies[name].ends == 1


def test_a_training_is_complete_once_its_policy_is_there_without_a_checkpoint(tmp_path):
    run = RUNS["train, ars"]
    assert not run.complete(tmp_path)
    (tmp_path / "p.npz").touch()
    assert run.complete(tmp_path)
    (tmp_path / "p.checkpoint.npz").touch()
    assert not run.complete(tmp_path)


def test_a_comparison_goes_on_with_the_same_command_however_far_it_is(tmp_path):
    (tmp_path / "out").mkdir()
    assert not RUNS["compare"].complete(tmp_path)
