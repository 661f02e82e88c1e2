"""Settings of Augmented Random Search by name."""

from dataclasses import replace
from typing import Any

from kinarm.policies.ars.config import ARSConfig
from kinarm.policies.config import rewarded_per_reach
from kinarm.task import RewardWeights

RECIPES = {
    "paper": ARSConfig(recipe="paper"),
    "tuned": ARSConfig(
        recipe="tuned",
        step_size_schedule="linear",
        iterations=8000,
        symmetric=True,
        sharing="iteration",
        episodes=8,
        reward=RewardWeights(collision=-2.0, success=0.5),
    ),
    "v1": ARSConfig(recipe="v1", normalize=False, top_directions=24),
    "brs": ARSConfig(recipe="brs", normalize=False, scale_by_deviation=False, top_directions=24),
}
"""ARS settings by name.

``paper`` is Table 1. ``tuned`` is the best that we found for a linear policy. ``v1`` and ``brs``
are Table 1 without the augmentations that the names lack.
"""

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
"""What ``tuned`` is where it trains a network."""


def adapted(config: ARSConfig) -> ARSConfig:
    """Adapt ``tuned`` to its problem.

    Progress is rewarded in proportion to the arm's reach. Where several regions are to be reached
    and no reflection maps one to another, a linear policy cannot turn to either side: a small
    network takes its place, whose many parameters need more directions.
    """
    from kinarm.policies.mirror import different_regions, missing_mirror  # loads Pinocchio

    if config.recipe != "tuned":
        return config
    symmetric = not missing_mirror(config.problem)
    config = replace(config, symmetric=symmetric)
    if different_regions(config.problem, symmetric) > 1:
        config = replace(config, **NETWORK)
    return rewarded_per_reach(config)
