"""Named settings of the learners."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

from kinarm.errors import UnknownNameError
from kinarm.policies.ars_config import ARSConfig
from kinarm.policies.ppo_config import PPOConfig

ConfigT = TypeVar("ConfigT", ARSConfig, PPOConfig)

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

PPO_RECIPES = {
    "paper": PPOConfig(recipe="paper"),
    "tuned": PPOConfig(
        recipe="tuned",
        arms=125,
        rollout_steps=16,
        minibatch=1000,
        hidden=(64, 64, 64),
        learning_rate=1e-3,
        learning_rate_schedule="linear",
        gae_lambda=0.9,
        entropy_weight=0.002,
        initial_log_std=-0.7,
        tolerance=0.03,
        symmetric=True,
        success_bonus=5.0,
        initial_start_spread=0.2,
        widening=0.4,
    ),
}
"""PPO settings by name; both take 1.2 million environment steps, as the paper did.

``paper`` has the paper's reward and otherwise the defaults of Stable-Baselines3. ``tuned`` is the
best that we found.
"""

TASK_SETTINGS: dict[tuple[str, str], dict[str, Any]] = {
    ("tuned", "both"): {"collision_penalty": -1.0}
}
"""Settings of an ARS recipe that differ on a task.

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
    task = settings.get("task") or ARSConfig.task
    return _adapted(ARS_RECIPES, name, TASK_SETTINGS.get((name, task), {}), settings)


def ppo_recipe(name: str, **settings: Any) -> PPOConfig:
    """Look a recipe up and replace some of its settings.

    Parameters
    ----------
    name : str
        Name of the recipe.
    **settings
        Fields of `PPOConfig` to replace; None leaves a field as it is. If another field than
        task, arm and seed changes, the recipe's name in the result gets a star.

    Raises
    ------
    UnknownNameError
        If there is no such recipe.
    """
    return _adapted(PPO_RECIPES, name, {}, settings)


def _adapted(
    recipes: Mapping[str, ConfigT],
    name: str,
    by_task: dict[str, Any],
    settings: dict[str, Any],
) -> ConfigT:
    """Settings of a recipe with replacements; a star in its name if it is no longer the recipe."""
    if name not in recipes:
        raise UnknownNameError("recipe", name, recipes)
    given = {key: value for key, value in settings.items() if value is not None}
    circumstances = {key: given[key] for key in ("task", "arm", "seed") if key in given}
    standard = replace(recipes[name], **{**by_task, **circumstances})
    made = replace(standard, **given)
    return made if made == standard else replace(made, recipe=given.get("recipe", f"{name}*"))
