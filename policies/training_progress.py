"""How far a training is, in one line on standard error."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from kinarm._console import told_of_activities
from kinarm.policies.config import TrainingConfig
from kinarm.policies.learners import TrainingState, learner_of

if TYPE_CHECKING:
    from kinarm._console import ProgressLine

STARTING = "starting"
"""What a training does before its first iteration, unless it says something else."""


class Watcher(Protocol):
    """Watches the progress of a training."""

    def prepare(self, activity: str) -> None:
        """It does something before it goes on, in words; empty if that is over."""

    def update(self, state: TrainingState) -> None:
        """Take note of the latest iteration."""


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


@contextmanager
def watched_preparation(watcher: Watcher) -> Iterator[None]:
    """Tell a watcher that a training begins, and what takes long before it goes on."""
    watcher.prepare("")
    with told_of_activities(watcher.prepare):
        yield
