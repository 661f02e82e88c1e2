"""Every write of every command fails once: ``python -m tests.campaign.writes``.

Whatever fails, files are the old or the new ones, none is half written, nothing else is left, and
the command says so in one line. The surroundings in which commands run are those of
`tests.campaign.surroundings`.
"""

import contextlib
import io
import os
import shutil
import sys
from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from unittest import mock

from kinarm._archive import CACHE_VARIABLE
from kinarm._command_line import run_command
from kinarm.evaluation.commands import arms, evaluate, problem, replay
from kinarm.evaluation.evaluation import Evaluation
from kinarm.policies import train

from . import samples
from .command_lines import STATUSES, inside
from .faults import FAULTS, failing
from .judging import Verdict, place_of
from .running import Try, campaign, options

LARGE = 1000


@cache
def evaluations() -> list[Evaluation]:
    """What a command came to before it writes."""
    request = evaluate.EvaluationRequest(policies=("ars-tuned-both",), trials=2, oracle=False)
    return request.evaluate()


def _evaluate() -> None:
    """Write what an evaluation came to."""
    found = evaluations()
    faced = "kinarm.evaluation.request.EvaluationRequest._face"
    with mock.patch(faced, return_value=found):
        evaluate.main(
            [
                "--policy",
                "ars-tuned-both",
                "--no-oracle",
                "--trials",
                "2",
                "--out",
                "out",
                "--overwrite",
            ]
        )


def _saving(save: Callable[[Path], object]) -> Callable[[], object]:
    """A command that saves something to the current folder."""
    return lambda: run_command("kinarm-save", lambda: save(Path()))


WRITERS: dict[str, Callable[[], object]] = {
    "kinarm-train": lambda: train.main(
        [
            "ars",
            "--iterations",
            "2",
            "--directions",
            "2",
            "--top-directions",
            "1",
            "--horizon",
            "2",
            "--out",
            "out.npz",
            "--overwrite",
        ]
    ),
    "kinarm-eval": _evaluate,
    "kinarm-problem": lambda: problem.main(
        [
            "check",
            "right",
            "--trials",
            "2",
            "--picture",
            "out.png",
            "--json",
            "out.json",
            "--overwrite",
        ]
    ),
    "kinarm-replay": lambda: replay.main(
        [
            "--policy",
            "ars-tuned-both",
            "--trials",
            "1",
            "--no-oracle",
            "--out",
            "out.html",
            "--record",
            "out.npz",
            "--overwrite",
        ]
    ),
    "kinarm-arms": lambda: arms.main(["show", "paper", "--out", "out.html", "--overwrite"]),
    "training of a reproduction": _saving(samples.save_training),
    "training of a comparison": _saving(samples.save_comparison),
}
"""What writes files into the current folder, and ends as commands do."""


def run_writer(write: Callable[[], object]) -> tuple[int, str]:
    """Run a command; returns its status and what it said on standard error."""
    err = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(err):
        try:
            write()
        except SystemExit as end:
            return int(end.code or 0), err.getvalue()
    raise AssertionError("a command that does not end")


def contents(folder: Path) -> dict[str, bytes]:
    """Files of a folder, by their paths in it."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


class WriteJudge:
    """Lets the writes of a command fail, and says what is wrong with what is left.

    Parameters
    ----------
    name : str
        The command.
    folder : Path
        For its files.
    """

    def __init__(self, name: str, folder: Path) -> None:
        self._writer, self._folder = WRITERS[name], folder / "work"
        os.environ[CACHE_VARIABLE] = str(folder / "cache")
        self._fresh()
        with inside(self._folder):
            run_writer(self._writer)  # fills the caches
        self._fresh()
        with inside(self._folder), failing(self._folder) as points:
            status, said = run_writer(self._writer)
        if status:
            raise RuntimeError(said)
        self.points = points.passed
        self.made = contents(self._folder)

    def _fresh(self, files: Mapping[str, bytes] | None = None) -> None:
        """Empty the folder, or fill it with older files."""
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir()
        for name, content in (files or {}).items():
            path = self._folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

    def __call__(self, number: int) -> Verdict:
        """Let the call of a number fail, in one way after the other, beside older files or not."""
        turn, point = divmod(number, self.points)
        turn, kind = divmod(turn, len(FAULTS))
        old = dict.fromkeys(self.made, b"old") if turn % 2 else {}
        self._fresh(old)
        with inside(self._folder), failing(self._folder, point, FAULTS[kind]):
            try:
                status, said = run_writer(self._writer)
            except BaseException as error:
                return Verdict(False, f"{type(error).__name__} at {place_of(error)}", 0)
        return Verdict(status == 0, self._finding(status, said, old), 0)

    def _finding(self, status: int, said: str, old: Mapping[str, bytes]) -> str:
        """What is wrong; empty if nothing is."""
        if status not in STATUSES or "Traceback" in said:
            return f"status {status}: {said[-80:]!r}"
        if status and not said.splitlines()[-1].startswith("kinarm-"):
            return f"says {said.splitlines()[-1][:80]!r}"
        for name, content in contents(self._folder).items():
            if name.endswith((".part", ".lock")):
                return f"leaves {Path(name).suffix} behind"
            half = len(content) < 0.5 * len(self.made.get(name, b""))
            if half and content != old.get(name):
                return f"leaves half of {Path(name).suffix}"
        return ""


def make_try(name: str, folder: Path) -> Try:
    """Prepare this process for a command."""
    return WriteJudge(name, folder)


def main() -> int:
    """Run the campaign."""
    given = options("Every write of every command fails once.", LARGE).parse_args()
    return campaign({name: partial(make_try, name) for name in WRITERS}, given, "writes")


if __name__ == "__main__":
    sys.exit(main() > 0)
