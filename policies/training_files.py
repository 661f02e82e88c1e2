"""The files of a training: its policy, its learning curve, and a checkpoint while it lasts."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from kinarm._interrupts import telling
from kinarm.errors import InvalidInputError, KinarmError
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import TrainingResult, TrainingState, begin_training, run_training
from kinarm.policies.training_progress import Watcher, watched_preparation

CHECKPOINT = ".checkpoint.npz"
"""Ending of the file of a checkpoint."""

CHECKPOINT_SECONDS = 5.0
"""How often a checkpoint is saved [s]."""


class TrainingStopped(Exception):  # noqa: N818 - it is no error
    """A training was asked to stop; its checkpoint is saved."""


def checkpoint_path(out: str | Path) -> Path:
    """Where the checkpoint of a training lies until it is finished."""
    return Path(out).with_suffix(CHECKPOINT)


def curve_path(out: str | Path) -> Path:
    """Where the learning curve of a policy lies."""
    return Path(out).with_suffix(".curve.csv")


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


class CheckpointKeeper:
    """Saves the latest state every few seconds and on demand."""

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
    watcher: Watcher,
    asked_to_stop: Callable[[], bool] = lambda: False,
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
    watcher : Watcher
        Is told how far the training is.
    asked_to_stop : callable
        Whether the training is to stop; asked after every iteration.

    Raises
    ------
    KinarmError
        If settings cannot be used, or a file cannot be written.
    TrainingStopped
        If the training was asked to stop; the checkpoint is complete.
    KeyboardInterrupt
        If it is interrupted; the checkpoint is complete, and the message says so.
    """
    from kinarm.policies.curve import write_curve

    path = checkpoint_path(out)
    keeper = CheckpointKeeper(config, path, state)

    def on_iteration(state: TrainingState) -> None:
        watcher.update(state)
        keeper.update(state)
        if state.iteration < config.iterations and asked_to_stop():
            keeper.save()
            raise TrainingStopped

    with telling(keeper.save_on_interrupt):
        with watched_preparation(watcher):
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
