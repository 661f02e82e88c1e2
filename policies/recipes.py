"""Named settings of the learners."""

from dataclasses import replace
from typing import Any

from kinarm.errors import UnknownNameError
from kinarm.policies.ars import ARSConfig

ARS_RECIPES = {
    config.recipe: config
    for config in (
        ARSConfig(recipe="paper"),
        ARSConfig(
            recipe="tuned",
            step_size_schedule="linear",
            iterations=8000,
            sharing="iteration",
            episodes=8,
            collision_penalty=-2.0,
            success_bonus=0.5,
        ),
        ARSConfig(recipe="v1", normalize=False, top_directions=24),
        ARSConfig(recipe="brs", normalize=False, scale_by_deviation=False, top_directions=24),
    )
}
"""ARS settings by name.

``paper`` is Table 1. ``tuned`` is the best that we found for a linear policy. ``v1`` and ``brs``
are Table 1 without the augmentations that the names lack.
"""


def ars_recipe(name: str, **settings: Any) -> ARSConfig:
    """Look a recipe up and replace some of its settings.

    Parameters
    ----------
    name : str
        Name of the recipe.
    **settings
        Fields of `ARSConfig` to replace; None leaves a field as it is.

    Raises
    ------
    UnknownNameError
        If there is no such recipe.
    """
    if name not in ARS_RECIPES:
        raise UnknownNameError("recipe", name, ARS_RECIPES)
    given = {key: value for key, value in settings.items() if value is not None}
    return replace(ARS_RECIPES[name], **given)
