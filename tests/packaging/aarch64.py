"""Compute on an emulated AArch64 what this machine computes, and compare all bits.

``python tests/packaging/aarch64.py`` runs the golden digests of all bits (trials, rollouts, ARS,
PPO and the oracle), inverse kinematics, a plan and an evaluation here and in qemu's emulation of a
process, with Debian's Python and the wheels of the pinned libraries for AArch64. Then it resolves
the wheels for macOS on Apple silicon, which nothing here can run. It needs Debian 12, the program
``qemu-aarch64-static`` (of the package ``qemu-user-static``) and the network, but neither root nor
a container. What it downloads and compiles stays in a folder, by default
``~/.cache/kinarm-aarch64``. ``make aarch64`` does it.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

PYTHON = f"python3.{sys.version_info.minor}"
PACKAGES = f"""
{PYTHON} {PYTHON}-minimal lib{PYTHON}-stdlib lib{PYTHON}-minimal libc6 libstdc++6 libgcc-s1 zlib1g
libssl3 libffi8 libbz2-1.0 liblzma5 libsqlite3-0 libexpat1 libuuid1 libtinfo6 libncursesw6
libreadline8 libcrypt1 libgomp1
"""
"""What Python needs of Debian."""

LINUX = [f"manylinux_2_{minor}_aarch64" for minor in (28, 27, 26, 24, 17)] + [
    "manylinux2014_aarch64"
]
MACOS = ["macosx_14_0_arm64"]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")

EVALUATE = "kinarm-eval --policy ppo-best-both ars-linear-both --problem both --shield --json"
COMPUTE = f"""
import contextlib, io, json, sys
sys.argv = ["digests.py", "--bits"]
import digests
from computed_bits import usual_bits
from kinarm.evaluation.commands import evaluate

for part in ("trial", "oracle", "rollout", "ars", "ppo"):
    for name, found in getattr(digests, part + "_digests")().items():
        print(json.dumps([name, found]), flush=True)
for number, found in enumerate(usual_bits()):
    print(json.dumps([f"part {{number}} of tests/helpers/computed_bits.py", found]), flush=True)
sys.argv = {EVALUATE.split()}
with contextlib.redirect_stdout(io.StringIO()) as said:
    evaluate.main()
for row in json.loads(said.getvalue())["results"]:
    print(json.dumps([f"evaluation of {{row['policy']}}", row]), flush=True)
"""
"""Prints the name and the bits of one result a line."""


def system(folder: Path) -> Path:
    """The root of a Debian for AArch64 with Python, through a state of apt's own."""
    root, state, packages = folder / "root", folder / "apt", folder / "packages"
    if root.exists():
        return root
    for each in (state / "lists" / "partial", state / "archives" / "partial", packages):
        each.mkdir(parents=True, exist_ok=True)
    (state / "status").touch()
    settings = {
        "APT::Architecture": "arm64",
        "APT::Architectures::": "arm64",
        "APT::Sandbox::User": "root",
        "Dir::State": state,
        "Dir::State::status": state / "status",
        "Dir::Cache": state,
    }
    apt = ["apt-get", "-qq", *(f"-o{name}={value}" for name, value in settings.items())]
    subprocess.run([*apt, "update"], check=True)
    subprocess.run([*apt, "download", *PACKAGES.split()], check=True, cwd=packages)
    for package in sorted(packages.glob("*.deb")):
        subprocess.run(["dpkg", "--extract", package, folder / "part"], check=True)
    return (folder / "part").rename(root)


def wheels(platforms: list[str], python: str, *options: object) -> None:
    """Let pip resolve the pinned libraries of kinarm for another platform, from wheels alone."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install"]
    chosen = [word for each in platforms for word in ("--platform", each)]
    chosen += ["--only-binary=:all:", "--python-version", python, "--ignore-installed"]
    pinned = ["--constraint", ROOT / "constraints.txt"]
    subprocess.run([*pip, *chosen, *pinned, *options, *project["dependencies"]], check=True)


def libraries(folder: Path) -> Path:
    """The libraries for AArch64."""
    found = folder / "libraries"
    if not found.exists():
        wheels(LINUX, PYTHON.removeprefix("python"), "--no-compile", "--target", folder / "some")
        (folder / "some").rename(found)
    return found


def results(command: list[object], path: list[Path], **variables: object) -> dict[str, object]:
    """What a Python computes, by name."""
    paths = [ROOT, ROOT / "tests" / "golden", ROOT / "tests" / "helpers", *path]
    environment = {"PYTHONPATH": os.pathsep.join(map(str, paths)), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {name: str(value) for name, value in variables.items()}
    run = [str(word) for word in (*command, "-c", COMPUTE)]
    found, begun = {}, time.monotonic()
    with subprocess.Popen(
        run, env=os.environ | environment, stdout=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout or ():
            name, result = json.loads(line)
            found[name] = result
            sys.stderr.write(f"\r{time.monotonic() - begun:6.0f} s  {name:<60}")
    sys.stderr.write("\n")
    if process.returncode:
        raise SystemExit(f"{command[0]} ended with status {process.returncode}")
    return found


def main(folder: Path) -> int:
    """Compare; 1 if something differs."""
    folder.mkdir(parents=True, exist_ok=True)
    emulator = shutil.which("qemu-aarch64-static")
    if emulator is None:
        raise SystemExit("qemu-aarch64-static is missing: apt-get install qemu-user-static")
    here = results([sys.executable, "-P"], [], KINARM_CACHE=folder / "bounds-here")
    root, site = system(folder), libraries(folder)
    there = results(
        [emulator, "-L", root, root / "usr" / "bin" / PYTHON],
        [site, site / "cmeel.prefix" / "lib" / PYTHON / "site-packages"],
        KINARM_CACHE=folder / "bounds",
        NUMBA_CACHE_DIR=folder / "compiled",
    )
    told = compared(here, there)
    sys.stdout.write("\n".join([*told, f"{len(here) - len(told)} of {len(here)} have equal bits"]))
    for python in PYTHONS:
        wheels(MACOS, python, "--dry-run", "--target", folder / "none")
        sys.stdout.write(f"\nmacOS, Apple silicon, Python {python}: all libraries have wheels")
    sys.stdout.write("\n")
    return bool(told)


def compared(here: Mapping[str, object], there: Mapping[str, object]) -> list[str]:
    """One line for each result that differs."""
    return [f"{name}: OTHER BITS" for name, found in here.items() if there.get(name) != found]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path.home() / ".cache" / "kinarm-aarch64")
    sys.exit(main(parser.parse_args().folder.absolute()))
