"""``--help`` is complete, quick and works everywhere."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from kinarm.__main__ import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = {f"kinarm-{name}": module for name, (module, _) in COMMANDS.items()}
HEAVY = ("torch", "numba", "matplotlib", "pinocchio", "coal", "scipy", "stable_baselines3")

SHOW_HELP = f"""
import contextlib, importlib, io, sys
for program, module in {PROGRAMS!r}.items():
    with contextlib.redirect_stdout(io.StringIO()) as text:
        try:
            importlib.import_module(module).main(["--help"])
        except SystemExit as stopped:
            assert stopped.code == 0, stopped.code
    assert f"usage: {{program}}" in text.getvalue()
    loaded = [name for name in {HEAVY!r} if name in sys.modules]
    assert not loaded, (program, loaded)
"""


def test_help_loads_nothing_heavy():
    command = [sys.executable, "-c", SHOW_HELP]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "words",
    [
        *PROGRAMS,
        *("kinarm-problem list", "kinarm-problem show", "kinarm-problem check"),
        *("kinarm-problem import", "kinarm-arms list", "kinarm-arms show"),
        *(
            "kinarm-run check",
            "kinarm-study status",
            "kinarm-train ars",
            "kinarm-train ppo",
        ),
    ],
)
def test_help_fits_a_terminal(run, words, monkeypatch):
    """That it names every option is tested with the page of commands."""
    monkeypatch.setenv("COLUMNS", "80")
    answer = run(*words.split(), "--help")
    assert (answer.status, answer.err) == (0, "")
    assert [line for line in answer.out.splitlines() if len(line) > 80] == []


@pytest.mark.parametrize(
    ("words", "unbuffered"), [("--help", "1"), ("zero --task left --trials 1 --no-oracle", "")]
)
def test_a_closed_pipe_shows_no_error(command, words, unbuffered):
    with subprocess.Popen(
        command("kinarm-eval", *words.split()),
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == ""


AS_A_COMMAND = """
import sys
sys.argv[0], sys.orig_argv = "-m", ["python", "-m", "kinarm"]
import kinarm
assert "gymnasium" not in sys.modules
import kinarm.{module}
import gymnasium
gymnasium.make("kinarm/ReachRight-v0").reset(seed=0)
"""


@pytest.mark.parametrize("module", ["envs", "evaluation.bench"])
def test_what_makes_environments_in_a_command_has_their_ids(module):
    pytest.importorskip("stable_baselines3")
    code = AS_A_COMMAND.format(module=module)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
