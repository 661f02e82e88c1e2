"""Kills at random moments of every long run, which then goes on and ends as if undisturbed.

``python -m tests.campaign.kills --count 40 --out data/results/campaign/kills.json``
"""

import argparse
import os
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from .processes import SMALL_PPO, Subject, end_of, left_behind, own_cache, results, started, write

AGED = 120.0
"""Half-written files of a process that was killed are made to look so much older [s]."""

FREQUENT = """
import sys
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
    made : str
        What names of files begin with that are compared.
    """

    subject: Subject
    resume: tuple[str, ...] = ()
    when: str = ""
    made: str = ""

    def words(self, folder: Path, begun: Path) -> list[str]:
        """The command line in a folder, with what makes it go on if there is something."""
        program = self.subject.spelled(as_module=False)
        if self.subject.program == "kinarm-train":  # one that saves checkpoints all the time
            program = [sys.executable, str(begun), *self.subject.arguments]
        goes_on = self.when and list(folder.glob(self.when))
        return [*program, *(self.resume if goes_on else ())]


OUT = ("--out", "out")
RESUME = ("--resume", "--overwrite")
RUNS: dict[str, LongRun] = {
    "train, ars": LongRun(
        Subject(
            "kinarm-train",
            (
                *("ars", "--out", "p.npz", "--directions", "4", "--top-directions", "2"),
                *("--iterations", "3000"),
            ),
        ),
        RESUME,
        "p.checkpoint.npz",
    ),
    "train, ppo": LongRun(
        Subject("kinarm-train", ("ppo", "--out", "p.npz", *SMALL_PPO)), RESUME, "p.checkpoint.npz"
    ),
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
class Tally:
    """What came of the kills of one run."""

    ends: int = 0
    kills: int = 0
    findings: dict[str, int] = field(default_factory=dict)
    examples: dict[str, str] = field(default_factory=dict)

    def find(self, what: str, err: str = "") -> None:
        """Take note of something that is wrong."""
        self.findings[what] = self.findings.get(what, 0) + 1
        self.examples.setdefault(what, err[-2000:])


def made_by(run: LongRun, folder: Path) -> dict[str, bytes]:
    """What is compared of a folder."""
    return {name: made for name, made in results(folder).items() if name.startswith(run.made)}


def killed(run: LongRun, kills: int, rng: np.random.Generator, tally: Tally, begun: Path) -> None:
    """Kill a run several times, let it go on to its end, and compare it with an undisturbed one."""
    with TemporaryDirectory() as first, TemporaryDirectory() as second:
        undisturbed, folder = Path(first), Path(second)
        seconds = _to_its_end(run, undisturbed, tally, begun)
        for _ in range(kills):
            with started(run.words(folder, begun), folder) as process:
                time.sleep(rng.uniform(0, seconds))
                tally.kills += process.poll() is None
                process.kill()
                process.wait()
                for left in left_behind(process.pid, folder):
                    if left in ("a process", "shared memory"):
                        tally.find(f"leaves {left}")
            _let_age(folder)
        _to_its_end(run, folder, tally, begun)
        tally.ends += 1
        if made_by(run, folder) != made_by(run, undisturbed):
            tally.find("other results")


def _to_its_end(run: LongRun, folder: Path, tally: Tally, begun: Path) -> float:
    """Let a run end; return how long it took [s]."""
    began = time.monotonic()
    with started(run.words(folder, begun), folder) as process:
        ended = end_of(process, folder, began)
        if ended.status != 0:
            tally.find(f"ends with status {ended.status}", ended.err)
        for left in left_behind(process.pid, folder):
            tally.find(f"leaves {left}")
    return ended.seconds


def _let_age(folder: Path) -> None:
    """Half-written files are swept when they are old enough."""
    for path in folder.rglob("*.part"):
        then = path.stat().st_mtime - AGED
        os.utime(path, (then, then))


def campaign(count: int, seed: int, runs: Mapping[str, LongRun], each: int = 4) -> dict[str, Tally]:
    """Kill runs in turn, so many times in all, and ``each`` time before one ends."""
    rng = np.random.default_rng(seed)
    tallies = {name: Tally() for name in runs}
    with own_cache() as cache:
        begun = cache / "kinarm-train"
        begun.write_text(FREQUENT)
        for number in range(-(-count // each)):
            name = [*runs][number % len(runs)]
            killed(runs[name], each, rng, tallies[name], begun)
    return tallies


def main() -> None:
    """Run the large campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", default=[*RUNS], choices=RUNS)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    tallies = campaign(given.count, given.seed, {name: RUNS[name] for name in given.only})
    counts = {"kills": sum(tally.kills for tally in tallies.values())}
    findings = sum(sum(tally.findings.values()) for tally in tallies.values())
    parts = {name: asdict(tally) for name, tally in tallies.items()}
    write(given.out, "kills", counts, findings, parts)
    sys.exit(1 if findings else 0)


if __name__ == "__main__":
    main()
