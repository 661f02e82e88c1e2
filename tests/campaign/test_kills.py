"""The small campaign of kills: one of each kind of run."""

import pytest

from .kills import campaign


@pytest.mark.slow
@pytest.mark.parametrize("name", ["train, ars", "compare"])
def test_a_killed_run_ends_as_an_undisturbed_one(name):
    tallies = campaign(2, seed=0, names=[name], each=2)
    assert tallies[name].examples == {}
    assert tallies[name].ends == 1
