"""Which policies are training seeds of one recipe, whatever their files are called."""

from dataclasses import replace
from pathlib import Path

import pytest

from kinarm.evaluation.entrants import BASELINES, ORACLE, Entrant, find_entrants
from kinarm.evaluation.training_seeds import group_names, named_apart
from kinarm.policies import Policy, recipe, train_policy
from kinarm.problem import PROBLEMS


@pytest.fixture(scope="module")
def trained() -> Policy:
    """A policy of which others are made that record another training."""
    return train_policy(recipe("ars", "paper", problem="right", iterations=1)).policy


@pytest.fixture
def entrant(trained):
    """An entrant that records a training."""

    def make(name, seed=0, folder="", problem="right", recipe_name="paper", **settings):
        made = replace(
            trained.provenance,
            seed=seed,
            recipe=recipe_name,
            problem=PROBLEMS[problem].pinned,
            config={**trained.provenance.config, "seed": seed, **settings},
        )
        policy = replace(trained, provenance=made)
        return Entrant.from_policy(name, policy, Path(f"/{folder}/{name}.npz"))

    return make


def groups_of(*entrants):
    return [group_names(entrants)[each.name] for each in entrants]


def test_names_of_files_do_not_matter(entrant):
    found = groups_of(entrant("a", 0), entrant("b", 1), entrant("run3", 7))
    assert found == ["ars-paper-right"] * 3


def test_a_name_that_all_share_is_kept(entrant):
    assert groups_of(entrant("mine-seed0", 0), entrant("mine-seed1", 1)) == ["mine", "mine"]


@pytest.mark.parametrize(
    "other",
    [{"noise": 0.5}, {"problem": "left"}, {"recipe_name": "tuned"}, {"iterations": 2}],
    ids=str,
)
def test_other_trainings_are_apart(entrant, other):
    assert groups_of(entrant("mine-seed0", 0), entrant("mine-seed1", 1, **other)) == [
        "mine-seed0",
        "mine-seed1",
    ]


def test_statistics_beside_a_model_do_not_tell_seeds_apart(entrant):
    one, other = (entrant(name, k, vec_normalize=name) for k, name in enumerate("ab"))
    assert groups_of(one, other) == ["ars-paper-right"] * 2


def test_without_a_seed_nothing_is_a_training_seed(entrant):
    assert groups_of(entrant("a", None), entrant("b", None)) == ["a", "b"]


def test_a_seed_counts_once(entrant):
    """Copies are no trainings of their own."""
    assert groups_of(entrant("a", 0), entrant("copy", 0)) == ["a", "copy"]


def test_folders_that_hold_the_same_seeds_are_apart(entrant):
    seeds = [
        entrant(f"{folder}/right-seed{seed}", seed, folder) for folder in "xy" for seed in (0, 1)
    ]
    assert groups_of(*seeds) == ["x/right", "x/right", "y/right", "y/right"]


def test_folders_that_hold_a_seed_each_are_together(entrant):
    seeds = [entrant(f"run{seed}/policy", seed, f"run{seed}") for seed in range(3)]
    assert groups_of(*seeds) == ["ars-paper-right"] * 3


def test_shipped_policies_are_apart_from_own_ones_with_the_same_seeds():
    shipped = find_entrants("ars-paper-right")
    own = [
        replace(each, name=f"run{each.seed}", source=Path(f"/run{each.seed}/p.npz"))
        for each in shipped
    ]
    found = groups_of(*shipped, *own)
    assert found[:4] == ["ars-paper-right (ars-paper-right-seed0, ...)"] * 4
    assert found[4:] == ["ars-paper-right (run0, ...)"] * 4


def test_entrants_without_training_keep_their_names(entrant):
    assert groups_of(*BASELINES.values(), ORACLE, entrant("a")) == ["random", "zero", "oracle", "a"]


def test_files_that_are_called_alike_get_the_names_of_their_folders(entrant):
    shipped = find_entrants("ars-paper-right-seed0")[0]
    own = entrant(shipped.name, 0, "mine")
    other = entrant("other", 0, "mine")
    assert [each.name for each in named_apart([shipped, own, other])] == [
        shipped.name,
        f"mine/{shipped.name}",
        "other",
    ]
