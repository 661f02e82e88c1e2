"""Commands as processes of their own, and what they leave behind."""

import json
import os
import shlex
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

MODULES = {
    "kinarm-arms": "kinarm.evaluation.commands.arms",
    "kinarm-bench": "kinarm.evaluation.commands.bench",
    "kinarm-compare": "kinarm.evaluation.commands.compare",
    "kinarm-eval": "kinarm.evaluation.commands.evaluate",
    "kinarm-problem": "kinarm.evaluation.commands.problem",
    "kinarm-replay": "kinarm.evaluation.commands.replay",
    "kinarm-reproduce": "kinarm.evaluation.commands.reproduce",
    "kinarm-study": "kinarm.evaluation.commands.study",
    "kinarm-train": "kinarm.policies.train",
}

PATIENCE = 300.0
"""Time after which a process counts as hanging [s]; the machine may be busy."""

FOREIGN = "torchinductor_"
"""What the name of PyTorch's cache begins with, of which there is one a user."""

CLOCKS = ("seconds", "processor_seconds", "wall_time")


class Subject(NamedTuple):
    """A command line to be disturbed.

    Attributes
    ----------
    program : str
        Name of the command.
    arguments : tuple of str
        What follows it; ``{port}`` is replaced by a free one.
    seconds : float
        Signals come within this time; in any case before it would end.
    """

    program: str
    arguments: tuple[str, ...]
    seconds: float = 8.0

    def spelled(self, *, as_module: bool) -> list[str]:
        """The command line: by its script, or by ``python -m``."""
        script = Path(sysconfig.get_path("scripts")) / self.program
        module = [sys.executable, "-m", MODULES[self.program]]
        return [*(module if as_module else [str(script)]), *self.arguments]


STUDY = str(Path(__file__).with_name("study.toml"))
TRAINING = ("--directions", "2", "--top-directions", "2", "--iterations", "2000")
SMALL_PPO = ("--n-envs", "8", "--n-steps", "50", "--batch-size", "50", "--iterations", "200")

SUBJECTS: dict[str, Subject] = {
    "arms": Subject("kinarm-arms", ("show", "paper", "--out", "arm.html")),
    "bench": Subject("kinarm-bench", ("--repetitions", "1", "--out", "speed")),
    "compare": Subject(
        "kinarm-compare",
        (
            *("--learners", "ars-paper", "ars-tuned", "--problems", "right", "--steps", "20000"),
            *("--trials", "50", "--seeds", "2", "--jobs", "2", "--out", "out"),
        ),
        12.0,
    ),
    "eval": Subject(
        "kinarm-eval",
        ("--policy", "ars-tuned-both", "--problem", "right", "--report", "out"),
    ),
    "eval, printed": Subject("kinarm-eval", ("--trials", "50", "--problem", "left")),
    "problem": Subject(
        "kinarm-problem",
        ("check", "right", "--trials", "20", "--picture", "p.png", "--json", "p.json"),
    ),
    "replay": Subject(
        "kinarm-replay",
        ("--policy", "ars-tuned-both", "--trials", "3", "--out", "r.html", "--record", "r.npz"),
    ),
    "replay, live": Subject(
        "kinarm-replay",
        ("--policy", "zero", "--problem", "left", "--live", "--no-browser", "--port", "7500"),
    ),
    "reproduce": Subject(
        "kinarm-reproduce", ("--quick", "--no-ppo", "--jobs", "2", "--out", "out"), 15.0
    ),
    "study": Subject("kinarm-study", (STUDY, "--jobs", "2", "--out", "out"), 12.0),
    "train, ars": Subject("kinarm-train", ("ars", "--out", "p.npz", *TRAINING)),
    "train, ppo": Subject("kinarm-train", ("ppo", "--out", "p.npz", *SMALL_PPO), 12.0),
}


class Ended(NamedTuple):
    """How a process ended: its status, what it said, and after how long [s]."""

    status: int | None
    err: str
    seconds: float


@contextmanager
def started(words: list[str], folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A process with its own session, temporary folder and terminal-like signals; none is left."""
    temporary = folder / "tmp"
    temporary.mkdir(exist_ok=True)
    with (folder / "err").open("wb") as err:
        process = subprocess.Popen(
            words,
            cwd=folder,
            env={**os.environ, "TMPDIR": str(temporary), "COLUMNS": "100"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=err,
            start_new_session=True,
            preexec_fn=_have_default_signals,
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for other in session(process.pid):
            os.kill(other, signal.SIGKILL)


def _have_default_signals() -> None:
    """A background job may have inherited that signals are ignored."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def end_of(process: subprocess.Popen[bytes], folder: Path, began: float) -> Ended:
    """Wait for a process; its status is None if it hangs."""
    try:
        status: int | None = process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        status = None
    return Ended(status, (folder / "err").read_text(errors="replace"), time.monotonic() - began)


def session(leader: int) -> list[int]:
    """Processes of a session that still run."""
    members = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == leader and fields[0] not in "ZX":
            members.append(int(status.parent.name))
    return members


def left_behind(leader: int, folder: Path) -> list[str]:
    """What a command should have taken along: processes, half-written files, locks, memory."""
    deadline = time.monotonic() + PATIENCE
    while session(leader) and time.monotonic() < deadline:
        time.sleep(0.05)
    left = ["a process"] if session(leader) else []
    names = [path.relative_to(folder) for path in folder.rglob("*")]
    left += [f"{name.suffix} file" for name in names if name.suffix in (".part", ".lock")]
    temporary = [name.parts[1] for name in names if name.parts[0] == "tmp" and len(name.parts) > 1]
    left += ["a temporary file" for name in temporary if not name.startswith(FOREIGN)]
    left += ["shared memory" for _ in Path("/dev/shm").glob(f"*[-_]{leader}[-_]*")]
    return left


def results(folder: Path) -> dict[str, bytes]:
    """What a command made, but for the clock: contents of files by name."""
    made = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and "timing" not in name and name != "err":
            made[name] = READERS.get(path.suffix, Path.read_bytes)(path)
    return made


def _arrays(path: Path) -> bytes:
    """The arrays of an archive; headers tell of times."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files if name != "header"}
    return b"".join(name.encode() + array.tobytes() for name, array in sorted(arrays.items()))


def _document(path: Path) -> bytes:
    return json.dumps(_timeless(json.loads(path.read_text())), sort_keys=True).encode()


def _timeless(value: Any) -> Any:
    """A document without what clocks said."""
    if isinstance(value, dict):
        return {name: _timeless(each) for name, each in value.items() if name not in CLOCKS}
    return [_timeless(each) for each in value] if isinstance(value, list) else value


def _curve(path: Path) -> bytes:
    """A table without its last column, which is the time for learning curves."""
    return "\n".join(line.rpartition(",")[0] for line in path.read_text().splitlines()).encode()


READERS: Mapping[str, Callable[[Path], bytes]] = {
    ".npz": _arrays,
    ".json": _document,
    ".csv": _curve,
}


@contextmanager
def own_cache() -> Iterator[Path]:
    """A cache of the campaign's own."""
    with TemporaryDirectory() as folder, mock.patch.dict(os.environ, KINARM_CACHE=folder):
        yield Path(folder)


def write(
    path: Path | None, module: str, counts: dict[str, int], findings: int, parts: dict[str, Any]
) -> None:
    """Write the record of a campaign, with the command that made it; or print it."""
    command = shlex.join(["python", "-m", f"tests.campaign.{module}", *sys.argv[1:]])
    document = {"command": command, **counts, "findings": findings, "parts": parts}
    text = json.dumps(document, indent=1) + "\n"
    if path is None:
        sys.stdout.write(text)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
