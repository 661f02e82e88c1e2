"""What a training is asked for."""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from kinarm._fields import to_plain
from kinarm._files import check_output, only_writer
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.policies.learners import TrainingResult, find_learner, learner_of
from kinarm.policies.recipes import recipe
from kinarm.policies.training_files import checkpoint_path, refuse_unfinished, train_to_file
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm.policies.checkpoint import Checkpoint
    from kinarm.policies.config import TrainingConfig


@dataclass(frozen=True, kw_only=True)
class TrainRequest(ProblemOptions):
    """A training, from its settings to the files that it leaves.

    Parameters
    ----------
    learner : str
        Name of the learner.
    recipe : str, optional
        Named settings, or a TOML file with some.
    seed : int, optional
        Seed of all randomness.
    settings : mapping
        Settings of the learner that replace those of the recipe.
    out : Path
        File of the policy; learning curve and checkpoint lie beside it; with --seeds, folder of
        the policies.
    resume : bool
        Go on from the checkpoint beside --out; with --seeds, with each seed that is not finished.
    overwrite : bool
        Replace an earlier policy; with --resume, by that of the training that goes on.
    tensorboard : Path, optional
        Folder for TensorBoard logs.
    """

    learner: str
    recipe: str | None = field(default=None, metadata={"metavar": "NAME_OR_FILE"})
    seed: int | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    out: Path | str = field(metadata={"metavar": "FILE.npz"})
    resume: bool = False
    overwrite: bool = False
    tensorboard: Path | str | None = field(default=None, metadata={"metavar": "FOLDER"})

    GROUPS: ClassVar = {
        "training": ("recipe", "seed", "resume"),
        "output": ("out", "overwrite", "tensorboard"),
        **ProblemOptions.GROUPS,
    }
    DEFAULTS: ClassVar = {
        **ProblemOptions.DEFAULTS,
        "recipe": "the first one",
        "seed": "0",
        "problem": "the recipe's: right",
    }

    def run(self) -> TrainingResult:
        """Train, and write the policy and its learning curve.

        While the training lasts, a checkpoint beside the policy is renewed every few seconds.

        Raises
        ------
        KinarmError
            If settings cannot be used, or a file cannot be written.
        KeyboardInterrupt
            If it is interrupted; the checkpoint is then complete, and the message says so.
        """
        from kinarm.policies.training_progress import shown_progress

        config, state = self._resumed() if self.resume else (self._config(), None)
        check_output(self.out, overwrite=self.overwrite, suffix=".npz")
        with only_writer(self.out):
            if state is None:
                say_reach(config)
                say_symmetry(config)
            options: dict[str, Any] = (
                {} if self.tensorboard is None else {"tensorboard": self.tensorboard}
            )
            with shown_progress(config) as progress:
                return train_to_file(config, state, self.out, progress, **options)

    def config(self) -> "TrainingConfig":
        """Settings of the training: those of the recipe, with the replacements of the fields.

        Raises
        ------
        KinarmError
            If they cannot be used.
        """
        problem = self.resolve(default=recipe(self.learner, self.recipe).problem)
        config: TrainingConfig = recipe(
            self.learner, self.recipe, problem=problem, seed=self.seed, **self.settings
        )
        return config

    def _config(self) -> "TrainingConfig":
        """Settings of a new training, unless there is the checkpoint of an unfinished one."""
        refuse_unfinished(self.out)
        return self.config()

    def _resumed(self) -> "Checkpoint":
        """The training to go on with, which must be the one that is asked for."""
        from kinarm.policies.checkpoint import load_checkpoint

        path = checkpoint_path(self.out)
        if not path.exists():
            raise PolicyFileError(f"nothing to resume: there is no {str(path)!r}")
        checkpoint = load_checkpoint(path)
        config = checkpoint.config
        if (other := learner_of(config)) is not find_learner(self.learner):
            raise InvalidInputError(f"{str(path)!r} is of the learner {other.name}")
        if changed := self._changed(config):
            raise InvalidInputError(
                f"the checkpoint has {' and '.join(changed.values())}: "
                f"leave out {', '.join(changed)}, or delete {str(path)!r} to train anew"
            )
        self.resolve(default=config.problem).check_same(config.problem, f"{str(path)!r}")
        return checkpoint

    def _changed(self, config: "TrainingConfig") -> dict[str, str]:
        """Options whose settings differ from those of a training, and both values of each."""
        given = {**self.settings, **({} if self.seed is None else {"seed": self.seed})}
        ours, theirs = _values(config.changed(given), given), _values(config, given)
        found = {
            _option(name, value): f"{name} {_said(theirs[name])}, not {_said(value)}"
            for name, value in ours.items()
            if value != theirs[name]
        }
        recipe = config.recipe.removesuffix("*")
        if self.recipe and Path(self.recipe).stem != recipe:
            found["--recipe"] = f"recipe {recipe}, not {Path(self.recipe).stem}"
        return found


def _values(config: "TrainingConfig", names: Iterable[str]) -> dict[str, Any]:
    """Settings with these names; of the reward, every weight."""
    values = {name: getattr(config, name) for name in names}
    if "reward" in values:
        del values["reward"]
        weights = to_plain(config.training_problem.task.reward)
        values |= {f"reward_{name}": weight for name, weight in weights.items()}
    return values


def _option(name: str, value: object) -> str:
    """The option that gives a setting this value."""
    return f"--{'no-' if value is False else ''}{name.replace('_', '-')}"


def _said(value: object) -> str:
    """A value as command lines have it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    words = value if isinstance(value, tuple) else () if value is None else (value,)
    return " ".join(map(str, words)) or "none"


def say_reach(config: "TrainingConfig") -> None:
    """Say on standard error what was chosen for the arm, and whether many goals are out of reach.

    The paper's problems are known.
    """
    from kinarm.policies.reachability import reach_warning
    from kinarm.problem import PROBLEMS
    from kinarm.world import World

    say_choices([config.problem])
    if config.problem.digest not in [known.digest for known in PROBLEMS.values()]:
        line = reach_warning(World(config.problem))
        if line is not None:
            sys.stderr.write(f"{line}\n")


def say_symmetry(config: "TrainingConfig") -> None:
    """Say on standard error that ``symmetric`` does nothing, if it is set and there is no mirror.

    Recipes do not set it there; a user did.
    """
    from kinarm.policies.mirror import missing_mirror

    if getattr(config, "symmetric", False) and (reason := missing_mirror(config.problem)):
        sys.stderr.write(f"symmetric has no effect: {reason}\n")
