"""The trained policies that ship: complete, honest about their origin, and good enough."""

from dataclasses import asdict

import pytest

from kinarm.arm import Arm
from kinarm.evaluation.entrants import Entrant, find_entrants
from kinarm.evaluation.evaluations import run_trials
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import ars_recipe, load_policy, policy_names
from kinarm.simulator import Simulator

RECIPES, TASKS, SEEDS = ("paper", "tuned"), ("left", "right", "both"), range(4)
NAMES = [f"ars-{recipe}-{task}-seed{n}" for recipe in RECIPES for task in TASKS for n in SEEDS]


def test_all_of_them_ship_and_nothing_else():
    assert sorted(policy_names()) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_provenance_is_complete_and_that_of_the_released_recipe(name):
    policy = load_policy(name)
    _, recipe, task, seed = name.split("-")
    made = policy.provenance
    assert (made.algorithm, made.recipe, made.task) == ("ars", recipe, task)
    assert made.seed == int(seed.removeprefix("seed"))
    assert made.config == asdict(ars_recipe(recipe, task=task, seed=made.seed))
    assert (made.arm, made.arm_digest) == ("paper", Arm.load("paper").digest)
    assert {"python", "kinarm", "numpy", "numba", "pin", "coal"} <= set(made.versions)
    assert made.commit
    assert not made.commit.endswith("-dirty"), "trained from changed sources"


@pytest.mark.parametrize("name", NAMES)
def test_policies_are_linear_and_their_training_was_complete(name):
    policy = load_policy(name)
    assert [layer.weights.shape for layer in policy.layers] == [(5, 48)]
    assert not policy.layers[0].bias.any()
    config = policy.provenance.config
    episodes = config["iterations"] * 2 * config["directions"] * config["episodes"]
    assert episodes <= policy.provenance.environment_steps <= episodes * config["horizon"]


@pytest.mark.parametrize("recipe", RECIPES)
@pytest.mark.parametrize("task", TASKS)
def test_a_group_is_all_its_training_seeds(recipe, task):
    group = f"ars-{recipe}-{task}"
    assert [e.name for e in find_entrants(group)] == [f"{group}-seed{n}" for n in SEEDS]
    weights = {load_policy(f"{group}-seed{n}").layers[0].weights.tobytes() for n in SEEDS}
    assert len(weights) == len(SEEDS)


@pytest.mark.parametrize(("task", "floor"), [("right", 0.85), ("left", 0.85), ("both", 0.60)])
def test_tuned_policies_reach(task, floor):
    """300 trials with a seed not used in training; the mean over training seeds."""
    trials = TrialSet.draw(Simulator(task=task), 300, seed=12345)
    entrants = [
        Entrant.from_policy(name, load_policy(name))
        for name in (f"ars-tuned-{task}-seed{n}" for n in SEEDS)
    ]
    rates = [run_trials(entrant, trials).success.rate for entrant in entrants]
    assert sum(rates) / len(rates) >= floor, rates
