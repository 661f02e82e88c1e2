"""A live table of a study's trainings."""

import time
from collections import Counter
from collections.abc import Sequence

from rich.console import Console, Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from kinarm.evaluation.reproduction.study import Study, Training

PURPOSES = {"sweep": "ARS, sweep", "ars": "ARS, settings of Table 1", "ppo": "PPO"}
RUNNING_WIDTH = 50
LINE_SECONDS = 30.0
"""How often a line is printed, at most, where there is no terminal."""


class StudyProgress:
    """Shows what is finished, what is running and how long the rest will take.

    Parameters
    ----------
    study : Study
        All trainings.
    waiting : sequence of Training
        Those that are still to be done, in the order in which they begin.
    jobs : int
        How many run at a time.
    console : rich.console.Console
        Where to show it: a live table on a terminal, else a line now and then.
    """

    def __init__(
        self, study: Study, waiting: Sequence[Training], jobs: int, console: Console
    ) -> None:
        self._console = console
        self._all = Counter(training.purpose for training in study.trainings)
        self._done = self._all - Counter(training.purpose for training in waiting)
        self._waiting, self._jobs = list(waiting), jobs
        self._cost = sum(training.cost for training in waiting)
        self._running: dict[Training, float] = {}
        self._began = self._printed = time.monotonic()
        self._live = Live(get_renderable=self._table, console=console, refresh_per_second=2)

    def __enter__(self) -> "StudyProgress":
        self._take_up()
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._console.is_terminal:
            self._live.stop()

    def finished(self, training: Training) -> None:
        """Take note of a finished training."""
        self._waiting.remove(training)
        self._done[training.purpose] += 1
        self._take_up()
        if not self._console.is_terminal and time.monotonic() - self._printed > LINE_SECONDS:
            self._printed = time.monotonic()
            done, total = self._done.total(), self._all.total()
            self._console.print(f"{done} of {total} trainings finished, {self._remaining()}")

    def _take_up(self) -> None:
        """Take note of what has begun: the first of those that are not finished."""
        now = time.monotonic()
        self._running = {t: self._running.get(t, now) for t in self._waiting[: self._jobs]}

    def _remaining(self) -> str:
        """Estimate of the time left, by the cost of what is done."""
        left = sum(training.cost for training in self._waiting)
        if left == self._cost:
            return "time left unknown yet" if left else "all are finished"
        underway = sum(training.cost for training in self._running) / 2
        spent = time.monotonic() - self._began
        minutes = spent * (left - underway) / (self._cost - left + underway) / 60
        return f"about {minutes:.0f} min left" if minutes >= 1 else "less than a minute left"

    def _table(self) -> Group:
        """The table, with a bar of what is done by its cost."""
        table = Table("trainings", "finished", header_style="bold")
        table.add_column("running", min_width=RUNNING_WIDTH)
        now, running = time.monotonic(), self._running
        for purpose, total in self._all.items():
            names = [
                f"{training.name} ({now - since:.0f} s)"
                for training, since in running.items()
                if training.purpose == purpose
            ]
            table.add_row(PURPOSES[purpose], f"{self._done[purpose]} of {total}", "\n".join(names))
        below = Table.grid(padding=(0, 1))
        done = self._cost - sum(training.cost for training in self._waiting)
        below.add_row(ProgressBar(total=self._cost, completed=done, width=60), self._remaining())
        return Group(table, below)
