"""panda-gym's reach environment."""

from collections.abc import Iterator

import panda_gym

from kinarm.evaluation.measurements.peers.comparing import Comparison
from kinarm.evaluation.measurements.peers.reach_environments import compare_environment
from kinarm.policies.policy import Policy

TERMS = (
    "random actions through gymnasium.make, one process. PandaReach: PyBullet, seven axes with "
    "hand moved by inverse kinematics, 20 steps of 0.002 s of dynamics a step of 0.04 s, empty "
    "table; kinarm: kinematics, 0.02 s a step, 4 configurations tested for contact"
)


def compare(policy: Policy, repetitions: int) -> Iterator[Comparison]:
    """PandaReach beside kinarm's environments."""
    return compare_environment(panda_gym, "PandaReach-v3", TERMS, policy, repetitions)
