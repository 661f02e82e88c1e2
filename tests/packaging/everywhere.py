"""Build what is committed and use it away from the clone, with several Pythons.

``python tests/packaging/everywhere.py python3.11 python3.12 python3.13`` checks the sdist and the
wheel, installs both with the pinned libraries, and with the first Python also with the oldest
libraries that ``pyproject.toml`` allows. All of them have to come to the same results, to the bit.
Needs the network, ``build`` and ``twine``; ``make package`` installs these.
"""

import json
import os
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

COMMANDS = """
kinarm-train ars --problem right --iterations 3 --out mine.npz
kinarm-train ars --problem right --iterations 3 --seeds 2 --jobs 2 --out seeds
kinarm-replay --policy mine.npz --trials 1 --out replay.html
kinarm-eval --policy mine.npz --policy ars-tuned-both-seed0 --trials 20 --json
"""
"""What is tried in an empty folder; the last one's results are compared."""


def call(*words: object, **settings: object) -> str:
    """Run a command and return what it printed."""
    return subprocess.run(
        [str(word) for word in words], check=True, text=True, stdout=subprocess.PIPE, **settings
    ).stdout


def lowest() -> Iterator[str]:
    """The oldest version of each library, as constraints of pip."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return (each.replace(">=", "==") for each in project["dependencies"])


def installed(python: str, folder: Path, constraints: Path, wheel: Path) -> Path:
    """Install a wheel into a new environment; where its commands are."""
    call(python, "-m", "venv", folder)
    pip = (folder / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "--quiet")
    call(*pip, "install", "--constraint", constraints, wheel)
    return folder / "bin"


def results(commands: Path) -> object:
    """What the commands come to in an empty folder, without any cache."""
    with tempfile.TemporaryDirectory() as name:
        environment = {**os.environ, "KINARM_CACHE": f"{name}/cache", "PATH": f"{commands}:/bin"}
        for line in COMMANDS.strip().splitlines():
            said = call(*line.split(), cwd=name, env=environment, stderr=subprocess.DEVNULL)
        return [row["outcomes"] for row in json.loads(said)["results"]]


def main(pythons: list[str]) -> None:
    """Check, install and use what is published."""
    with tempfile.TemporaryDirectory() as name:
        folder, source = Path(name), Path(name) / "source"
        call("git", "-C", ROOT, "archive", "--output", folder / "source.tar", "HEAD")
        with tarfile.open(folder / "source.tar") as archive:
            archive.extractall(source, filter="data")
        call(sys.executable, "-m", "build", "--outdir", folder, source)
        (sdist,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
        call(sys.executable, "-m", "twine", "check", "--strict", sdist, wheel)
        pinned, oldest = ROOT / "constraints.txt", folder / "lowest.txt"
        oldest.write_text("\n".join(lowest()))
        found = {}
        for number, python in enumerate(pythons):
            commands = installed(python, folder / f"pinned-{number}", pinned, wheel)
            found[python, "wheel"] = results(commands)
            again = (commands / "python", "-m", "pip", "install", "--quiet", "--force-reinstall")
            call(*again, "--no-deps", sdist)
            found[python, "sdist"] = results(commands)
        commands = installed(pythons[0], folder / "oldest", oldest, wheel)
        found[pythons[0], "wheel, oldest libraries"] = results(commands)
    first = next(iter(found.values()))
    for (python, what), result in found.items():
        sys.stdout.write(f"{python}, {what}: {'ok' if result == first else 'OTHER RESULTS'}\n")
    sys.exit(any(result != first for result in found.values()))


if __name__ == "__main__":
    main(sys.argv[1:])
