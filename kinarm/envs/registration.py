"""Registers the environments with Gymnasium, so that ``import kinarm`` is enough to make them."""

from gymnasium.envs.registration import register, registry

ENTRY_POINTS = {
    "Reach": ("kinarm.envs.reach:ReachEnv", "kinarm.envs.vector:ReachVectorEnv"),
    "ReachGoal": ("kinarm.envs.goal:ReachGoalEnv", "kinarm.envs.goal:ReachGoalVectorEnv"),
}
"""Classes of the single environment and of the native batch, by kind of environment."""

ENVIRONMENTS = {
    f"kinarm/{kind}{problem.capitalize()}-v0": problem
    for kind in ENTRY_POINTS
    for problem in ("left", "right", "both")
}
"""Ids of the environments and their problems."""


def register_environments() -> None:
    """Register the environments that are not registered yet."""
    for name, problem in ENVIRONMENTS.items():
        kind = name.removeprefix("kinarm/").split(problem.capitalize())[0]
        entry_point, vector_entry_point = ENTRY_POINTS[kind]
        if name not in registry:
            register(
                id=name,
                entry_point=entry_point,
                vector_entry_point=vector_entry_point,
                kwargs={"problem": problem},
            )
