"""Compiled kernels: whole episodes, each step proven free of contact or left to Coal."""

from kinarm.kernels.distance import box_gap, clearance, segment_gap
from kinarm.kernels.kinematics import (
    POSE,
    forward_kinematics,
    observe,
    point_jacobian,
    to_world,
)
from kinarm.kernels.network import dense
from kinarm.kernels.proof import MARGIN, SUBSTEPS, is_apart, prove_step, spend_slack
from kinarm.kernels.rollout import advance, begin, screen

__all__ = [
    "MARGIN",
    "POSE",
    "SUBSTEPS",
    "advance",
    "begin",
    "box_gap",
    "clearance",
    "dense",
    "forward_kinematics",
    "is_apart",
    "observe",
    "prove_step",
    "screen",
    "segment_gap",
    "spend_slack",
    "to_world",
    "point_jacobian",
]
