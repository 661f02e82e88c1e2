"""Kills, signals and failing writes, at random moments of every kind of command.

``python -m tests.campaign.disturbances --out data/results/campaign/disturbances.json``. SIGKILL
loses nothing finished, an interrupted command ends with one line, and a write that fails leaves no
half file. Do not change sources meanwhile: what is compared names the commit that made it.
"""

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from .tally import Tally, main

PATIENCE = 300.0
"""Time after which a process counts as hanging [s]; the machine may be busy."""
KILLS = 3
"""How often a run is killed at most, before it may come to its end."""
STUDY = b"""
learner = "ars"
problem = "right"
seeds = 4

[trials]
count = 50

[fixed]
iterations = 400
directions = 4
top_directions = 2

[grid]
step_size = [0.02, 0.2]
"""
TRAIN = "kinarm-train ars --out p.npz --directions 4 --top-directions 2 --iterations 1500"
STUDIED = "kinarm-study study.toml --jobs 2 --out out"
EVALUATED = (
    "kinarm-eval --policy ars-tuned-both-seed0 --problem right --no-oracle --trials 20 --out out"
)
REPLAYED = "kinarm-replay --policy ars-tuned-both-seed0 --trials 3 --out r.html --record r.npz"
CHECKED = "kinarm-problem check right --trials 20"
SHOWN = "kinarm-arms show paper"
SHORT = TRAIN.replace("1500", "3")


@contextmanager
def started(command: str, folder: Path, size: int = -1) -> Iterator[subprocess.Popen[bytes]]:
    """A command in a session of its own, whose files have at most so many bytes; none is left."""
    program, *arguments = command.removeprefix("kinarm-").split()

    def prepare() -> None:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)  # a background job may ignore them
        if size >= 0:
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    (folder / "study.toml").write_bytes(STUDY)
    (folder / "tmp").mkdir(exist_ok=True)
    with subprocess.Popen(
        [sys.executable, "-m", "kinarm", program, *arguments],
        cwd=folder,
        env={**os.environ, "TMPDIR": str(folder / "tmp"), "COLUMNS": "100"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=prepare,
    ) as process:
        try:
            yield process
        finally:
            process.kill()
            for member in session(process.pid):
                os.kill(member, signal.SIGKILL)


def ended(process: subprocess.Popen[bytes]) -> tuple[int | None, str]:
    """Status of a process, None if it hangs, and what it said on standard error."""
    try:
        err = process.communicate(timeout=PATIENCE)[1].decode(errors="replace")
    except subprocess.TimeoutExpired:
        return None, ""
    return process.returncode, err


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


def leaves(process: subprocess.Popen[bytes], folder: Path, *suffixes: str) -> list[str]:
    """What a command should have taken along: processes, and files with some suffixes."""
    deadline = time.monotonic() + PATIENCE
    while (members := session(process.pid)) and time.monotonic() < deadline:
        time.sleep(0.05)
    files = [path.suffix for path in folder.rglob("*") if path.suffix in suffixes]
    return ["a process"] * bool(members) + files


def unfit(command: str, status: int | None, err: str, statuses: tuple[int, ...]) -> str:
    """What is wrong with how a command ended; empty if nothing is."""
    own = [line for line in err.splitlines() if line.startswith(f"{command.split()[0]}: ")]
    if status not in statuses:
        return f"status {status}"
    if "Traceback" in err or "Exception ignored" in err:
        return "a traceback"
    return "more than a line" if len(own) > 1 or (own and not err.endswith(f"{own[0]}\n")) else ""


def arrays(folder: Path) -> dict[str, bytes]:
    """What a training or a study made: arrays of archives, without what tells of times.

    These are headers, and where the trainings of a study ended.
    """
    made = {}
    for path in (each for each in folder.rglob("*.npz") if each.parent.name != "ends"):
        with np.load(path) as archive:
            for name in set(archive.files) - {"header"}:
                made[f"{path.relative_to(folder)} {name}"] = archive[name].tobytes()
    return made


def kill(command: str, count: int, seed: int, tally: Tally) -> None:
    """Kill a run up to `KILLS` times, let it go on to its end, and compare it with another.

    Trainings and studies go on by the same command.
    """
    rng = np.random.default_rng(seed)
    with TemporaryDirectory() as name:
        began = time.monotonic()
        with started(command, Path(name)) as process:
            assert ended(process)[0] == 0
        wanted, seconds = arrays(Path(name)), time.monotonic() - began
    for number in range(count):
        with TemporaryDirectory() as name:
            folder = Path(name)
            for last in (False,) * KILLS + (True,):
                with started(command + " --overwrite" * ("p.npz" in command), folder) as process:
                    if not last:
                        time.sleep(rng.uniform(0, 0.6 * seconds))
                        process.kill()
                        tally.count("kills")
                    elif (status := ended(process)[0]) != 0:
                        tally.find(f"status {status}", number=number)
                    for left in leaves(process, folder):
                        tally.find(f"leaves {left}", number=number)
            tally.count("ends")
            made = arrays(folder)
            if made != wanted:
                names = [key for key in {**wanted, **made} if wanted.get(key) != made.get(key)]
                tally.find("other results", number=number, names=names)


def interrupt(command: str, count: int, seed: int, tally: Tally) -> None:
    """Send a command up to three signals at a random moment: itself, or all of its processes."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        request = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[rng.choice(3, p=(0.8, 0.1, 0.1))]
        with TemporaryDirectory() as name, started(command, Path(name)) as process:
            time.sleep(rng.uniform(0.3, 8.0))
            for _ in range(int(rng.integers(1, 4))):
                if process.poll() is None:
                    (os.killpg if rng.integers(2) else os.kill)(process.pid, request)
                time.sleep(rng.choice([0.0, 0.01, 0.5]))
            status, err = ended(process)
            early = status == -request and "run_command" not in err  # the command had not begun
            tally.count({0: "finished", 130: "interrupted"}.get(status or 0, "early"))
            if found := "" if early else unfit(command, status, err, (0, 130)):
                tally.find(found, number=number, request=request.name, err=err[-2000:])
            for left in leaves(process, Path(name), ".part", ".lock"):
                tally.find(f"leaves {left}", number=number)


def limit(command: str, count: int, seed: int, tally: Tally) -> None:
    """Let writes fail behind some number of bytes: files are the old ones, complete, or missing."""
    rng = np.random.default_rng(seed)
    sizes: dict[str, int] = {}
    for number in range(-1, count):
        with TemporaryDirectory() as name:
            folder = Path(name)
            size = int(rng.integers(max(sizes.values()))) if number >= 0 else -1
            old = [folder / each for each in sizes if number % 2 and "/" not in each]
            for path in old:
                path.write_bytes(b"old")
            with started(command + " --overwrite" * bool(old), folder, size) as process:
                status, err = ended(process)
            made = {str(p.relative_to(folder)): p for p in folder.rglob("*") if p.is_file()}
            made = {key: p for key, p in made.items() if "tmp/" not in key and key != "study.toml"}
            if number < 0:
                assert status == 0, err
                sizes = {key: p.stat().st_size for key, p in made.items()}
                continue
            tally.count("finished" if status == 0 else "refused")
            if found := unfit(command, status, err, (0, 1, 2)):
                tally.find(found, number=number, err=err[-2000:])
            for key, path in made.items():
                half = path.stat().st_size < 0.8 * sizes.get(key, 0) and path.read_bytes() != b"old"
                if half or path.suffix in (".part", ".lock"):
                    tally.find("leaves half a file", number=number, file=key)


Disturb = Callable[[str, int, int, Tally], None]
WAYS: dict[Disturb, tuple[str, ...]] = {
    kill: (TRAIN, STUDIED),
    interrupt: (TRAIN, STUDIED, EVALUATED, REPLAYED, CHECKED, SHOWN),
    limit: (SHORT, EVALUATED, REPLAYED),
}
if __name__ == "__main__":
    subjects = {
        f"{disturb.__name__}: {' '.join(command.split()[:2])}": partial(disturb, command)
        for disturb, commands in WAYS.items()
        for command in commands
    }
    main("disturbances", subjects, 20)
