"""Environments for Gymnasium: one arm, and a native batch of many; importing it registers them."""

import lazy_loader
from gymnasium.envs.registration import register

KINDS = {
    "Reach": ("kinarm.envs.reach:ReachEnv", "kinarm.envs.vector:ReachVectorEnv"),
    "ReachGoal": ("kinarm.envs.goal:ReachGoalEnv", "kinarm.envs.goal:ReachGoalVectorEnv"),
}
"""Classes of the single environment and of the native batch."""

TASKS = {"Left": "left", "Right": "right", "Both": "both", "": "right"}
"""Problems as they are called in ids; the last id is for those that ``problem`` names."""

ENVIRONMENTS: dict[str, str] = {}
"""Ids of the environments and their problems."""

for kind, (entry_point, vector_entry_point) in KINDS.items():
    for task, problem in TASKS.items():
        name = f"kinarm/{kind}{task}-v0"
        ENVIRONMENTS[name] = problem
        register(
            id=name,
            entry_point=entry_point,
            vector_entry_point=vector_entry_point,
            kwargs={"problem": problem},
        )

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
