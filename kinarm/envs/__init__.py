"""Gymnasium environments, single and in batches, registered on import."""

import lazy_loader
from gymnasium.envs.registration import register

KINDS = {
    "Reach": ("kinarm.envs.reach:ReachEnv", "kinarm.envs.vector:ReachVectorEnv"),
    "ReachGoal": ("kinarm.envs.goal:ReachGoalEnv", "kinarm.envs.goal:ReachGoalVectorEnv"),
}
"""Classes of single environments and native batches."""

TASKS = {"Left": "left", "Right": "right", "Both": "both", "": "right"}
"""Problems by their names in ids; the last id takes any ``problem``."""

ENVIRONMENTS: dict[str, str] = {}
"""Problems of environments by id."""

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
