"""A training, from the request to the files that it leaves.

Policy, learning curve and, until the end, checkpoint lie side by side.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from kinarm._console import ProgressLine
from kinarm._files import check_output, only_writer, write_text
from kinarm._interrupts import telling
from kinarm._tables import csv_text
from kinarm.errors import FROM_ZERO, InvalidInputError, KinarmError, PolicyFileError
from kinarm.policies.checkpoint import (
    CHECKPOINT_SECONDS,
    Checkpoint,
    load_checkpoint,
    save_checkpoint,
)
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import (
    CurvePoint,
    TrainingResult,
    find_learner,
    state_policy,
    training_states,
)
from kinarm.policies.recipes import recipe
from kinarm.problem_options import ProblemOptions, say_choices

CHECKPOINT = ".checkpoint.npz"


def checkpoint_path(out: str | Path) -> Path:
    """Where the checkpoint of an unfinished training lies."""
    return Path(out).with_suffix(CHECKPOINT)


def curve_path(out: str | Path) -> Path:
    """Where the learning curve of a policy lies."""
    return Path(out).with_suffix(".curve.csv")


def write_curve(path: Path, curve: Sequence[CurvePoint]) -> None:
    """Write a learning curve as CSV, one line per iteration."""
    points = enumerate(curve, start=1)
    write_text(path, csv_text([{"iteration": n, **point._asdict()} for n, point in points]))


@dataclass(frozen=True, kw_only=True)
class TrainRequest(ProblemOptions):
    """A training, from its settings to the files that it leaves.

    Parameters
    ----------
    learner : str
        Name of the learner.
    recipe : str, optional
        Name of settings, or a TOML file with some.
    seed : int, optional
        Seed of all randomness.
    settings : mapping
        Settings of the learner that replace those of the recipe.
    out : Path
        File of the policy, with learning curve and checkpoint beside it; with
        --seeds, folder of the policies.
    resume : bool
        Go on from the checkpoint beside --out; --seeds does so without it.
    overwrite : bool
        Replace an earlier policy; with --resume, by that of the training that
        goes on.
    """

    learner: str
    recipe: str | None = field(default=None, metadata={"metavar": "NAME_OR_FILE"})
    seed: int | None = field(default=None, metadata=FROM_ZERO)
    settings: dict[str, Any] = field(default_factory=dict)
    out: Path | str = field(metadata={"metavar": "FILE.npz"})
    resume: bool = False
    overwrite: bool = False

    GROUPS: ClassVar = {
        "training": "recipe seed resume",
        "output": "out overwrite",
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

        A checkpoint beside the policy is renewed every few seconds, and complete after an
        interruption.
        """
        if self.resume:
            config, state = self._checkpoint()
        elif (path := checkpoint_path(self.out)).exists():
            raise InvalidInputError(
                f"{str(path)!r} holds an unfinished training: go on with --resume, or delete it"
            )
        else:
            config, state = self.config(), None
        check_output(self.out, overwrite=self.overwrite, suffix=".npz")
        with only_writer(self.out):
            if state is None:
                say_findings(config)
            return self._train(config, state)

    def _train(self, config: TrainingConfig, state: Any) -> TrainingResult:
        """Train from a state, None for the first, and write the files."""
        path, name = checkpoint_path(self.out), find_learner(config.learner).name
        title = f"{name} {config.recipe} {config.problem.name} seed {config.seed}"

        def what_is_left() -> str:
            if state is None or not state.iteration:
                return "interrupted before the first iteration"
            save_checkpoint(path, config, state)
            done, all_of_them = state.iteration, config.iterations
            return f"interrupted after {done} of {all_of_them} iterations; go on with --resume"

        with ProgressLine(title, config.iterations, "iterations") as line, telling(what_is_left):
            line.update(words=["starting"])
            saved = time.monotonic()
            states = training_states(config, state)
            state = next(states)
            for state in states:
                point = state.curve[-1]
                success = f"success {100 * point.success:.0f} %"
                line.update(state.iteration, [f"return {point.mean_return:+.3f}", success])
                if time.monotonic() - saved > CHECKPOINT_SECONDS:
                    save_checkpoint(path, config, state)
                    saved = time.monotonic()
            result = TrainingResult(state_policy(config, state), state.curve, state)
            try:
                write_curve(curve_path(self.out), result.curve)
                result.policy.save(self.out)
            except KinarmError:
                save_checkpoint(path, config, state)
                raise
        path.unlink(missing_ok=True)
        return result

    def config(self) -> TrainingConfig:
        """Settings of the training: the recipe's, with replacements."""
        problem = self.resolve(default=recipe(self.learner, self.recipe).problem)
        config: TrainingConfig = recipe(
            self.learner, self.recipe, problem=problem, seed=self.seed, **self.settings
        )
        return config

    def _checkpoint(self) -> Checkpoint:
        """The training to go on with, which must be the one requested."""
        path = checkpoint_path(self.out)
        if not path.exists():
            raise PolicyFileError(f"nothing to resume: there is no {str(path)!r}")
        checkpoint = load_checkpoint(path)
        config: TrainingConfig = checkpoint.config
        if (other := find_learner(config.learner)) is not find_learner(self.learner):
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


def say_findings(config: TrainingConfig) -> None:
    """Say on standard error what was chosen, and of a ``symmetric`` without effect."""
    from kinarm.policies.mirror import missing_mirror

    say_choices([config.problem])
    if getattr(config, "symmetric", False) and (reason := missing_mirror(config.problem)):
        sys.stderr.write(f"symmetric has no effect: {reason}\n")
