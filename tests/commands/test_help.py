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


def test_a_command_starts_without_gymnasium():
    program = [sys.executable, "-X", "importtime", "-m", "kinarm", "eval", "--help"]
    done = subprocess.run(program, capture_output=True, text=True, check=True)
    assert "kinarm._command_line" in done.stderr
    assert "gymnasium" not in done.stderr


TRAINING = (
    "--problem --arm --task --scene --tolerance --horizon --start-spread --seed --out --recipe "
    "--resume --overwrite --iterations --reward-success --no-symmetric"
)


@pytest.mark.parametrize(
    ("words", "options"),
    [
        (
            "kinarm-eval",
            "--problem --task --policy --trials --seed --arm --scene --tolerance --horizon "
            "--tool-frame --package-dir "
            "--start-spread --out --report --card --overwrite --json --matrix --allow-other-arm "
            "--no-oracle --markdown shelf-panda benches-ur5 kinova so101 shelf desk",
        ),
        (
            "kinarm-replay",
            "--policy --compare --problem --task --arm --trial --worst --collisions --trials "
            "--seed --allow-other-arm --no-oracle --out --record --overwrite --live --port "
            "--no-browser",
        ),
        ("kinarm-problem list", ""),
        ("kinarm-problem show", "--arm --tool-frame --package-dir --scene --task"),
        ("kinarm-problem check", "--arm --scene --trials --seed --picture --json --overwrite"),
        ("kinarm-problem import", "request --arm --position --rpy --out --overwrite"),
        ("kinarm-arms list", ""),
        ("kinarm-arms show", "--tool-frame"),
        ("kinarm-study status", ""),
        ("kinarm-study curves", "--measure --out --overwrite"),
        ("kinarm-train ars", f"{TRAINING} --sharing --step-size --no-normalize"),
        ("kinarm-train ppo", f"{TRAINING} --n-envs --net-arch --learning-rate --tensorboard"),
        *((program, "--version") for program in PROGRAMS),
    ],
)
def test_help_names_options_and_fits_a_terminal(run, words, options, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    answer = run(*words.split(), "--help")
    assert (answer.status, answer.err) == (0, "")
    assert [option for option in options.split() if option not in answer.out] == []
    assert [line for line in answer.out.splitlines() if len(line) > 80] == []


@pytest.mark.parametrize("learner", ["ars", "ppo"])
def test_training_help_tells_the_default_of_every_setting(run, learner, monkeypatch):
    monkeypatch.setenv("COLUMNS", "500")
    _, _, text = run("kinarm-train", learner, "--help").out.partition("settings of the learner")
    settings, _, _ = text.partition("\n\n")
    options = settings.split("\n  --")[1:]
    assert len(options) > 15
    assert [option for option in options if "(default: " not in option] == []


@pytest.mark.parametrize(("words", "unbuffered"), [("--help", "1"), ("zero --task left", "")])
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
