"""Test every extra with the oldest libraries that ``pyproject.toml`` allows.

``python tests/packaging/oldest_extras.py sb3 render`` makes an environment for each of these
extras, by default for all in `EXTRAS`, and runs the tests that are not slow. Needs the network; the
oldest torch brings 3 GB of CUDA packages. ``everywhere.py`` does the same without extras, and
compares results.
"""

import subprocess
import sys
import tempfile
import tomllib
import venv
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

EXTRAS = (
    "export",
    "peers",
    "ray",
    "render",
    "robots",
    "sb3",
    "slurm",
    "study",
    "tune",
    "zoo",
)


def oldest(extra: str) -> Iterator[str]:
    """The lowest versions that the package itself and one of its extras allow."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]

    def bounds(lines: list[str]) -> Iterator[tuple[str, str]]:
        for line in lines:
            if line.startswith("kinarm["):
                for other in line.removeprefix("kinarm[").removesuffix("]").split(","):
                    yield from bounds(extras[other])
            else:
                name, _, version = line.partition(",")[0].partition(">=")
                yield name, version

    lowest = dict([*bounds(project["dependencies"]), *bounds(extras[extra])])
    return (f"{name}=={version}" for name, version in lowest.items())


def try_extra(extra: str, folder: Path) -> bool:
    """Whether the tests of an extra pass in an environment of its own."""
    constraints = folder / "oldest.txt"
    constraints.write_text("\n".join(oldest(extra)))
    venv.create(folder / "venv", with_pip=True)
    python = (folder / "venv" / "bin" / "python", "-m")
    install = (*python, "pip", "install", "-qq", "--disable-pip-version-check")
    wanted = (f"{ROOT}[{extra}]", "hypothesis", "jsonschema", "pytest", "setuptools")
    subprocess.run([*install, "--constraint", constraints, *wanted], check=True)
    # Old libraries warn of what is newer than they are.
    options = (
        "-q",
        "-m",
        "not slow and not rare",
        "--tb=line",
        "--disable-warnings",
        "-W",
        "default",
    )
    return subprocess.run([*python, "pytest", *options], cwd=ROOT).returncode == 0


def main(extras: list[str]) -> None:
    """Try some extras, one after the other."""
    found = {}
    for extra in extras or EXTRAS:
        with tempfile.TemporaryDirectory() as name:
            found[extra] = try_extra(extra, Path(name))
    for extra, passed in found.items():
        sys.stdout.write(f"{extra}: {'ok' if passed else 'FAILED'}\n")
    sys.exit(not all(found.values()))


if __name__ == "__main__":
    main(sys.argv[1:])
