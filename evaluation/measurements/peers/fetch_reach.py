"""Gymnasium-Robotics' reach environment."""

from collections.abc import Iterator

import gymnasium_robotics

from kinarm.evaluation.measurements.peers.comparing import Comparison
from kinarm.evaluation.measurements.peers.reach_environments import compare_environment
from kinarm.policies.policy import Policy

TERMS = (
    "random actions through gymnasium.make, one process. FetchReach: MuJoCo, a whole Fetch moved "
    "by a mocap weld, 20 steps of 0.002 s of dynamics a step of 0.04 s; kinarm: kinematics, "
    "0.02 s a step, 4 configurations tested for contact"
)


def compare(policy: Policy, repetitions: int) -> Iterator[Comparison]:
    """FetchReach beside kinarm's environments."""
    return compare_environment(gymnasium_robotics, "FetchReach-v4", TERMS, policy, repetitions)
