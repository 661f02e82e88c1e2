"""Recipes: settings by name or from a file, adapted to problems."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import Any

from kinarm._fields import from_plain, init_fields, read_toml, take_base, to_plain
from kinarm._files import shipped_files
from kinarm.errors import InvalidInputError, UnknownNameError, check_known
from kinarm.policies.config import ConfigT, merged
from kinarm.policies.learners import Learner, find_learner
from kinarm.problem import PROBLEMS

PER_TRAINING = ("problem", "seed")
"""Settings that vary between trainings with a recipe."""

CONDITIONS = ("where_regions_differ", "where_more_is_asked", "where_scenes_differ")
"""Under which a recipe may have other settings.

Several regions are to be reached that no reflection joins; or more is asked than points that stand
and are seen where they are, among bodies that all episodes share and that rest; or bodies rest, but
are others in each episode.
"""

RECIPE_REACH = 1.264
"""Reach of the arm ``paper``, for which recipes were found [m]."""


def recipe(learner: str, name_or_file: str | Path | None = None, **changes: Any) -> Any:
    """Look settings up, adapt them to the problem and replace some.

    Parameters
    ----------
    learner : str
        Name of the learner, or ``module:LEARNER``.
    name_or_file : str or Path, optional
        Name of a recipe, or a TOML file with some settings; the others are
        those of the recipe that its entry ``base`` names. The default is the
        learner's first one: that of the paper for ARS and PPO.
    **changes
        Fields to replace; None leaves a field as it is, a mapping replaces the
        entries that it names. If another field than problem and seed changes,
        the recipe's name gets a star.

    Returns
    -------
    ARSConfig, PPOConfig or settings of another learner

    Raises
    ------
    UnknownNameError, InvalidInputError
        If there is no such learner, recipe or setting, or a value cannot be.
    """
    found = find_learner(learner)
    check_known(f"setting of {learner}", changes, init_fields(found.config))
    given = {key: value for key, value in changes.items() if value is not None}
    circumstances = {key: given.pop(key) for key in PER_TRAINING if key in given}
    named = str(name_or_file or found.first_recipe)
    if named.endswith(".toml"):
        standard = _read_recipe(found, Path(named), circumstances)
    else:
        standard = _named_recipe(found, named, circumstances)
    made = standard.changed(given)
    if made == standard:
        return made
    return replace(made, recipe=given.get("recipe", f"{standard.recipe}*"))


def _named_recipe(learner: Learner[Any, Any], name: str, circumstances: Mapping[str, Any]) -> Any:
    """A recipe of a learner for a problem and a seed."""
    if name not in learner.recipes:
        raise UnknownNameError("recipe", name, (*learner.recipes, "path/to/recipe.toml"))
    return learner.adapt(replace(learner.recipes[name], **circumstances))


def _read_recipe(learner: Learner[Any, Any], path: Path, circumstances: Mapping[str, Any]) -> Any:
    """Settings of a file for a problem and a seed."""
    entries = read_toml(path, "recipe")
    for key in PER_TRAINING:
        if key in entries:
            raise InvalidInputError(f"{path}: a recipe has no {key}; give it as --{key}")
    base = take_base(entries, str(path), learner.recipes, learner.first_recipe)
    standard = _named_recipe(learner, base, circumstances)
    plain = to_plain(standard)
    if "reward" in entries:
        plain["reward"] = to_plain(standard.training_problem.task.reward)
    given = merged(plain, {"recipe": path.stem, **entries})
    made = from_plain(learner.config, given, str(path))
    return replace(made, problem=standard.problem)


def shipped_learner(name: str, config: type[ConfigT], **parts: Any) -> Learner[ConfigT, Any]:
    """A learner of kinarm, with the recipes of its file in ``data/recipes``.

    A recipe has a ``summary``, settings that replace those of its ``base``, and
    maybe others under `CONDITIONS`; see `_adapted`.

    Parameters
    ----------
    name, config
        Name of the learner, and its settings.
    **parts
        Other fields of `Learner`.
    """
    path, summaries, recipes, special = shipped_files("recipes")[name], {}, {}, {}
    tables = read_toml(path, "recipe")
    for recipe_name, table in tables.items():
        summaries[recipe_name] = table.pop("summary")
        changes = {each: table.pop(each) for each in CONDITIONS if each in table}
        table |= {**tables.get(table.pop("base", ""), {}), **table, "recipe": recipe_name}
        recipes[recipe_name] = from_plain(config, table, str(path))
        for condition, changed in changes.items():
            made = from_plain(config, {**table, **changed}, str(path))
            special[recipe_name, condition] = {each: getattr(made, each) for each in changed}
    return Learner(
        name=name,
        config=config,
        recipes=recipes,
        summaries=summaries,
        adapt=lambda made: _adapted(made, special),
        **parts,
    )


def _adapted(config: ConfigT, special: Mapping[tuple[str, str], Mapping[str, Any]]) -> ConfigT:
    """Adapt a recipe to its problem, if it is symmetric.

    Progress is rewarded in proportion to the arm's reach, and training tolerances are shares of the
    task's. Settings of ``special`` replace others under a condition.
    """
    if not getattr(config, "symmetric", False):
        return config
    from kinarm.policies.mirror import different_regions, missing_mirror  # loads Pinocchio

    problem, changes = config.problem, dict[str, Any]()
    changes["symmetric"] = symmetric = not missing_mirror(problem)
    goal, scene = problem.task.goal, problem.scene
    unseen = problem.plant.range_of("goal_noise")[1] > 0
    more = unseen or goal.number or goal.changes or scene.moving or scene.random_bodies
    others = bool(scene.random_bodies) and not scene.moving
    held = (different_regions(problem, symmetric) > 1, more, others)
    for condition in compress(CONDITIONS, held):
        config = replace(config, **special.get((config.recipe, condition), {}))
    scale = problem.task.tolerance / PROBLEMS["right"].task.tolerance
    if (length := getattr(config, "training_tolerance", None)) is not None:
        changes["training_tolerance"] = round(scale * length, 9) or scale * length
    weights = config.training_problem.task.reward
    relative = round(problem.load_arm().reach / RECIPE_REACH, 2)
    changes["reward"] = replace(weights, progress=weights.progress / relative)
    return replace(config, **changes)
