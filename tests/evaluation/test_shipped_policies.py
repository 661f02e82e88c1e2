"""The trained policies that ship: complete, honest about their origin, and good enough."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.evaluation.entrants import find_entrants
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import ars_recipe, load_policy, policy_names, ppo_recipe
from kinarm.policies.mirror import Mirror
from kinarm.simulator import Simulator

ALGORITHMS, RECIPES, TASKS, SEEDS = ("ars", "ppo"), ("paper", "tuned"), ("left", "right", "both"), 4
SETTINGS = {"ars": ars_recipe, "ppo": ppo_recipe}
GROUPS = [f"{a}-{recipe}-{task}" for a in ALGORITHMS for recipe in RECIPES for task in TASKS]
NAMES = [f"{group}-seed{n}" for group in GROUPS for n in range(SEEDS)]
LINEAR = [name for name in NAMES if name.startswith("ars")]
NEURAL = [name for name in NAMES if name.startswith("ppo")]


def test_all_of_them_ship_and_nothing_else():
    assert sorted(policy_names()) == sorted(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_provenance_is_complete_and_that_of_the_released_recipe(name):
    policy = load_policy(name)
    algorithm, recipe, task, seed = name.split("-")
    made = policy.provenance
    assert (made.algorithm, made.recipe, made.task) == (algorithm, recipe, task)
    assert made.seed == int(seed.removeprefix("seed"))
    released = SETTINGS[algorithm](recipe, task=task, seed=made.seed)
    # Settings that have come since it was trained had no other value then.
    config = {**asdict(type(released)()), **made.config}
    assert json.dumps(config, sort_keys=True) == json.dumps(asdict(released), sort_keys=True)
    assert (made.arm, made.arm_digest) == ("paper", Arm.load("paper").digest)
    assert {"python", "kinarm", "numpy", "numba", "pin", "coal"} <= set(made.versions)
    assert made.commit
    assert not made.commit.endswith("-dirty"), "trained from changed sources"


@pytest.mark.parametrize("name", LINEAR)
def test_policies_of_ars_are_linear_and_their_training_was_complete(name):
    policy = load_policy(name)
    assert [layer.weights.shape for layer in policy.layers] == [(5, 48)]
    assert not policy.layers[0].bias.any()
    config = policy.provenance.config
    episodes = config["iterations"] * 2 * config["directions"] * config["episodes"]
    assert episodes <= policy.provenance.environment_steps <= episodes * config["horizon"]


@pytest.mark.parametrize("name", NEURAL)
def test_policies_of_ppo_have_hidden_layers_and_their_training_was_complete(name):
    policy = load_policy(name)
    assert len(policy.layers) == len(policy.provenance.config["hidden"]) + 1
    assert policy.provenance.environment_steps == 1_200_000
    assert {"torch", "stable-baselines3"} <= set(policy.provenance.versions)


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_is_all_its_training_seeds(group):
    assert [e.name for e in find_entrants(group)] == [f"{group}-seed{n}" for n in range(SEEDS)]
    weights = {load_policy(f"{group}-seed{n}").layers[0].weights.tobytes() for n in range(SEEDS)}
    assert len(weights) == SEEDS


@pytest.mark.parametrize("name", [f"ppo-tuned-both-seed{n}" for n in range(SEEDS)])
def test_symmetric_policies_treat_mirror_images_alike(name):
    """Actions for mirrored observations are mirrored, to the resolution of torch's numbers."""
    simulator = Simulator(task="both")
    mirror, trials = Mirror.of(simulator), TrialSet.draw(simulator, 100, seed=12345)
    observed = simulator.observe(trials.starts, trials.goals)
    actions = load_policy(name)(observed)
    np.testing.assert_allclose(
        load_policy(name)(observed * mirror.observations), actions * mirror.actions, atol=1e-6
    )


@pytest.mark.parametrize(
    ("group", "floor"),
    [
        ("ars-tuned-right", 0.85),
        ("ars-tuned-left", 0.85),
        ("ars-tuned-both", 0.60),
        ("ppo-tuned-right", 0.90),
        ("ppo-tuned-left", 0.90),
        ("ppo-tuned-both", 0.90),
    ],
)
def test_tuned_policies_reach(group, floor):
    """300 trials with a seed not used in training; the mean over training seeds."""
    task = group.rpartition("-")[2]
    trials = TrialSet.draw(Simulator(task=task), 300, seed=12345)
    rates = [run_trials(entrant, trials).success.value for entrant in find_entrants(group)]
    assert sum(rates) / len(rates) >= floor, rates
