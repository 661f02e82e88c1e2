"""``kinarm-train``: train a policy."""

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kinarm._command_line import Parser, add_options, given_options, run_command
from kinarm._console import open_console
from kinarm._files import check_output, only_writer
from kinarm._interrupts import telling
from kinarm.errors import InvalidInputError, KinarmError, PolicyFileError
from kinarm.kernels.notices import told_of_compilation
from kinarm.policies.learners import (
    Learner,
    TrainingResult,
    TrainingState,
    begin_training,
    find_learner,
    learner_names,
    learner_of,
    run_training,
)
from kinarm.policies.recipes import recipe
from kinarm.problem_options import ProblemOptions, say_choices

if TYPE_CHECKING:
    from kinarm.policies.checkpoint import Checkpoint
    from kinarm.policies.config import TrainingConfig

PROG = "kinarm-train"
CHECKPOINT_SECONDS = 5.0
CIRCUMSTANCES = ("problem", "seed", "recipe")
"""Settings that a `TrainRequest` has fields of its own for."""

EPILOG = """
examples:
  kinarm-train {name} --recipe tuned --out right.npz   the best settings that we found
  kinarm-train {name} --out right.npz                  the paper's settings
  kinarm-train {name} --recipe tuned --problem my.toml --out my.npz   a problem of your own
  kinarm-train {name} --out my.npz --resume   go on where it stopped
"""


@dataclass(frozen=True, kw_only=True)
class TrainRequest(ProblemOptions):
    """A training, from its settings to the files that it leaves.

    Parameters
    ----------
    learner : str
        Name of the learner.
    recipe : str, optional
        Named settings, or a TOML file with some (paper).
    seed : int, optional
        Seed of all randomness (0).
    settings : mapping
        Settings of the learner that replace those of the recipe.
    out : Path
        The policy; curve and checkpoint lie beside it.
    resume : bool
        Go on from the checkpoint beside --out.
    overwrite : bool
        Replace an earlier policy.
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
        path = checkpoint_path(self.out)
        config, state = self._resumed(path) if self.resume else (self._config(path), None)
        check_output(self.out, overwrite=self.overwrite, suffix=".npz")
        with only_writer(self.out):
            return self._carry_out(config, state, path)

    def _carry_out(
        self, config: "TrainingConfig", state: TrainingState | None, path: Path
    ) -> TrainingResult:
        """Train, with a checkpoint at a path."""
        from kinarm.policies.curve import write_curve

        if state is None:
            _say_reach(config)
            _say_symmetry(config)
        options = {} if self.tensorboard is None else {"tensorboard": self.tensorboard}
        keeper = CheckpointKeeper(config, path, state)
        with telling(keeper.save_on_interrupt):
            training = begin_training(config, **options)
            with TrainingProgress(config) as progress:

                def on_iteration(state: TrainingState) -> None:
                    progress.update(state)
                    keeper.update(state)

                result = run_training(config, training, state=state, on_iteration=on_iteration)
            try:
                write_curve(curve_path(self.out), result.curve)
                result.policy.save(self.out)
            except KinarmError:
                keeper.save()
                raise
        path.unlink(missing_ok=True)
        return result

    def _config(self, path: Path) -> "TrainingConfig":
        """Settings of a new training, unless there is the checkpoint of an unfinished one."""
        if path.exists():
            raise InvalidInputError(
                f"{str(path)!r} holds an unfinished training: go on with --resume, or delete it"
            )
        named = self.recipe or "paper"
        problem = self.resolve(default=recipe(self.learner, named).problem)
        config: TrainingConfig = recipe(
            self.learner, named, problem=problem, seed=self.seed, **self.settings
        )
        return config

    def _resumed(self, path: Path) -> "Checkpoint":
        """The training to go on with, which must be the one that is asked for."""
        from kinarm.policies.checkpoint import load_checkpoint

        if not path.exists():
            raise PolicyFileError(f"nothing to resume: there is no {str(path)!r}")
        checkpoint = load_checkpoint(path)
        config = checkpoint.config
        if (other := learner_of(config).name) != self.learner:
            raise InvalidInputError(f"{str(path)!r} is of the learner {other}")
        given = {**self.settings, **({} if self.seed is None else {"seed": self.seed})}
        wanted = config.changed(given)
        changed = [name for name in given if getattr(wanted, name) != getattr(config, name)]
        if self.recipe and Path(self.recipe).stem != config.recipe.removesuffix("*"):
            changed.append("recipe")
        if changed:
            raise InvalidInputError(
                f"the checkpoint was made with another {', '.join(changed)}: "
                "leave it out, or train anew without --resume"
            )
        self.resolve(default=config.problem).check_same(config.problem, f"{str(path)!r}")
        return checkpoint


def _say_reach(config: "TrainingConfig") -> None:
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


def _say_symmetry(config: "TrainingConfig") -> None:
    """Say on standard error that ``symmetric`` does nothing, if it is set and there is no mirror.

    Recipes do not set it there; a user did.
    """
    from kinarm.policies.mirror import missing_mirror

    if getattr(config, "symmetric", False) and (reason := missing_mirror(config.problem)):
        sys.stderr.write(f"symmetric has no effect: {reason}\n")


def checkpoint_path(out: str | Path) -> Path:
    """Where the checkpoint of a training lies until it is finished."""
    return Path(out).with_suffix(".checkpoint.npz")


def curve_path(out: str | Path) -> Path:
    """Where the learning curve of a policy lies."""
    return Path(out).with_suffix(".curve.csv")


class CheckpointKeeper:
    """Saves the latest state every few seconds and on demand."""

    def __init__(self, config: "TrainingConfig", path: Path, state: TrainingState | None) -> None:
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


class TrainingProgress:
    """A line on standard error that fits 80 columns: iterations, return, success, time left."""

    def __init__(self, config: "TrainingConfig") -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
        from rich.table import Column

        learner = learner_of(config).name
        title = f"{learner} {config.recipe} {config.problem.name} seed {config.seed}"
        self._progress = Progress(
            TextColumn(title, markup=False, table_column=Column(no_wrap=True, max_width=24)),
            BarColumn(bar_width=6),
            TextColumn("{task.completed:.0f}/{task.total:.0f}"),
            TextColumn("{task.fields[status]}", table_column=Column(no_wrap=True)),
            TimeRemainingColumn(compact=True),
            console=open_console(stderr=True),
        )
        self._task = self._progress.add_task("", total=config.iterations, status="starting")
        self._listening = told_of_compilation(self._compiling)

    def __enter__(self) -> "TrainingProgress":
        self._progress.start()
        self._listening.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.__exit__(None, None, None)
        self._progress.stop()

    def _compiling(self, begins: bool) -> None:
        """Show that kernels are compiled, which is before the first iteration."""
        self._progress.update(self._task, status="compiling, once" if begins else "starting")

    def update(self, state: TrainingState) -> None:
        """Show the latest iteration."""
        point = state.curve[-1]
        self._progress.update(
            self._task,
            completed=state.iteration,
            status=f"return {point.mean_return:+.3f} success {point.success:.0%}",
        )


def build_parser() -> Parser:
    """The options of the command."""
    parser = Parser(prog=PROG, description="Train a policy.")
    learners = parser.add_subparsers(dest="learner", required=True, metavar="LEARNER")
    for name in learner_names():
        _add_learner(learners, find_learner(name))
    return parser


def _add_learner(parsers: "argparse._SubParsersAction[Parser]", learner: Learner[Any, Any]) -> None:
    """Options of a learner: those of every training, and one for each of its settings."""
    needs = f"\nneeds the extra {learner.extra}: pip install 'kinarm[{learner.extra}]'\n"
    parser = parsers.add_parser(
        learner.name,
        help=learner.title,
        description=f"Train a policy with {learner.title}. Recipes: {', '.join(learner.recipes)}.",
        epilog=(needs if learner.extra else "") + EPILOG.format(name=learner.name),
    )
    unused = () if "tensorboard" in learner.options else ("tensorboard",)
    add_options(parser, TrainRequest, skip=("learner", "settings", *unused))
    settings = parser.add_argument_group("settings that replace those of the recipe")
    add_options(settings, learner.config, skip=CIRCUMSTANCES, negatable=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    run_command(PROG, lambda: _train(build_parser().parse_args(arguments)))


def _train(options: argparse.Namespace) -> None:
    """From options to a policy file, and a line that says what it came to."""
    given = given_options(options, find_learner(options.learner).config)
    settings = {name: value for name, value in given.items() if name not in CIRCUMSTANCES}
    request = TrainRequest(**given_options(options, TrainRequest), settings=settings)
    curve = request.run().curve
    last = curve[-1]
    sys.stdout.write(
        f"{len(curve)} iterations, {last.environment_steps / 1e6:.2f} million steps in "
        f"{last.wall_time:.1f} s; last iteration: mean return {last.mean_return:+.3f}, "
        f"success {last.success:.0%}; written: {request.out}, {curve_path(request.out)}\n"
    )


if __name__ == "__main__":
    main()
