"""Test every extra with the oldest libraries that ``pyproject.toml`` allows.

``python tests/packaging/oldest_extras.py ppo render`` makes an environment for each of these
extras, by default for all in `TESTS`, and runs the tests of what it brings. Needs the network; the
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

TESTS = {
    "ppo": (
        *("policies/ppo", "policies/sb3", "policies/test_conversion_sb3.py"),
        *("policies/test_conversion_torch.py", "commands/test_train_ppo.py"),
    ),
    "render": ("kinarm/envs/test_rendering.py",),
    "robots": ("kinarm/test_mesh_files.py", "kinarm/test_known_arms.py"),
    "slurm": ("evaluation/running/test_slurm.py", "evaluation/studies/test_study_elsewhere.py"),
    "study": ("evaluation/studies/test_study_output.py",),
    "tune": ("evaluation/studies/test_search.py",),
}
"""What is tested of an extra, below ``tests``."""


def oldest(*extras: str) -> Iterator[str]:
    """The lowest versions that the package itself allows, or some of its extras if they say so."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lists = (project["dependencies"], *(project["optional-dependencies"][each] for each in extras))
    lowest = dict(line.partition(",")[0].split(">=") for lines in lists for line in lines)
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
    options = ("-q", "-rs", "--tb=line", "--disable-warnings", "-W", "default")
    tests = (f"tests/{each}" for each in TESTS[extra])
    return subprocess.run([*python, "pytest", *options, *tests], cwd=ROOT).returncode == 0


def main(extras: list[str]) -> None:
    """Try some extras, one after the other."""
    found = {}
    for extra in extras or TESTS:
        with tempfile.TemporaryDirectory() as name:
            found[extra] = try_extra(extra, Path(name))
    for extra, passed in found.items():
        sys.stdout.write(f"{extra}: {'ok' if passed else 'FAILED'}\n")
    sys.exit(not all(found.values()))


if __name__ == "__main__":
    main(sys.argv[1:])
