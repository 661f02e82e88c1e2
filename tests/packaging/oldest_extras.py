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
    "peers": ("docs/test_measurements.py",),
    "ppo": (
        *("policies/ppo", "policies/sb3", "policies/test_conversion_sb3.py"),
        *("policies/test_conversion_torch.py", "commands/test_train_ppo.py"),
    ),
    "ray": ("evaluation/running/test_ray_cluster.py", "evaluation/studies/test_study_elsewhere.py"),
    "render": ("kinarm/envs/test_rendering.py",),
    "robots": ("kinarm/test_mesh_files.py", "kinarm/test_known_arms.py"),
    "slurm": ("evaluation/running/test_slurm.py", "evaluation/studies/test_study_elsewhere.py"),
    "study": ("evaluation/studies/test_study_output.py",),
    "tune": ("evaluation/studies/test_search.py",),
    "zoo": ("interop/test_rl_zoo.py",),
}
"""What is tested of an extra, below ``tests``."""


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
