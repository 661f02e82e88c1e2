"""Where commands run: odd locales, no home, nothing to write to, little memory, company."""

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from .command_lines import STATUSES

ROOT = Path(__file__).parents[2]

TRAIN = (
    *("kinarm.policies.train", "ars", "--iterations", "2", "--directions", "2"),
    *("--top-directions", "1", "--horizon", "2", "--out", "é/out.npz", "--overwrite"),
)
COMMANDS: Mapping[str, Sequence[str]] = {
    "arms": ("kinarm.evaluation.commands.arms", "show", "paper"),
    "problem": ("kinarm.evaluation.commands.problem", "show", "right"),
    "train": TRAIN,
    "replay": ("kinarm.evaluation.commands.replay", "--policy", "gone/é[/o].npz"),
}
"""Commands, the last of which is refused."""


class Surroundings(NamedTuple):
    """Where a command runs.

    Attributes
    ----------
    environment : mapping
        Variables that are set, or removed if they are None.
    memory : int
        Address space at most [bytes]; no limit if it is 0.
    file_size : int
        Size of files at most [bytes]; no limit if it is negative.
    """

    environment: Mapping[str, str | None] = {}
    memory: int = 0
    file_size: int = -1

    def enter(self) -> None:
        """Limit this process, which runs a command then."""
        if self.memory:
            resource.setrlimit(resource.RLIMIT_AS, (self.memory, self.memory))
        if self.file_size >= 0:
            resource.setrlimit(resource.RLIMIT_FSIZE, (self.file_size, self.file_size))


NOWHERE = "/proc/none"
"""Where nobody can write."""

PLACES: dict[str, Surroundings] = {
    "locale C": Surroundings({"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}),
    "ASCII streams": Surroundings({"PYTHONIOENCODING": "ascii"}),
    "Turkish locale": Surroundings({"LC_ALL": "tr_TR.UTF-8", "LANG": "tr_TR"}),
    "no such locale": Surroundings({"LC_ALL": "xx_XX.nothing"}),
    "no home": Surroundings({"HOME": None, "XDG_CACHE_HOME": None, "KINARM_CACHE": None}),
    "home is missing": Surroundings({"HOME": NOWHERE, "KINARM_CACHE": None}),
    "caches cannot be written": Surroundings(
        {"KINARM_CACHE": NOWHERE, "NUMBA_CACHE_DIR": NOWHERE, "XDG_CACHE_HOME": NOWHERE}
    ),
    "no terminal": Surroundings({"TERM": "dumb", "COLUMNS": "0", "LINES": "x"}),
    "files of 100 bytes": Surroundings(file_size=100),
    "no files": Surroundings(file_size=0),
    "700 MB": Surroundings(memory=700 * 10**6),
    "1500 MB": Surroundings(memory=1500 * 10**6),
}


def run_in(place: str, command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a place, with a folder as the current one."""
    surroundings = PLACES[place]
    merged: dict[str, str | None] = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "OPENBLAS_NUM_THREADS": "1",
        **surroundings.environment,
    }
    return subprocess.run(
        [sys.executable, "-m", *COMMANDS[command]],
        cwd=folder,
        env={name: value for name, value in merged.items() if value is not None},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=600,
        check=False,
        preexec_fn=surroundings.enter,
    )


def unfit_answer(done: subprocess.CompletedProcess[str]) -> str:
    """What is wrong with how a command ended; empty if nothing is."""
    if done.returncode not in STATUSES:
        return f"status {done.returncode}: {done.stderr[-300:]}"
    if "Traceback" in done.stderr:
        return f"a traceback: {done.stderr[-300:]}"
    if done.returncode and not done.stderr.splitlines()[-1].startswith("kinarm-"):
        return f"says {done.stderr.splitlines()[-1][:200]!r}"
    return ""


def half_written(folder: Path, made: Callable[[str], bool] = lambda _: False) -> list[str]:
    """What a command left in a folder that is no result; ``made`` names what is."""
    files = [path.name for path in folder.rglob("*") if path.is_file()]
    return [name for name in files if name.endswith((".part", ".lock")) and not made(name)]
