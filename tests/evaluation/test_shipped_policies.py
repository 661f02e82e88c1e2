"""The trained policies that ship: complete, honest about their origin, and good enough."""

from dataclasses import asdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from kinarm.evaluation.evaluation import run_trials
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import load_policy, policy_names, recipe
from kinarm.policies.mirror import find_mirror
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.task import RewardWeights

ROOT = Path(__file__).parents[2]

PAPER = [(algorithm, "paper", problem) for algorithm in ("ars", "ppo") for problem in PROBLEMS]
OURS = [
    *(("ars", named) for named in ("tuned", "linear", "best")),
    ("ppo", "best"),
]
SEEDS = {
    **{"-".join(group): 4 for group in PAPER},
    **{f"{algorithm}-{named}-both": 10 for algorithm, named in OURS},
    "ppo-best-hard-paper": 4,
}
"""Training seeds of each group of policies."""

NAMES = [f"{group}-seed{n}" for group, seeds in SEEDS.items() for n in range(seeds)]
SYMMETRIC = [name for name in NAMES if name.split("-")[1] != "paper"]


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


def assert_made_by(config, made):
    """Settings that have come since it was trained had no other value then."""
    released = settings_of(config)
    reward = {**RECEIVED, **made.config.get("reward", asdict(made.problem.task.reward))}
    assert {**released, **made.config, "reward": reward} == released
    assert made.commit
    assert not made.commit.endswith("-dirty"), "trained from changed sources"


@pytest.mark.parametrize("problem", ["right", "both"])
def test_policies_of_the_example_are_of_the_recipe_without_its_mirror(problem):
    paths = sorted((ROOT / "data" / "results" / "linear_both" / problem).glob("*.npz"))
    for seed, path in enumerate(paths):
        policy = load_policy(path)
        config = recipe("ars", "tuned", problem=problem, symmetric=False, seed=seed)
        assert_made_by(config, policy.provenance)
        assert policy.mirror is None
    assert len(paths) == 4


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if "hard" in name else []) for name in NAMES],
)
def test_a_policy_is_what_the_released_recipe_makes_in_a_whole_training(name):
    policy = load_policy(name)
    (algorithm, named, *words, seed), made = name.split("-"), policy.provenance
    problem = "-".join(words)
    assert (made.algorithm, made.recipe) == (algorithm, named)
    assert made.seed == int(seed.removeprefix("seed"))
    assert policy.problem.name == problem
    shipped = ReachProblem.load(problem)
    assert policy.problem.faced_as(shipped).first_difference(shipped) is None
    assert_made_by(recipe(algorithm, named, problem=problem, seed=made.seed), made)
    assert {"python", "kinarm", "numpy", "numba", "pin", "coal"} <= set(made.versions)
    config, steps = made.config, made.environment_steps
    if algorithm == "ppo":
        assert steps == config["iterations"] * config["n_envs"] * config["n_steps"]
        assert {"torch", "stable-baselines3"} <= set(made.versions)
    else:
        episodes = config["iterations"] * 2 * config["directions"] * config["episodes"]
        assert episodes <= steps <= episodes * policy.problem.task.horizon
    widths = (policy.n_observations, *config.get("net_arch", ()), 5)
    assert policy.n_observations == {"hard-paper": 69}.get(problem, 53 if policy.residual else 48)
    shapes = [layer.weights.shape for layer in policy.layers]
    assert shapes == [(outputs, inputs) for inputs, outputs in pairwise(widths)]
    if len(shapes) == 1:
        assert not policy.layers[0].bias.any()


@pytest.mark.parametrize("group", SEEDS)
def test_a_group_is_all_its_training_seeds(group):
    names = [f"{group}-seed{n}" for n in range(SEEDS[group])]
    assert [contestant.bare().name for contestant in find_contestants(group)] == names
    weights = {load_policy(name).layers[0].weights.tobytes() for name in names}
    assert len(weights) == len(names)


def test_symmetric_policies_treat_mirror_images_alike():
    """Actions for mirrored observations are mirrored, up to rounding."""
    trials = TrialSet.draw("both", 100, seed=12345)
    for name in SYMMETRIC:
        policy = load_policy(name)
        world = trials.simulator.changed(observation=policy.observation).world
        mirror, observed = find_mirror(world), world.observe(trials.starts, trials.goals)
        image, actions = policy(observed * mirror.observations), policy(observed)
        np.testing.assert_allclose(image, actions * mirror.actions, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize(
    ("group", "floor"),
    [
        ("ars-tuned", 0.94),
        ("ars-linear", 0.96),
        ("ars-best", 0.975),
        ("ppo-best", 0.99),
    ],
)
def test_policies_reach(group, problem, floor):
    """1000 trials with a seed not used in training; the mean over training seeds."""
    trials = TrialSet.draw(problem, 1000, seed=12345)
    rates = [
        run_trials(contestant, trials).success.value
        for contestant in find_contestants(f"{group}-both")
    ]
    assert sum(rates) / len(rates) >= floor, rates
