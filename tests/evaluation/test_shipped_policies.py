"""The trained policies that ship: complete, honest about their origin, and good enough."""

from dataclasses import asdict

import numpy as np
import pytest

from kinarm.evaluation.entrants import find_entrants
from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import load_policy, policy_names, recipe
from kinarm.policies.mirror import find_mirror
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights

ALGORITHMS, RECIPES, SEEDS = ("ars", "ppo"), ("paper", "tuned"), 4
GROUPS = [f"{a}-{named}-{problem}" for a in ALGORITHMS for named in RECIPES for problem in PROBLEMS]
NAMES = [f"{group}-seed{n}" for group in GROUPS for n in range(SEEDS)]
LINEAR = [name for name in NAMES if name.startswith("ars")]
NEURAL = [name for name in NAMES if name.startswith("ppo")]


def test_all_of_them_ship_and_nothing_else():
    assert sorted(policy_names()) == sorted(NAMES)


RECEIVED = asdict(RewardWeights())


def settings_of(config):
    """Settings of a learner as provenance holds them; what is left to the problem is its own."""
    task = config.problem.task
    settings = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in asdict(config).items()
        if name != "problem"
    }
    settings["reward"] = asdict(config.reward or task.reward)
    if settings.get("training_tolerance", 0) is None:
        settings["training_tolerance"] = task.tolerance
    return settings


CHANGED_SINCE: dict[tuple[str, str, str], set[str]] = {
    ("ars", "tuned", "both"): {"reward"},
    ("ars", "tuned", "left"): {"symmetric"},
    ("ars", "tuned", "right"): {"symmetric"},
    ("ppo", "tuned", "left"): {"symmetric"},
    ("ppo", "tuned", "right"): {"symmetric"},
}
"""What recipes have changed since the policies were trained, under semantics version 3."""


@pytest.mark.parametrize("name", NAMES)
def test_provenance_is_complete_and_that_of_the_released_recipe(name):
    policy = load_policy(name)
    algorithm, named, problem, seed = name.split("-")
    made = policy.provenance
    assert (made.algorithm, made.recipe) == (algorithm, named)
    assert made.seed == int(seed.removeprefix("seed"))
    assert policy.problem.name == problem
    assert policy.problem.first_difference(PROBLEMS[problem]) is None
    released = settings_of(recipe(algorithm, named, problem=problem, seed=made.seed))
    # Settings that have come since it was trained had no other value then.
    config = {**released, **made.config, "reward": {**RECEIVED, **made.config["reward"]}}
    changed = {name for name, value in config.items() if value != released[name]}
    assert changed <= CHANGED_SINCE.get((algorithm, named, problem), set())
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
    assert episodes <= policy.provenance.environment_steps <= episodes * policy.problem.task.horizon


@pytest.mark.parametrize("name", NEURAL)
def test_policies_of_ppo_have_hidden_layers_and_their_training_was_complete(name):
    policy = load_policy(name)
    assert len(policy.layers) == len(policy.provenance.config["net_arch"]) + 1
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
    trials = TrialSet.draw("both", 100, seed=12345)
    world = trials.simulator.world
    mirror, observed = find_mirror(world), world.observe(trials.starts, trials.goals)
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
    trials = TrialSet.draw(group.rpartition("-")[2], 300, seed=12345)
    rates = [run_trials(entrant, trials).success.value for entrant in find_entrants(group)]
    assert sum(rates) / len(rates) >= floor, rates
