"""Settings of Proximal Policy Optimization by name."""

from dataclasses import replace
from typing import Any

from kinarm.policies.config import rewarded_per_reach
from kinarm.policies.ppo.config import PPOConfig
from kinarm.problem import PROBLEMS
from kinarm.task import RewardWeights

TUNED = PPOConfig(
    recipe="tuned",
    n_envs=125,
    n_steps=16,
    batch_size=1000,
    net_arch=(64, 64, 64),
    learning_rate=1e-3,
    learning_rate_schedule="linear",
    gae_lambda=0.9,
    ent_coef=0.002,
    log_std_init=-0.7,
    training_tolerance=0.03,
    symmetric=True,
    reward=RewardWeights(success=5.0),
    initial_start_spread=0.2,
    widening=0.4,
)

WIDE: dict[str, Any] = {
    "net_arch": (128, 128, 128),
    "ent_coef": 0.0,
    "final_log_std": -3.0,
    "replay_share": 0.5,
    "replay_log_std": -1.4,
}
"""Wider networks, noise that falls to little, and failed scenarios again."""

TAUGHT = replace(
    TUNED,
    **WIDE,
    recipe="taught",
    demonstrations=10_000,
    learning_rate=5e-4,
    log_std_init=-1.4,
    initial_start_spread=1.0,
    widening=0.0,
    reward=RewardWeights(collision=-3.0, success=5.0),
)

MANY: dict[str, Any] = {"n_envs": 512, "batch_size": 2048, "n_epochs": 6, "learning_rate": 1e-3}
"""More arms at once, for longer trainings."""

BEST = replace(
    TAUGHT,
    **MANY,
    recipe="best",
    iterations=1400,
    reward=RewardWeights(collision=-5.0, success=5.0),
)

PRECISE = replace(
    BEST,
    recipe="precise",
    iterations=1465,
    initial_tolerance=0.03,
    training_tolerance=0.004,
    widening=0.4,
    stop_at_goal=True,
    final_log_std=-3.7,
    replay_noise_steps=6,
)

RECIPES = {
    "paper": PPOConfig(recipe="paper"),
    **{config.recipe: config for config in (TUNED, TAUGHT, BEST, PRECISE)},
}
"""PPO settings by name.

``paper``, ``tuned`` and ``taught`` take as many environment steps as the paper, 1.2 million,
``best`` and ``precise`` about 12 million.
"""


UNALIKE: dict[str, Any] = {
    "initial_gamma": 0.9,
    "initial_penalty": 0.05,
    "reward": RewardWeights(progress=12.0, collision=-6.0, success=5.0),
}
"""Settings of a recipe without the oracle's motions where several regions are to be reached and no
reflection maps them."""

CAREFUL = 5e-4
"""Largest learning rate there of a recipe that begins with the oracle's motions: with twice as
much, one seed in four forgot them, and took most of the training to learn again."""


def adapted(config: PPOConfig) -> PPOConfig:
    """Adapt all recipes but ``paper`` to their problem.

    Progress is rewarded in proportion to the arm's reach, and tolerances of the training are shares
    of the task's. Where several regions are to be reached and no reflection maps one to another,
    the future and contact count less at first: else contact is avoided long before all regions are
    reached. A learner that begins with the oracle's motions learns slowly enough to keep them.
    """
    from kinarm.policies.mirror import different_regions, missing_mirror  # loads Pinocchio

    if config.recipe not in RECIPES or config.recipe == "paper":
        return config
    problem, symmetric = config.problem, not missing_mirror(config.problem)
    if different_regions(problem, symmetric) > 1:
        kept = {"learning_rate": min(config.learning_rate, CAREFUL)}
        config = replace(config, **(kept if config.demonstrations else UNALIKE))
    scale = problem.task.tolerance / PROBLEMS["right"].task.tolerance
    tolerances = {
        name: round(scale * length, 9)
        for name in ("initial_tolerance", "training_tolerance")
        if (length := getattr(config, name)) is not None
    }
    return rewarded_per_reach(replace(config, symmetric=symmetric, **tolerances))
