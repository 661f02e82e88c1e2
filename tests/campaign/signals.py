"""Requests to end, at random moments of every command.

``python -m tests.campaign.signals --count 500 --out data/results/campaign/signals.json``
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from .processes import SUBJECTS, Ended, Subject, end_of, left_behind, own_cache, started, write

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
class Tally:
    """What came of the signals to one command."""

    runs: int = 0
    interrupted: int = 0
    finished: int = 0
    before_kinarm: int = 0
    slowest_end: float = 0.0
    kinds: dict[str, int] = field(default_factory=dict)
    findings: dict[str, int] = field(default_factory=dict)
    examples: dict[str, dict[str, Any]] = field(default_factory=dict)


def campaign(
    count: int, seed: int, subjects: Mapping[str, Subject], *, quiet: bool = False
) -> dict[str, Tally]:
    """Disturb commands in turn, so many times in all."""
    rng = np.random.default_rng(seed)
    tallies = {name: Tally() for name in subjects}
    with own_cache():
        for number in range(count):
            name = [*subjects][number % len(subjects)]
            disturbance = random_disturbance(rng, subjects[name].seconds)
            with TemporaryDirectory() as folder:
                ended, left = disturbed(subjects[name], disturbance, Path(folder))
            _take_note(tallies[name], subjects[name], disturbance, ended, left)
            if not quiet and sys.stderr.isatty():
                sys.stderr.write(f"\r{number + 1} of {count}")
    return tallies


def _take_note(
    tally: Tally, subject: Subject, disturbance: Disturbance, ended: Ended, left: list[str]
) -> None:
    tally.runs += 1
    tally.kinds[disturbance.kind] = tally.kinds.get(disturbance.kind, 0) + 1
    if before_kinarm(ended, disturbance.request):
        tally.before_kinarm += 1
        return
    found = finding(subject.program, ended, left)
    if found:
        tally.findings[found] = tally.findings.get(found, 0) + 1
        tally.examples.setdefault(
            found, {**disturbance._asdict(), "request": disturbance.request.name, "err": ended.err}
        )
    elif ended.status == 130:
        tally.interrupted += 1
        tally.slowest_end = max(tally.slowest_end, round(ended.seconds, 2))
    else:
        tally.finished += 1


def main() -> None:
    """Run the large campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", default=[*SUBJECTS], choices=SUBJECTS)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    subjects = {name: SUBJECTS[name] for name in given.only}
    tallies = campaign(given.count, given.seed, subjects)
    total = sum(sum(tally.findings.values()) for tally in tallies.values())
    counts = {"signals": sum(tally.runs for tally in tallies.values())}
    write(given.out, "signals", counts, total, {n: asdict(t) for n, t in tallies.items()})
    sys.exit(1 if total else 0)


if __name__ == "__main__":
    main()
