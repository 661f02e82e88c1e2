"""Who is compared: learners with their settings, and where these come from."""

from dataclasses import dataclass, field, fields
from importlib.resources import as_file, files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from kinarm._fields import check_fields, default_of, from_plain, read_toml
from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError, MissingExtraError, UnknownNameError
from kinarm.policies.learners import find_learner, learner_names
from kinarm.policies.recipes import PER_TRAINING, recipe

ALGORITHMS = {
    **dict.fromkeys(("A2C", "DDPG", "PPO", "SAC", "TD3"), "stable_baselines3"),
    "TQC": "sb3_contrib",
}
"""Algorithms of Stable-Baselines3's libraries, and the module that each is in."""

OF_OTHERS = ("n_envs", "hindsight", "train_on", "normalize", "decaying", "action_noise")
"""What kinarm's learners do not have, or have in their settings."""


@dataclass(frozen=True, kw_only=True)
class ComparedLearner:
    """A learner with its settings, which are kinarm's recipe or given in full.

    Parameters
    ----------
    name : str
        Unique in a table, and fit for a file name.
    title : str
        Its name in tables and figures.
    algorithm : str
        One of kinarm's learners, or an algorithm of Stable-Baselines3 or sb3-contrib.
    source : str
        Where the settings come from.
    recipe : str
        Settings of one of kinarm's learners.
    environment_steps : int
        Length of a training; 0 for what the recipe says.
    n_envs : int
        Arms that are simulated at once.
    hindsight : bool
        Learn from the goal-conditioned environment with hindsight replay.
    train_on : dict
        What is different about the problem in training, such as a reward.
    normalize : bool
        Normalise observations by their running statistics.
    decaying : bool
        Let the learning rate fall linearly to zero.
    action_noise : float
        Standard deviation of noise that is added to the actions in training.
    settings : dict
        What replaces settings of the recipe, or what else the algorithm's constructor is given.

    Raises
    ------
    InvalidInputError
        If there is no such algorithm, or a number is out of range.
    """

    name: str
    title: str
    algorithm: str
    source: str
    recipe: str = ""
    environment_steps: int = 0
    n_envs: int = 1
    hindsight: bool = False
    train_on: dict[str, Any] = field(default_factory=dict)
    normalize: bool = False
    decaying: bool = False
    action_noise: float = 0.0
    settings: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self)
        whole_number("n_envs", self.n_envs, 1)
        if self.algorithm not in (*learner_names(), *ALGORITHMS):
            raise UnknownNameError("algorithm", self.algorithm, (*learner_names(), *ALGORITHMS))
        if self.is_recipe != bool(self.recipe):
            raise InvalidInputError("kinarm's learners have a recipe, and others have none")
        if self.is_recipe:
            self._check_settings()
        else:
            whole_number("environment_steps", self.environment_steps, 1)
        if self.decaying and "learning_rate" not in self.settings:
            raise InvalidInputError("decaying needs settings.learning_rate to start from")

    def _check_settings(self) -> None:
        """Refuse settings that the recipe does not have, before anything is trained."""
        for item in fields(self):
            if item.name in OF_OTHERS and getattr(self, item.name) != default_of(item):
                raise InvalidInputError(f"{item.name} is not for kinarm's learners")
        for name in PER_TRAINING:
            if name in self.settings:
                raise InvalidInputError(f"settings.{name}: the comparison chooses it")
        if self.settings:
            recipe(self.algorithm, self.recipe, **self.settings)

    @property
    def is_recipe(self) -> bool:
        """Whether it is one of kinarm's learners."""
        return self.algorithm in learner_names()

    def check_installed(self) -> None:
        """Refuse to go on without the packages that it needs.

        Raises
        ------
        MissingExtraError
            If one is missing; it says how to install it.
        """
        if self.is_recipe:
            find_learner(self.algorithm).check_installed()
        else:
            find_learner("ppo").check_installed()
            if find_spec(ALGORITHMS[self.algorithm]) is None:
                raise MissingExtraError(ALGORITHMS[self.algorithm], "zoo")


def read_learners(path: Path | None = None) -> dict[str, ComparedLearner]:
    """Read a table of learners by name: the shipped one, or a TOML file of the same form.

    Raises
    ------
    InvalidInputError
        If the file cannot be used; in one line that names file, key and what is expected.
    """
    if path is None:
        with as_file(files(__package__).joinpath("learners.toml")) as shipped:
            return read_learners(shipped)
    tables = read_toml(path, "table of learners")
    if not all(isinstance(entries, dict) for entries in tables.values()):
        raise InvalidInputError(f"{path}: every learner must be a table")
    return {
        name: from_plain(ComparedLearner, {"name": name, **entries}, str(path), f"{name}.")
        for name, entries in tables.items()
    }
