"""Code and commands of README and pages run as they are written, or the exceptions say why not.

Blocks that are told to ``run`` do so when the site is built, those with a name in tests of their
own, and the README's Python in ``tests/test_readme.py``.
"""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest
from pages import ROOT, Block, blocks, pages

PROGRAMS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]

EXCEPTIONS = {
    r"make ": "does what .ci/run does; that the targets exist is tested beside the README",
    r"kinarm-eval --trials 200( --markdown)?$": "make eval does it",
    r"pip install": "changes the installation",
    r"pip download|tar -x|kinarm-problem import .*ur5": "needs a download; tests/kinarm",
    r"\. \.venv/bin/activate": "changes the shell; docs/measurements/first_steps.py",
    r"python -m tests\.campaign": "takes hours; tests/campaign runs a share of each",
    r"python -m docs\.measurements": "measures for minutes; tests/docs/test_measurements.py",
    r"python tests/instructions": "records anew; tests/instructions compares",
    r"python -m rl_zoo3\.(record_video|cli)": "needs a training; rl-zoo3's own films and plots",
    r"kinarm-bench": "measures for minutes; tests/commands/test_bench_command.py",
    r"kinarm-reproduce|.*ReproductionRequest": "trains for half an hour; tests/commands",
    r"kinarm-study .*--(ray|slurm)": "needs a cluster; tests/evaluation/experiments",
    r"kinarm-study (learners|policies|\w+_factors|search)": "trains for hours; tests/frozen",
    r"kinarm-train .*search/best": "needs what that search found",
    r"kinarm-eval .*model\.zip": "needs such a model; tests/docs/test_policies.py",
}
"""Commands and blocks of Python that are not run here, by how they begin, and why."""

SHORTER = {
    r"kinarm-train ppo .*--recipe best .*--seeds": (
        "--iterations 1 --n-envs 8 --batch-size 64 --seeds 1"
    ),
    r"kinarm-train ppo": "--iterations 1 --n-envs 8 --batch-size 64",
    r"kinarm-train ars .*--seeds": "--iterations 2 --jobs 1",
    r"kinarm-train ": "--iterations 2",
    r"kinarm-eval (?!.*--trials \d{1,2}\b)": "--trials 8",
    r"kinarm-replay .*--failures": "--trials 2000",
    r"kinarm-study \S+\.toml": "--jobs 1",
}
"""What is added to commands that take long, by how they begin: the last option counts."""

NEEDS = {
    r"kinarm-train ppo|.*stable_baselines3": "stable_baselines3",
    r".*\b(ur5|panda|xarm7|so101)\b": "trimesh",
}
"""What commands and Python need of the extras, by what is in them."""

REPLACES = re.compile(r"kinarm-(train|eval|replay)")
"""Commands that show what can be done, one after the other, to the same files."""

FEWER = re.compile(r"^(iterations|count|seeds) = \d+$", re.M)
"""Settings of files that make trainings long."""

LEARN = re.compile(r"(\.learn\(\s*)[\d_]+")
"""Trainings of Stable-Baselines3, and how many steps they take."""

FURNITURE = {
    **dict.fromkeys(("my_arm.urdf", "my_robot.urdf"), "data/arms/paper.urdf"),
    **dict.fromkeys(("right.npz", "mine.npz"), "data/policies/ars-tuned-both-seed0.npz"),
    "my_policy.npz": "data/policies/ars-tuned-both-seed0.npz",
    "right/ars-tuned-right-seed1.npz": "data/policies/ars-tuned-both-seed1.npz",
}
WRITTEN = {
    "my_problem.toml": 'base = "left"',
    "steps.toml": 'problems = ["right"]\nseeds = 1\n[trials]\ncount = 4\n[fixed]\niterations = 1',
}
"""What the reader of a page has at hand: copies of files, and files of some lines."""


def plain_blocks(path: Path) -> list[Block]:
    """Blocks of a page that nothing else runs."""
    return [
        block
        for block in blocks(path)
        if (block.language in ("python", "sh") or block.file)
        and not block.told
        and (path.name, block.language) != ("README.md", "python")
    ]


PAGES = {name: path for name, path in pages().items() if plain_blocks(path)}


def commands(code: str) -> list[str]:
    """Command lines of a block, without comments."""
    lines = code.replace("\\\n", " ").splitlines()
    return [line.split(" #")[0].strip() for line in lines if not line.startswith("#")]


def run_command(command: str) -> None:
    """Run a command line of kinarm in this process, another one in a shell."""
    command, _, file = command.partition(" > ")
    program, *arguments = shlex.split(command)
    if program not in PROGRAMS or program == "kinarm":  # which starts processes of its own
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        subprocess.run(["sh", "-c", command], check=True, env={**os.environ, "PATH": path})
        return
    module, function = PROGRAMS[program].split(":")
    arguments += next(
        (more for start, more in SHORTER.items() if re.match(start, command)), ""
    ).split()
    if REPLACES.match(program):
        arguments.append("--overwrite")
    said = io.StringIO()
    with contextlib.redirect_stdout(said), pytest.raises(SystemExit) as end:
        getattr(import_module(module), function)(arguments)
    if file:
        Path(file).write_text(said.getvalue())
    assert end.value.code in (0, None), command


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a reader works, who opens no browser."""
    for name, source in FURNITURE.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / source, tmp_path / name)
    for name, text in WRITTEN.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BROWSER", "true")
    return tmp_path


def is_exception(code: str) -> bool:
    return any(re.match(start, code, re.DOTALL) for start in EXCEPTIONS)


def skip_without_what_is_needed(code: str) -> None:
    for pattern, module in NEEDS.items():
        if re.match(pattern, code, re.DOTALL):
            pytest.importorskip(module)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_a_page_does_what_it_says(name: str, folder: Path) -> None:
    names: dict[str, object] = {"__name__": "__main__"}
    for block in plain_blocks(PAGES[name]):
        if block.file:
            (folder / block.file).write_text(FEWER.sub(r"\1 = 1", block.code))
        elif block.language == "python":
            if not is_exception(block.code):
                skip_without_what_is_needed(block.code)
                exec(compile(LEARN.sub(r"\g<1>512", block.code), name, "exec"), names)
        else:
            for command in filter(None, commands(block.code)):
                if not is_exception(command):
                    skip_without_what_is_needed(command)
                    run_command(command)


def test_exceptions_are_of_commands_that_pages_show() -> None:
    shown = [
        command
        for path in pages().values()
        for block in blocks(path)
        for command in ([block.code] if block.language == "python" else commands(block.code))
    ]
    idle = [
        each for each in EXCEPTIONS if not any(re.match(each, line, re.DOTALL) for line in shown)
    ]
    assert idle == []


def test_every_block_is_run_or_saved_or_comes_from_elsewhere() -> None:
    every = [block for path in pages().values() for block in blocks(path)]
    assert {block.told for block in every} == {"", "run", "name", "code"}
    idle = {each.language for each in every if not (each.told or each.file)}
    assert idle == {"python", "sh", "text", "bibtex", "dockerfile"}


def test_blocks_with_a_name_are_run_by_a_test() -> None:
    tests = "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))
    named = [
        block.about for path in pages().values() for block in blocks(path) if block.told == "name"
    ]
    assert [name for name in named if name not in tests] == []
