"""Loaders, fed with files that new lines of kinarm are looked for with, by atheris.

``python -m tests.campaign.guided --out data/results/campaign/guided.json``. Atheris is no
dependency of kinarm: ``pip install atheris``.
"""

import argparse
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory

import atheris

# Lines of the modules that read are looked for; those of kernels must stay as Numba knows them.
with atheris.instrument_imports(include=["json", "kinarm", "tomllib"]):
    import kinarm.problem_files
    import kinarm.urdf
import kinarm.simulator

with atheris.instrument_imports(include=["kinarm"]):
    import kinarm.evaluation.document
    import kinarm.recording  # noqa: F401

from .judging import Judge, Verdict
from .loaders import LOADERS
from .running import FORK, Tally, record, tell

CHOSEN = ("evaluation", "policy", "problem", "recordings", "urdf")
"""Loaders whose files people pass on; other files are kinarm's own or read by the same means."""

LARGEST = 100_000
"""Size of files at most [bytes]."""


def verdicts(name: str, seconds: int, folder: Path) -> Iterator[Verdict]:
    """Judge files for so many seconds, in a process that libFuzzer ends."""
    ours, theirs = FORK.Pipe(duplex=False)
    process = FORK.Process(target=_search, args=(name, seconds, folder, theirs))
    process.start()
    theirs.close()
    with suppress(EOFError):
        while True:
            yield ours.recv()
    process.join()
    if process.exitcode:
        yield Verdict(False, f"the process ends with status {process.exitcode}", 0)


def _search(name: str, seconds: int, folder: Path, connection: Connection) -> None:
    """Let libFuzzer change valid files, and keep those that lead to new lines."""
    loader, corpus = LOADERS[name], folder / "corpus"
    path = folder / "files" / loader.file
    for each in (corpus, path.parent):
        each.mkdir(parents=True)
    loader.prepare(folder / "files")
    for number, content in enumerate(loader.samples()):
        (corpus / f"{number}").write_bytes(content)
        path.write_bytes(content)
        loader.load(path)  # what is imported and compiled once is no file's
    judge = Judge(traced=0).__enter__()

    def try_file(content: bytes) -> None:
        path.write_bytes(content)
        os.ftruncate(2, 0)  # what libFuzzer itself said
        connection.send(judge(loader.load, path))

    settings = ("-verbosity=0", "-rss_limit_mb=0", f"-max_total_time={seconds}")
    atheris.Setup([name, str(corpus), *settings, f"-max_len={LARGEST}"], try_file)
    atheris.Fuzz()


def main() -> int:
    """Run the search."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=600, help="of every loader")
    parser.add_argument("--only", nargs="+", default=CHOSEN, choices=LOADERS, metavar="SUBJECT")
    parser.add_argument("--out", type=Path, metavar="FILE.json")
    given = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    findings = 0
    for name in given.only:
        tally = Tally()
        with TemporaryDirectory(prefix="campaign-") as folder:
            for number, verdict in enumerate(verdicts(name, given.seconds, Path(folder))):
                tally.add(number, verdict)
        tell(name, tally)
        record({name: tally}, given, "guided")
        findings += len(tally.findings)
    return findings


if __name__ == "__main__":
    sys.exit(main() > 0)
