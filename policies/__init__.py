"""Policies and the learners that train them."""

from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports

if TYPE_CHECKING:
    from kinarm.policies.ars import ARSResult, ARSState, train_ars
    from kinarm.policies.ars_config import ARSConfig
    from kinarm.policies.checkpoint import (
        load_checkpoint,
        load_ppo_checkpoint,
        save_checkpoint,
        save_ppo_checkpoint,
    )
    from kinarm.policies.curve import CurvePoint
    from kinarm.policies.library import load_policy, policy_names
    from kinarm.policies.normalizer import Normalizer
    from kinarm.policies.oracle import (
        Oracle,
        OracleSolution,
        OracleSolutions,
        inverse_kinematics,
    )
    from kinarm.policies.policy import Layer, Policy
    from kinarm.policies.ppo import PPOResult, train_ppo
    from kinarm.policies.ppo_config import PPOConfig
    from kinarm.policies.ppo_state import PPOState
    from kinarm.policies.provenance import Provenance
    from kinarm.policies.recipes import ARS_RECIPES, PPO_RECIPES, ars_recipe, ppo_recipe

__all__ = [
    "ARS_RECIPES",
    "PPO_RECIPES",
    "ARSConfig",
    "ARSResult",
    "ARSState",
    "CurvePoint",
    "Layer",
    "Normalizer",
    "Oracle",
    "OracleSolution",
    "OracleSolutions",
    "PPOConfig",
    "PPOResult",
    "PPOState",
    "Policy",
    "Provenance",
    "ars_recipe",
    "inverse_kinematics",
    "load_checkpoint",
    "load_policy",
    "load_ppo_checkpoint",
    "policy_names",
    "ppo_recipe",
    "save_checkpoint",
    "save_ppo_checkpoint",
    "train_ars",
    "train_ppo",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "ars": ("ARSResult", "ARSState", "train_ars"),
        "ars_config": ("ARSConfig",),
        "checkpoint": (
            "load_checkpoint",
            "load_ppo_checkpoint",
            "save_checkpoint",
            "save_ppo_checkpoint",
        ),
        "curve": ("CurvePoint",),
        "library": ("load_policy", "policy_names"),
        "normalizer": ("Normalizer",),
        "oracle": ("Oracle", "OracleSolution", "OracleSolutions", "inverse_kinematics"),
        "policy": ("Layer", "Policy"),
        "ppo": ("PPOResult", "train_ppo"),
        "ppo_config": ("PPOConfig",),
        "ppo_state": ("PPOState",),
        "provenance": ("Provenance",),
        "recipes": ("ARS_RECIPES", "PPO_RECIPES", "ars_recipe", "ppo_recipe"),
    },
)
