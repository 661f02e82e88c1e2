"""Settings of Augmented Random Search by name."""

from dataclasses import replace
from typing import Any

from kinarm.policies.ars.config import ARSConfig
from kinarm.policies.config import rewarded_per_reach
from kinarm.task import RewardWeights

TUNED = ARSConfig(
    recipe="tuned",
    step_size_schedule="linear",
    iterations=8000,
    symmetric=True,
    sharing="iteration",
    episodes=16,
    reward=RewardWeights(collision=-4.0, success=0.5),
    replay_share=0.4,
)

LINEAR = replace(
    TUNED,
    recipe="linear",
    iterations=16_000,
    directions=48,
    top_directions=24,
    reward=RewardWeights(collision=-4.0, success=1.0),
    replay_share=0.5,
    replay_size=1024,
)

BEST = replace(
    LINEAR,
    recipe="best",
    net_arch=(16,),
    iterations=24_000,
    noise=0.02,
    episodes=24,
    reward=RewardWeights(collision=-6.0, success=0.5),
)

RECIPES = {
    "paper": ARSConfig(recipe="paper"),
    **{config.recipe: config for config in (TUNED, LINEAR, BEST)},
    "v1": ARSConfig(recipe="v1", normalize=False, top_directions=24),
    "brs": ARSConfig(recipe="brs", normalize=False, scale_by_deviation=False, top_directions=24),
}
"""ARS settings by name; the summaries of the learner say what they are."""

NETWORK: dict[str, Any] = {
    "net_arch": (16,),
    "iterations": 3000,
    "noise": 0.05,
    "step_size": 0.05,
    "directions": 60,
    "top_directions": 30,
    "episodes": 4,
    "reward": RewardWeights(collision=-2.0, success=2.0),
}
"""Settings of ``tuned`` where it trains a network."""


def adapted(config: ARSConfig) -> ARSConfig:
    """Adapt ``tuned``, ``linear`` and ``best`` to their problem.

    Progress is rewarded in proportion to the arm's reach. Where several regions are to be reached
    and no reflection maps one to another, one linear map does not serve all of them: in ``tuned``,
    a small network takes its place, whose many parameters need more directions.
    """
    from kinarm.policies.mirror import different_regions, missing_mirror  # loads Pinocchio

    if config.recipe not in ("tuned", "linear", "best"):
        return config
    symmetric = not missing_mirror(config.problem)
    config = replace(config, symmetric=symmetric)
    if config.recipe == "tuned" and different_regions(config.problem, symmetric) > 1:
        config = replace(config, **NETWORK)
    return rewarded_per_reach(config)
