"""Policies and the learners that train them."""

from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports

if TYPE_CHECKING:
    from kinarm.policies.ars.config import ARSConfig
    from kinarm.policies.ars.state import ARSState
    from kinarm.policies.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
    from kinarm.policies.config import TrainingConfig
    from kinarm.policies.curve import CurvePoint
    from kinarm.policies.inverse import inverse_kinematics
    from kinarm.policies.learners import (
        Learner,
        TrainingResult,
        TrainingState,
        find_learner,
        learner_names,
        register_learner,
        state_policy,
        train_policy,
    )
    from kinarm.policies.library import load_policy, policy_names
    from kinarm.policies.normalizer import Normalizer
    from kinarm.policies.oracle import Oracle
    from kinarm.policies.oracle_solution import OracleSolution, OracleSolutions
    from kinarm.policies.policy import Layer, Policy
    from kinarm.policies.ppo.config import PPOConfig
    from kinarm.policies.ppo.state import PPOState
    from kinarm.policies.provenance import Provenance
    from kinarm.policies.recipes import recipe

__all__ = [
    "ARSConfig",
    "ARSState",
    "Checkpoint",
    "CurvePoint",
    "Layer",
    "Learner",
    "Normalizer",
    "Oracle",
    "OracleSolution",
    "OracleSolutions",
    "PPOConfig",
    "PPOState",
    "Policy",
    "Provenance",
    "TrainingConfig",
    "TrainingResult",
    "TrainingState",
    "find_learner",
    "inverse_kinematics",
    "learner_names",
    "load_checkpoint",
    "load_policy",
    "policy_names",
    "recipe",
    "register_learner",
    "save_checkpoint",
    "state_policy",
    "train_policy",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "ars.config": ("ARSConfig",),
        "ars.state": ("ARSState",),
        "checkpoint": ("Checkpoint", "load_checkpoint", "save_checkpoint"),
        "config": ("TrainingConfig",),
        "curve": ("CurvePoint",),
        "inverse": ("inverse_kinematics",),
        "learners": (
            "Learner",
            "TrainingResult",
            "TrainingState",
            "find_learner",
            "learner_names",
            "register_learner",
            "state_policy",
            "train_policy",
        ),
        "library": ("load_policy", "policy_names"),
        "normalizer": ("Normalizer",),
        "oracle": ("Oracle",),
        "oracle_solution": ("OracleSolution", "OracleSolutions"),
        "policy": ("Layer", "Policy"),
        "ppo.config": ("PPOConfig",),
        "ppo.state": ("PPOState",),
        "provenance": ("Provenance",),
        "recipes": ("recipe",),
    },
)
