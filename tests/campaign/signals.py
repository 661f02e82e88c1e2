"""Requests to end, at random moments of every command.

``python -m tests.campaign.signals --count 500 --out data/results/campaign/signals.json``
"""

import os
import signal
import subprocess
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from .disturbing import Tally, Tell, main, take_turns, tell_nobody
from .processes import SUBJECTS, Ended, Subject, end_of, left_behind, started

REQUESTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
OTHER_WAYS = 0.2
"""Share of the disturbances that are not by Ctrl-C."""


class Disturbance(NamedTuple):
    """Signals that a command gets.

    Attributes
    ----------
    as_module : bool
        Whether it is started by ``python -m``, not by its script.
    request : signal.Signals
        The signal.
    moments : tuple of float
        When, counted from the start [s]; the next ones from the one before.
    to_all : bool
        Whether all of its processes get it, as from a terminal.
    """

    as_module: bool
    request: signal.Signals
    moments: tuple[float, ...]
    to_all: bool

    @property
    def kind(self) -> str:
        """In words."""
        times = ("once", "twice", "thrice")[len(self.moments) - 1]
        return f"{self.request.name} {times}"


def random_disturbance(rng: np.random.Generator, seconds: float) -> Disturbance:
    """Up to three signals: a third within the first second, any of them close to each other."""
    last = min(seconds, 1.0) if rng.random() < 1 / 3 else seconds
    gaps = rng.choice([0.0, 0.001, 0.01, 0.1, 0.5], size=int(rng.integers(3))) * rng.random()
    return Disturbance(
        as_module=bool(rng.integers(2)),
        request=REQUESTS[int(rng.integers(1, 3))] if rng.random() < OTHER_WAYS else signal.SIGINT,
        moments=(float(rng.uniform(0, last)), *map(float, gaps)),
        to_all=bool(rng.integers(2)),
    )


def disturbed(subject: Subject, disturbance: Disturbance, folder: Path) -> tuple[Ended, list[str]]:
    """Run a command in a folder, send it signals, and see how it ends and what it leaves."""
    began = time.monotonic()
    with started(subject.spelled(as_module=disturbance.as_module), folder) as process:
        for moment in disturbance.moments:
            time.sleep(moment)
            if process.poll() is None:
                _send(process, disturbance)
        sent = time.monotonic()
        ended = end_of(process, folder, began)
        ended = ended._replace(seconds=ended.seconds - (sent - began))
        return ended, left_behind(process.pid, folder)


def _send(process: subprocess.Popen[bytes], disturbance: Disturbance) -> None:
    """Send the signal to the process, or to the group of processes that it leads."""
    if disturbance.to_all:
        os.killpg(process.pid, disturbance.request)
    else:
        process.send_signal(disturbance.request)


def before_kinarm(ended: Ended, request: signal.Signals) -> bool:
    """Whether the interpreter itself was still starting, and answered in its own way.

    It is then ended by the signal, or by an interrupt outside of what kinarm could do: within
    ``site`` and ``runpy``, or up to the line of `kinarm._interrupts` that takes over.
    """
    if ended.status == -request and not ended.err:
        return True
    frames = [line for line in ended.err.splitlines() if line.lstrip().startswith('File "')]
    own = [line for line in frames if "/kinarm/" in line or "/evaluation/" in line]
    first = all("_interrupts.py" in line or "kinarm/__init__.py" in line for line in own)
    return ended.status in (1, -request) and "Traceback" in ended.err and first


def finding(program: str, ended: Ended, left: Iterable[str]) -> str:
    """What is wrong with how a command ended; empty if nothing is."""
    if ended.status is None:
        return "hangs"
    if "Traceback" in ended.err or "Exception ignored" in ended.err:
        return f"traceback: {ended.err.strip().splitlines()[-1][:100]}"
    if ended.status not in (0, 130):
        return f"status {ended.status}"
    own = [line for line in ended.err.splitlines() if line.startswith(f"{program}: ")]
    if len(own) > 1 or (own and not ended.err.endswith(f"{own[0]}\n")):
        return "more than a line"
    for each in left:
        return f"leaves {each}"
    return ""


@dataclass
class SignalTally(Tally):
    """What came of the signals to one command.

    Attributes
    ----------
    runs, interrupted, finished, before_kinarm : int
        How many there were; ended as asked; were over before; and were in Python's own start.
    slowest_end : float
        From the last signal to the end [s].
    kinds : dict of str to int
        How many there were of each kind.
    """

    runs: int = 0
    interrupted: int = 0
    finished: int = 0
    before_kinarm: int = 0
    slowest_end: float = 0.0
    kinds: dict[str, int] = field(default_factory=dict)

    @property
    def disturbances(self) -> int:
        """Runs that were sent signals."""
        return self.runs


def campaign(
    count: int, seed: int, names: Iterable[str], tell: Tell = tell_nobody
) -> dict[str, SignalTally]:
    """Disturb commands in turn, so many times in all."""
    return take_turns(count, seed, {name: SignalTally() for name in names}, _disturb, tell)


def _disturb(name: str, rng: np.random.Generator, tally: SignalTally) -> None:
    """Disturb a command once, and take note of how it ends."""
    subject = SUBJECTS[name]
    disturbance = random_disturbance(rng, subject.seconds)
    with TemporaryDirectory() as folder:
        ended, left = disturbed(subject, disturbance, Path(folder))
    tally.runs += 1
    tally.kinds[disturbance.kind] = tally.kinds.get(disturbance.kind, 0) + 1
    if before_kinarm(ended, disturbance.request):
        tally.before_kinarm += 1
    elif found := finding(subject.program, ended, left):
        how = {**disturbance._asdict(), "request": disturbance.request.name}
        tally.find(found, **how, err=ended.err)
    elif ended.status == 130:
        tally.interrupted += 1
        tally.slowest_end = max(tally.slowest_end, round(ended.seconds, 2))
    else:
        tally.finished += 1


if __name__ == "__main__":
    main("signals", 500, [*SUBJECTS], campaign)
