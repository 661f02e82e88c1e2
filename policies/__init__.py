"""Policies and the learners that train them."""

from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports

if TYPE_CHECKING:
    from kinarm.policies.ars import ARSResult, ARSState, train_ars
    from kinarm.policies.ars_config import ARSConfig
    from kinarm.policies.checkpoint import load_checkpoint, save_checkpoint
    from kinarm.policies.inverse import inverse_kinematics
    from kinarm.policies.library import load_policy, policy_names
    from kinarm.policies.normalizer import Normalizer
    from kinarm.policies.oracle import Oracle
    from kinarm.policies.oracle_solution import OracleSolution, OracleSolutions
    from kinarm.policies.policy import Layer, Policy
    from kinarm.policies.provenance import Provenance
    from kinarm.policies.recipes import ARS_RECIPES, ars_recipe

__all__ = [
    "ARS_RECIPES",
    "ARSConfig",
    "ARSResult",
    "ARSState",
    "Layer",
    "Normalizer",
    "Oracle",
    "OracleSolution",
    "OracleSolutions",
    "Policy",
    "Provenance",
    "ars_recipe",
    "inverse_kinematics",
    "load_checkpoint",
    "load_policy",
    "policy_names",
    "save_checkpoint",
    "train_ars",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "ars": ("ARSResult", "ARSState", "train_ars"),
        "ars_config": ("ARSConfig",),
        "checkpoint": ("load_checkpoint", "save_checkpoint"),
        "inverse": ("inverse_kinematics",),
        "library": ("load_policy", "policy_names"),
        "normalizer": ("Normalizer",),
        "oracle": ("Oracle",),
        "oracle_solution": ("OracleSolution", "OracleSolutions"),
        "policy": ("Layer", "Policy"),
        "provenance": ("Provenance",),
        "recipes": ("ARS_RECIPES", "ars_recipe"),
    },
)
