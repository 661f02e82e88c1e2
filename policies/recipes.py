"""Named settings of the learners."""

from dataclasses import replace
from typing import Any

from kinarm.errors import UnknownNameError
from kinarm.policies.ars_config import ARSConfig

TUNED = ARSConfig(
    recipe="tuned",
    step_size_schedule="linear",
    iterations=8000,
    symmetric=True,
    sharing="iteration",
    episodes=8,
    collision_penalty=-2.0,
    success_bonus=0.5,
)

ARS_RECIPES = {
    "paper": ARSConfig(recipe="paper"),
    "tuned": TUNED,
    "v1": ARSConfig(recipe="v1", normalize=False, top_directions=24),
    "brs": ARSConfig(recipe="brs", normalize=False, scale_by_deviation=False, top_directions=24),
}
"""ARS settings by name.

``paper`` is Table 1. ``tuned`` is the best that we found for a linear policy. ``v1`` and ``brs``
are Table 1 without the augmentations that the names lack.
"""

TASK_SETTINGS: dict[tuple[str, str], dict[str, Any]] = {
    ("tuned", "both"): {"collision_penalty": -1.0}
}
"""Settings of a recipe that differ on a task.

On two benches, policies trained with the double penalty reached fewer goals.
"""


def ars_recipe(name: str, **settings: Any) -> ARSConfig:
    """Look a recipe up, adapt it to the task and replace some of its settings.

    Parameters
    ----------
    name : str
        Name of the recipe.
    **settings
        Fields of `ARSConfig` to replace; None leaves a field as it is. If another field than
        task, arm and seed changes, the recipe's name in the result gets a star.

    Raises
    ------
    UnknownNameError
        If there is no such recipe.
    """
    if name not in ARS_RECIPES:
        raise UnknownNameError("recipe", name, ARS_RECIPES)
    given = {key: value for key, value in settings.items() if value is not None}
    config = ARS_RECIPES[name]
    by_task = TASK_SETTINGS.get((name, given.get("task", config.task)), {})
    circumstances: dict[str, Any] = {
        key: given[key] for key in ("task", "arm", "seed") if key in given
    }
    standard = replace(config, **{**by_task, **circumstances})
    made = replace(standard, **given)
    return made if made == standard else replace(made, recipe=given.get("recipe", f"{name}*"))
