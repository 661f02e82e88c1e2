"""Environments for Gymnasium: one arm, and a native batch of many."""

from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports

if TYPE_CHECKING:
    from kinarm.envs.reach import ReachEnv
    from kinarm.envs.vector import ReachVectorEnv

__all__ = ["ReachEnv", "ReachVectorEnv"]

__getattr__ = lazy_exports(__name__, {"reach": ("ReachEnv",), "vector": ("ReachVectorEnv",)})
