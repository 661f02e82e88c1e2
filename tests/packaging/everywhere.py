"""Build what is committed and use it away from the clone, with several Pythons.

``python tests/packaging/everywhere.py python3.11 python3.13 python3.14`` checks the sdist and the
wheel, installs both with the pinned libraries, and with the first Python also with the oldest
libraries that ``pyproject.toml`` allows. All of them have to come to the same results, to the bit.
Needs the network, ``build`` and ``twine``; ``make package`` installs these.

``python tests/packaging/everywhere.py --extras sb3 render`` runs the tests that are not slow with
each of these extras and the oldest libraries; by default with all in `EXTRAS`. The oldest torch
brings 3 GB of CUDA packages.
"""

import argparse
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

EXTRAS = (
    "export",
    "peers",
    "ray",
    "render",
    "robots",
    "sb3",
    "slurm",
    "tune",
    "zoo",
)


def call(*words: object, **settings: object) -> str:
    """Run a command and return what it printed."""
    return subprocess.run(
        [str(word) for word in words], check=True, text=True, stdout=subprocess.PIPE, **settings
    ).stdout


def lowest(extra: str = "") -> str:
    """The oldest version of each library, also of those of an extra, as constraints of pip."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {"": [], **project["optional-dependencies"]}

    def bounds(lines: list[str]) -> Iterator[tuple[str, str]]:
        for line in lines:
            if line.startswith("kinarm["):
                for other in line.removeprefix("kinarm[").removesuffix("]").split(","):
                    yield from bounds(extras[other])
            else:
                name, _, version = line.partition(",")[0].partition(">=")
                yield name, version

    found = dict([*bounds(project["dependencies"]), *bounds(extras[extra])])
    return "\n".join(f"{name}=={version}" for name, version in found.items())


def installed(python: str, folder: Path, constraints: Path, *wanted: object) -> Path:
    """Install packages into a new environment; where its commands are."""
    call(python, "-m", "venv", folder)
    pip = (folder / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "--quiet")
    call(*pip, "install", "--constraint", constraints, *wanted)
    return folder / "bin"


def results(commands: Path) -> object:
    """What the commands come to in an empty folder, without any cache."""
    with tempfile.TemporaryDirectory() as name:
        environment = {**os.environ, "KINARM_CACHE": f"{name}/cache", "PATH": f"{commands}:/bin"}
        for line in COMMANDS.strip().splitlines():
            said = call(*line.split(), cwd=name, env=environment, stderr=subprocess.DEVNULL)
        return [row["outcomes"] for row in json.loads(said)["results"]]


def passes(extra: str) -> bool:
    """Whether the tests pass with an extra in an environment of its own."""
    with tempfile.TemporaryDirectory() as name:
        constraints = Path(name) / "lowest.txt"
        constraints.write_text(lowest(extra))
        wanted = (f"{ROOT}[{extra}]", "hypothesis", "jsonschema", "pytest", "setuptools")
        commands = installed(sys.executable, Path(name) / "venv", constraints, *wanted)
        chosen = ("-q", "-m", "not slow and not rare", "--tb=line")
        warnings = ("--disable-warnings", "-W", "default")  # old libraries warn of newer ones
        test = [commands / "python", "-m", "pytest", *chosen, *warnings]
        return subprocess.run(test, cwd=ROOT).returncode == 0


def try_extras(extras: list[str]) -> None:
    """Test some extras, one after the other."""
    found = {extra: passes(extra) for extra in extras}
    for extra, passed in found.items():
        sys.stdout.write(f"{extra}: {'ok' if passed else 'FAILED'}\n")
    sys.exit(not all(found.values()))


def try_package(pythons: list[str]) -> None:
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
        oldest.write_text(lowest())
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
    parser = argparse.ArgumentParser()
    parser.add_argument("pythons", nargs="*")
    parser.add_argument("--extras", nargs="*", choices=EXTRAS)
    given = parser.parse_args()
    if given.extras is None:
        try_package(given.pythons)
    else:
        try_extras(given.extras or EXTRAS)
