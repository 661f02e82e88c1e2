"""Which policies are training seeds of one recipe, whatever their files are called."""

from dataclasses import replace
from pathlib import Path

import pytest

from kinarm.evaluation.contestants import BASELINES, ORACLE, Contestant
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.selection import group_names, named_apart
from kinarm.policies import Policy, recipe, train_policy
from kinarm.problem import PROBLEMS


@pytest.fixture(scope="module")
def trained() -> Policy:
    """A policy of which others are made that record another training."""
    return train_policy(recipe("ars", "paper", problem="right", iterations=1)).policy


@pytest.fixture
def contestant(trained):
    """A contestant that records a training."""

    def make(name, seed=0, folder="", problem="right", recipe_name="paper", **settings):
        made = replace(
            trained.provenance,
            seed=seed,
            recipe=recipe_name,
            problem=PROBLEMS[problem].pinned,
            config={**trained.provenance.config, "seed": seed, **settings},
        )
        policy = replace(trained, provenance=made)
        return Contestant.from_policy(name, policy, Path(f"/{folder}/{name}.npz"))

    return make


def groups_of(*contestants):
    return [group_names(contestants)[each.name] for each in contestants]


def test_names_of_files_do_not_matter(contestant):
    found = groups_of(contestant("a", 0), contestant("b", 1), contestant("run3", 7))
    assert found == ["ars-paper-right"] * 3


def test_a_name_that_all_share_is_kept(contestant):
    assert groups_of(contestant("mine-seed0", 0), contestant("mine-seed1", 1)) == ["mine", "mine"]


@pytest.mark.parametrize(
    "other",
    [{"noise": 0.5}, {"problem": "left"}, {"recipe_name": "tuned"}, {"iterations": 2}],
    ids=str,
)
def test_other_trainings_are_apart(contestant, other):
    assert groups_of(contestant("mine-seed0", 0), contestant("mine-seed1", 1, **other)) == [
        "mine-seed0",
        "mine-seed1",
    ]


def test_statistics_beside_a_model_do_not_tell_seeds_apart(contestant):
    one, other = (contestant(name, k, vec_normalize=name) for k, name in enumerate("ab"))
    assert groups_of(one, other) == ["ars-paper-right"] * 2


def test_without_a_seed_nothing_is_a_training_seed(contestant):
    assert groups_of(contestant("a", None), contestant("b", None)) == ["a", "b"]


def test_a_seed_counts_once(contestant):
    """Copies are no trainings of their own."""
    assert groups_of(contestant("a", 0), contestant("copy", 0)) == ["a", "copy"]


def test_folders_that_hold_the_same_seeds_are_apart(contestant):
    seeds = [
        contestant(f"{folder}/right-seed{seed}", seed, folder) for folder in "xy" for seed in (0, 1)
    ]
    assert groups_of(*seeds) == ["x/right", "x/right", "y/right", "y/right"]


def test_folders_that_hold_a_seed_each_are_together(contestant):
    seeds = [contestant(f"run{seed}/policy", seed, f"run{seed}") for seed in range(3)]
    assert groups_of(*seeds) == ["ars-paper-right"] * 3


def test_shipped_policies_are_apart_from_own_ones_with_the_same_seeds():
    shipped = find_contestants("ars-paper-right")
    own = [
        replace(each, name=f"run{each.seed}", source=Path(f"/run{each.seed}/p.npz"))
        for each in shipped
    ]
    found = groups_of(*shipped, *own)
    assert found[:4] == ["ars-paper-right (ars-paper-right-seed0, ...)"] * 4
    assert found[4:] == ["ars-paper-right (run0, ...)"] * 4


def test_contestants_without_training_keep_their_names(contestant):
    assert groups_of(*BASELINES.values(), ORACLE, contestant("a")) == [
        "random",
        "zero",
        "oracle",
        "a",
    ]


def test_files_that_are_called_alike_get_the_names_of_their_folders(contestant):
    shipped = find_contestants("ars-paper-right-seed0")[0]
    own = contestant(shipped.name, 0, "mine")
    other = contestant("other", 0, "mine")
    assert [each.name for each in named_apart([shipped, own, other])] == [
        shipped.name,
        f"mine/{shipped.name}",
        "other",
    ]
