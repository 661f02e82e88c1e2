"""A live table of a study's trainings."""

import time
from collections import Counter
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from kinarm.evaluation.reproduction.study import Study, Training

PURPOSES = {"sweep": "ARS, sweep", "ars": "ARS, settings of Table 1", "ppo": "PPO"}
RUNNING_WIDTH = 50
LINE_SECONDS = 30.0
"""How often a line is printed where there is no terminal."""


class StudyProgress:
    """Shows what is finished, what is running and how long the rest will take.

    Parameters
    ----------
    study : Study
        All trainings.
    waiting : tuple of Training
        Those that are still to be done.
    console : rich.console.Console
        Where to show it: a live table on a terminal, else a line now and then.
    """

    def __init__(self, study: Study, waiting: tuple[Training, ...], console: Console) -> None:
        self._console = console
        self._all = Counter(training.purpose for training in study.trainings)
        self._done = self._all - Counter(training.purpose for training in waiting)
        self._cost = self._cost_left = sum(training.cost for training in waiting)
        self._running: dict[Training, float] = {}
        self._began = self._printed = time.monotonic()
        self._live = Live(self._table(), console=console, refresh_per_second=2)

    def __enter__(self) -> "StudyProgress":
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def began(self, training: Training) -> None:
        """Take note of a training that a worker took up."""
        self._running[training] = time.monotonic()

    def finished(self, training: Training) -> None:
        """Take note of a finished training."""
        del self._running[training]
        self._done[training.purpose] += 1
        self._cost_left -= training.cost

    def refresh(self) -> None:
        """Show the latest."""
        if self._console.is_terminal:
            self._live.update(self._table())
        elif time.monotonic() - self._printed > LINE_SECONDS:
            self._printed = time.monotonic()
            done, total = self._done.total(), self._all.total()
            self._console.print(f"{done} of {total} trainings finished, {self._remaining()}")

    def _remaining(self) -> str:
        """Estimate of the time left, by the cost of what is done."""
        spent = time.monotonic() - self._began
        underway = sum(training.cost for training in self._running) / 2
        done = self._cost - self._cost_left + underway
        if self._cost_left == self._cost:
            return "time left unknown yet"
        minutes = spent * max(self._cost_left - underway, 0.0) / done / 60
        return f"about {minutes:.0f} min left" if minutes >= 1 else "less than a minute left"

    def _table(self) -> Group:
        """The table, with a bar of what is done by its cost."""
        table = Table("trainings", "finished", header_style="bold")
        table.add_column("running", min_width=RUNNING_WIDTH)
        for purpose, total in self._all.items():
            now = time.monotonic()
            running = [
                f"{training.name} ({now - since:.0f} s)"
                for training, since in self._running.items()
                if training.purpose == purpose
            ]
            finished = f"{self._done[purpose]} of {total}"
            table.add_row(PURPOSES[purpose], finished, "\n".join(running))
        below = Table.grid(padding=(0, 1))
        bar = ProgressBar(total=self._cost, completed=self._cost - self._cost_left, width=60)
        below.add_row(bar, self._remaining() if self._cost_left else "all are finished")
        return Group(table, below)
