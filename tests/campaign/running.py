"""Running many inputs: in a process that may die or hang, with progress, into a record."""

import argparse
import fcntl
import json
import multiprocessing
import shlex
import sys
import traceback
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .judging import Verdict
from .record_page import write_page

PATIENCE = 120.0
"""Time after which a call counts as hanging [s]."""

ROUNDS = (50, 10, 3, 1)
"""Shares of the inputs after which all subjects have had their turn, as divisors."""

FORK = multiprocessing.get_context("fork")

Try = Callable[[int], Verdict]
"""Judges the input of a number."""

MakeTry = Callable[[Path], Try]
"""Prepares a process for a subject, with a folder for its files."""


@dataclass
class Tally:
    """What came of the inputs of one subject.

    Attributes
    ----------
    inputs, accepted, refused : int
        How many there were.
    findings : dict of str to int
        How often something was wrong, by what it was.
    examples : dict of str to int
        Number of the first input of each.
    peak_memory : float
        Of a call, at most, above that before [MB].
    """

    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    findings: dict[str, int] = field(default_factory=dict)
    examples: dict[str, int] = field(default_factory=dict)
    peak_memory: float = 0.0

    def add(self, number: int, verdict: Verdict) -> None:
        """Count a verdict."""
        self.inputs += 1
        if verdict.finding:
            self.findings[verdict.finding] = self.findings.get(verdict.finding, 0) + 1
            self.examples.setdefault(verdict.finding, number)
        elif verdict.accepted:
            self.accepted += 1
        else:
            self.refused += 1
        self.peak_memory = max(self.peak_memory, round(verdict.memory / 1e6, 1))


def generator(seed: int, subject: str, number: int) -> np.random.Generator:
    """Randomness of an input: that of its number, whatever came before it."""
    return np.random.default_rng((seed, zlib.crc32(subject.encode()), number))


def run_inputs(make_try: MakeTry, inputs: int, first: int = 0) -> Iterator[tuple[int, Verdict]]:
    """Judge inputs in another process; where that ends or hangs, another one goes on.

    Parameters
    ----------
    make_try : callable
        Prepares a process, whose folder it is given, and returns what judges an input there.
    inputs, first : int
        Where the numbers of inputs end, and begin.
    """
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None  # files that need no disk
    with TemporaryDirectory(prefix="campaign-", dir=memory) as folder:
        yield from _verdicts(partial(make_try, Path(folder)), first, inputs)


def _verdicts(
    make_try: Callable[[], Try], number: int, inputs: int
) -> Iterator[tuple[int, Verdict]]:
    """Judge inputs from a number on, in processes."""
    while number < inputs:
        ours, theirs = FORK.Pipe(duplex=False)
        process = FORK.Process(target=_work, args=(make_try, number, inputs, theirs))
        process.start()
        theirs.close()
        ours.recv()  # it is ready
        finding = ""
        while number < inputs and not finding:
            if not ours.poll(PATIENCE):
                finding = f"takes longer than {PATIENCE:.0f} s"
                process.kill()
            else:
                try:
                    verdict = ours.recv()
                except EOFError:
                    process.join()
                    finding = f"the process ends with status {process.exitcode}"
                else:
                    if isinstance(verdict, str):
                        raise RuntimeError(verdict)  # of the campaign itself
                    yield number, verdict
                    number += 1
        process.join()
        ours.close()
        if finding:
            yield number, Verdict(False, finding, 0)
            number += 1


def _work(make_try: Callable[[], Try], first: int, inputs: int, connection: Connection) -> None:
    """Judge inputs from a number on."""
    judge = make_try()
    connection.send(None)
    with suppress(BrokenPipeError):
        for number in range(first, inputs):
            try:
                connection.send(judge(number))
            except Exception:
                connection.send(f"input {number}: {traceback.format_exc()}")
                raise


def options(about: str, inputs: int) -> argparse.ArgumentParser:
    """Options of every module of the campaign."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--inputs", type=int, default=inputs, help="of every subject")
    parser.add_argument("--only", nargs="+", default=[], metavar="SUBJECT")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, metavar="FILE.json")
    parser.add_argument("--resume", action="store_true", help="go on with what FILE.json records")
    return parser


def recorded(given: argparse.Namespace) -> dict[str, Tally]:
    """What a record says of subjects, if it is to go on."""
    if not (given.resume and given.out and given.out.exists()):
        return {}
    subjects = json.loads(given.out.read_text())["subjects"]
    return {name: Tally(**entries) for name, entries in subjects.items()}


def record(tallies: Mapping[str, Tally], given: argparse.Namespace, module: str) -> None:
    """Write what came of subjects, with the command; what other processes write is kept."""
    if given.out is None:
        return
    told = {name: getattr(given, name, None) for name in ("inputs", "seconds", "seed", "out")}
    arguments = [
        word for name, value in told.items() if value is not None for word in (f"--{name}", value)
    ]
    command = shlex.join(["python", "-m", f"tests.campaign.{module}", *map(str, arguments)])
    given.out.parent.mkdir(parents=True, exist_ok=True)
    with given.out.open("a+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        file.seek(0)
        kept: dict[str, Any] = json.loads(file.read() or '{"subjects": {}}')["subjects"]
        kept |= {name: asdict(tally) for name, tally in tallies.items()}
        content = {"command": command, "subjects": dict(sorted(kept.items()))}
        text = json.dumps(content, indent=1) + "\n"
        file.truncate(0)
        file.write(text)
        write_page(given.out, kept)


def campaign(subjects: Mapping[str, MakeTry], given: argparse.Namespace, module: str) -> int:
    """Run the inputs of every subject, show progress, record; returns how many findings."""
    chosen = given.only or list(subjects)
    tallies = {name: Tally() for name in chosen} | recorded(given)
    ends = [given.inputs // divisor for divisor in ROUNDS]
    for end in ends:
        for name in chosen:
            first = tallies[name].inputs
            if first >= end:
                continue
            for number, verdict in run_inputs(subjects[name], end, first):
                tallies[name].add(number, verdict)
                if sys.stderr.isatty() and number % 100 == 0:
                    sys.stderr.write(f"\r{name}: {number} of {given.inputs}")
            tell(name, tallies[name])
            record({name: tallies[name]}, given, module)
    return sum(len(tallies[name].findings) for name in chosen)


def tell(name: str, tally: Tally) -> None:
    """Say what came of a subject so far."""
    sys.stderr.write(
        f"\r{name}: {tally.inputs} inputs, {tally.accepted} accepted, {tally.refused} refused, "
        f"{sum(tally.findings.values())} findings, {tally.peak_memory} MB\n"
    )
    for finding, times in tally.findings.items():
        sys.stderr.write(f"    {times} x {finding}, first {tally.examples[finding]}\n")
