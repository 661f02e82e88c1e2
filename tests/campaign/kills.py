"""Kills at random moments of every long run, which then goes on and ends as if undisturbed.

``python -m tests.campaign.kills --count 40 --out data/results/campaign/kills.json``

Do not commit or change sources meanwhile: what is compared names the commit that made it.
"""

import os
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from .disturbing import Tally, Tell, main, take_turns, tell_nobody
from .processes import SMALL_PPO, Subject, end_of, left_behind, results, started

AGED = 120.0
"""Half-written files of a process that was killed are made to look so much older [s]."""

FREQUENT = """
from kinarm.policies import train
train.CHECKPOINT_SECONDS = 0.05
train.main()
"""


class LongRun(NamedTuple):
    """A run that is killed.

    Attributes
    ----------
    subject : Subject
        The command.
    resume : tuple of str
        What is added to go on, once there is a file of a name.
    when : str
        That name, or pattern; empty if the same command goes on in any case.
    last : str
        File that is there without one of that name as soon as the run is complete: it may be
        killed between that and its end.
    made : str
        What names of files begin with that are compared.
    """

    subject: Subject
    resume: tuple[str, ...] = ()
    when: str = ""
    last: str = ""
    made: str = ""

    def complete(self, folder: Path) -> bool:
        """Whether everything is written, so that there is nothing to go on with."""
        return bool(self.last) and (folder / self.last).exists() and not self._begun(folder)

    def _begun(self, folder: Path) -> bool:
        return bool(self.when) and any(folder.glob(self.when))

    def words(self, folder: Path) -> list[str]:
        """The command line in a folder, with what makes it go on if there is something."""
        program = self.subject.spelled(as_module=False)
        if self.subject.program == "kinarm-train":  # one that saves checkpoints all the time
            program = [sys.executable, "-c", FREQUENT, *self.subject.arguments]
        return [*program, *(self.resume if self._begun(folder) else ())]


OUT = ("--out", "out")
GOES_ON = (("--resume", "--overwrite"), "p.checkpoint.npz", "p.npz")
RUNS: dict[str, LongRun] = {
    "train, ars": LongRun(
        Subject(
            "kinarm-train",
            (
                *("ars", "--out", "p.npz", "--directions", "4", "--top-directions", "2"),
                *("--iterations", "3000"),
            ),
        ),
        *GOES_ON,
    ),
    "train, ppo": LongRun(Subject("kinarm-train", ("ppo", "--out", "p.npz", *SMALL_PPO)), *GOES_ON),
    "reproduce": LongRun(
        Subject("kinarm-reproduce", ("--quick", "--no-ppo", "--jobs", "2", *OUT)), made="out"
    ),
    "compare": LongRun(
        Subject(
            "kinarm-compare",
            (
                *("--learners", "ars-paper", "ars-tuned", "--problems", "right"),
                *("--steps", "20000", "--trials", "50", "--seeds", "3", "--jobs", "2", *OUT),
            ),
        ),
        made="out/runs",
    ),
}


@dataclass
class KillTally(Tally):
    """What came of the kills of one run.

    Attributes
    ----------
    ends, kills : int
        How often it came to its end, and was killed.
    """

    ends: int = 0
    kills: int = 0

    @property
    def disturbances(self) -> int:
        """Kills."""
        return self.kills


class Undisturbed(NamedTuple):
    """What a run made that nobody killed, and how long it took [s]."""

    made: dict[str, bytes]
    seconds: float


def made_by(run: LongRun, folder: Path) -> dict[str, bytes]:
    """What is compared of a folder."""
    return {name: made for name, made in results(folder).items() if name.startswith(run.made)}


def undisturbed(run: LongRun, tally: KillTally) -> Undisturbed:
    """Let a run come to its end."""
    with TemporaryDirectory() as folder:
        seconds = _to_its_end(run, Path(folder), tally)
        return Undisturbed(made_by(run, Path(folder)), seconds)


def killed(
    run: LongRun, kills: int, rng: np.random.Generator, tally: KillTally, wanted: Undisturbed
) -> None:
    """Kill a run several times, let it go on to its end, and compare it with an undisturbed one."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for _ in range(kills):
            if _ends_before(rng.uniform(0, 0.6 * wanted.seconds), run, folder, tally):
                break
        else:
            _to_its_end(run, folder, tally)
        tally.ends += 1
        made = made_by(run, folder)
        others = [
            name for name in {**wanted.made, **made} if made.get(name) != wanted.made.get(name)
        ]
        if others:
            tally.find("other results", files=sorted(others))


def _ends_before(seconds: float, run: LongRun, folder: Path, tally: KillTally) -> bool:
    """Kill a run after some time; whether it was complete by then, since it goes on each time."""
    with started(run.words(folder), folder) as process:
        time.sleep(seconds)
        status = process.poll()
        if status is None:
            process.kill()
            process.wait()
            tally.kills += 1
            for left in left_behind(process.pid, folder):
                if left in ("a process", "shared memory"):
                    tally.find(f"leaves {left}")
            _let_age(folder)
        elif status:
            tally.find(f"ends with status {status}", err=(folder / "err").read_text()[-2000:])
    return status is not None or run.complete(folder)


def _to_its_end(run: LongRun, folder: Path, tally: KillTally) -> float:
    """Let a run end; return how long it took [s]."""
    began = time.monotonic()
    with started(run.words(folder), folder) as process:
        ended = end_of(process, folder, began)
        if ended.status != 0:
            tally.find(f"ends with status {ended.status}", err=ended.err[-2000:])
        for left in left_behind(process.pid, folder):
            tally.find(f"leaves {left}")
    return ended.seconds


def _let_age(folder: Path) -> None:
    """Half-written files are swept when they are old enough."""
    for path in folder.rglob("*.part"):
        then = path.stat().st_mtime - AGED
        os.utime(path, (then, then))


def campaign(
    count: int, seed: int, names: Iterable[str], tell: Tell = tell_nobody, each: int = 4
) -> dict[str, KillTally]:
    """Kill runs in turn, so many times in all, and ``each`` time before one ends."""
    known: dict[str, Undisturbed] = {}

    def disturb(name: str, rng: np.random.Generator, tally: KillTally) -> None:
        known[name] = known.get(name) or undisturbed(RUNS[name], tally)
        killed(RUNS[name], each, rng, tally, known[name])

    tallies = {name: KillTally() for name in names}
    return take_turns(-(-count // each), seed, tallies, disturb, tell)


if __name__ == "__main__":
    main("kills", 40, [*RUNS], campaign)
