"""Compiled kernels: whole episodes with proof of freedom from contact, and inverse kinematics."""

from kinarm.kernels.approach import closest_approach, steps_floor
from kinarm.kernels.distance import box_gap, clearance, segment_gap
from kinarm.kernels.kinematics import (
    POSE,
    forward_kinematics,
    observe,
    point_jacobian,
    to_world,
)
from kinarm.kernels.network import dense
from kinarm.kernels.projection import project
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
    "closest_approach",
    "dense",
    "forward_kinematics",
    "is_apart",
    "observe",
    "project",
    "prove_step",
    "screen",
    "segment_gap",
    "spend_slack",
    "steps_floor",
    "to_world",
    "point_jacobian",
]
