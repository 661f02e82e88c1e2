"""A training from what is asked for to the files that it leaves.

A policy, its learning curve and, while the training lasts, a checkpoint lie beside each other.
"""

import csv
import io
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from kinarm._console import told_of_activities
from kinarm._files import check_output, only_writer, write_text
from kinarm._interrupts import telling
from kinarm.errors import InvalidInputError, KinarmError, PolicyFileError
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import (
    CurvePoint,
    TrainingResult,
    TrainingState,
    begin_training,
    find_learner,
    learner_of,
    run_training,
)
from kinarm.policies.recipes import recipe
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm._console import ProgressLine
    from kinarm.policies.checkpoint import Checkpoint

CHECKPOINT = ".checkpoint.npz"
"""Ending of the file of a checkpoint."""

CHECKPOINT_SECONDS = 5.0
"""How often a checkpoint is saved [s]."""

STARTING = "starting"
"""Shown before the first iteration, unless the training says something else."""


def checkpoint_path(out: str | Path) -> Path:
    """Where the checkpoint of a training lies until it is finished."""
    return Path(out).with_suffix(CHECKPOINT)


def curve_path(out: str | Path) -> Path:
    """Where the learning curve of a policy lies."""
    return Path(out).with_suffix(".curve.csv")


def write_curve(path: Path, curve: Sequence[CurvePoint]) -> None:
    """Write a learning curve as CSV, one line per iteration.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("iteration", *CurvePoint._fields))
    writer.writerows((number, *point) for number, point in enumerate(curve, start=1))
    write_text(path, text.getvalue())


def refuse_unfinished(out: str | Path) -> None:
    """Refuse to begin a training where an unfinished one has left its checkpoint.

    Raises
    ------
    InvalidInputError
        If there is one.
    """
    path = checkpoint_path(out)
    if path.exists():
        raise InvalidInputError(
            f"{str(path)!r} holds an unfinished training: go on with --resume, or delete it"
        )


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
        if self.resume:
            config, state = self._checkpoint()
        else:
            refuse_unfinished(self.out)
            config, state = self.config(), None
        check_output(self.out, overwrite=self.overwrite, suffix=".npz")
        options: dict[str, Any] = (
            {} if self.tensorboard is None else {"tensorboard": self.tensorboard}
        )
        with only_writer(self.out):
            if state is None:
                say_findings(config)
            with shown_progress(config) as progress:
                return train_to_file(config, state, self.out, progress, **options)

    def config(self) -> TrainingConfig:
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

    def _checkpoint(self) -> "Checkpoint":
        """The training to go on with, which must be the one that is asked for."""
        from kinarm.policies.checkpoint import load_checkpoint

        path = checkpoint_path(self.out)
        if not path.exists():
            raise PolicyFileError(f"nothing to resume: there is no {str(path)!r}")
        checkpoint = load_checkpoint(path)
        config: TrainingConfig = checkpoint.config
        if (other := learner_of(config)) is not find_learner(self.learner):
            raise InvalidInputError(f"{str(path)!r} is of the learner {other.name}")
        given = {**self.settings, **({} if self.seed is None else {"seed": self.seed})}
        wanted = config.changed(given)
        changed = [name for name in given if getattr(wanted, name) != getattr(config, name)]
        if self.recipe and Path(self.recipe).stem != config.recipe.removesuffix("*"):
            changed.append("recipe")
        if changed:
            raise InvalidInputError(
                f"the checkpoint is of a training with another {' and '.join(changed)}: leave out "
                f"these options to go on with it, or delete {str(path)!r} to train anew"
            )
        self.resolve(default=config.problem).check_same(config.problem, f"{str(path)!r}")
        return checkpoint


class TrainingProgress:
    """A line on standard error: iterations, return, success, time left."""

    def __init__(self, line: "ProgressLine") -> None:
        self._line = line

    def prepare(self, activity: str) -> None:
        """Show what the training does before it goes on."""
        self._line.update(words=[activity or STARTING])

    def update(self, state: TrainingState) -> None:
        """Show the latest iteration."""
        point = state.curve[-1]
        words = [f"return {point.mean_return:+.3f}", f"success {100 * point.success:.0f} %"]
        self._line.update(state.iteration, words)


@contextmanager
def shown_progress(config: TrainingConfig) -> Iterator[TrainingProgress]:
    """Show how far a training with these settings is."""
    from kinarm._console import ProgressLine

    title = f"{learner_of(config).name} {config.recipe} {config.problem.name} seed {config.seed}"
    with ProgressLine(title, config.iterations, "iterations") as line:
        yield TrainingProgress(line)


class CheckpointKeeper:
    """Saves the latest state every few seconds and on demand.

    Parameters
    ----------
    config, path, state
        Settings of the training, file of the checkpoint, and where it goes on if not anew.
    """

    def __init__(self, config: TrainingConfig, path: Path, state: TrainingState | None) -> None:
        self._config, self._path, self._state = config, path, state
        self._saved_at = time.monotonic()

    def update(self, state: TrainingState) -> None:
        """Take note of a state, and save it if the last checkpoint is old."""
        self._state = state
        if time.monotonic() - self._saved_at > CHECKPOINT_SECONDS:
            self.save()

    def save_on_interrupt(self) -> str:
        """Save the latest state, and say how to go on."""
        if self._state is None:
            return "interrupted before the first iteration"
        self.save()
        done, all_of_them = self._state.iteration, self._config.iterations
        return f"interrupted after {done} of {all_of_them} iterations; go on with --resume"

    def save(self) -> None:
        """Save the latest state."""
        from kinarm.policies.checkpoint import save_checkpoint

        if self._state is not None:
            save_checkpoint(self._path, self._config, self._state)
            self._saved_at = time.monotonic()


def train_to_file(
    config: TrainingConfig,
    state: TrainingState | None,
    out: str | Path,
    progress: TrainingProgress,
    **options: Any,
) -> TrainingResult:
    """Train, and write the policy and its learning curve.

    While the training lasts, a checkpoint beside the policy is renewed every few seconds.

    Parameters
    ----------
    config, state, **options
        As for `kinarm.policies.train_policy`.
    out : str or Path
        File of the policy.
    progress : TrainingProgress
        Is told how far the training is.

    Raises
    ------
    KinarmError
        If settings cannot be used, or a file cannot be written.
    KeyboardInterrupt
        If it is interrupted; the checkpoint is complete, and the message says so.
    """
    path = checkpoint_path(out)
    keeper = CheckpointKeeper(config, path, state)

    def on_iteration(state: TrainingState) -> None:
        progress.update(state)
        keeper.update(state)

    with telling(keeper.save_on_interrupt):
        progress.prepare("")
        with told_of_activities(progress.prepare):
            training = begin_training(config, **options)
            result = run_training(config, training, state=state, on_iteration=on_iteration)
        try:
            write_curve(curve_path(out), result.curve)
            result.policy.save(out)
        except KinarmError:
            keeper.save()
            raise
    path.unlink(missing_ok=True)
    return result


def say_findings(config: TrainingConfig) -> None:
    """Say on standard error what was chosen for the arm, and what hinders the training.

    That is many goals out of reach, but of the paper's problems, which are known; or that
    ``symmetric`` has no effect: recipes do not set it then, a user did.
    """
    from kinarm.policies.mirror import missing_mirror
    from kinarm.policies.reachability import reach_warning
    from kinarm.problem import PROBLEMS
    from kinarm.world import World

    say_choices([config.problem])
    if config.problem.digest not in [known.digest for known in PROBLEMS.values()]:
        line = reach_warning(World(config.problem))
        if line is not None:
            sys.stderr.write(f"{line}\n")
    if getattr(config, "symmetric", False) and (reason := missing_mirror(config.problem)):
        sys.stderr.write(f"symmetric has no effect: {reason}\n")
