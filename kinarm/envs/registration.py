"""Registers the environments with Gymnasium, so that ``import kinarm`` is enough to make them."""

from gymnasium.envs.registration import register, registry

ENVIRONMENTS = {
    "kinarm/ReachLeft-v0": "left",
    "kinarm/ReachRight-v0": "right",
    "kinarm/ReachBoth-v0": "both",
}
"""Ids of the environments and their problems."""


def register_environments() -> None:
    """Register the environments that are not registered yet."""
    for name, problem in ENVIRONMENTS.items():
        if name not in registry:
            register(
                id=name,
                entry_point="kinarm.envs.reach:ReachEnv",
                vector_entry_point="kinarm.envs.vector:ReachVectorEnv",
                kwargs={"problem": problem},
            )
