"""Running the command lines, in this process and in others."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import pytest
from oracle_calls import count_calls

from kinarm.__main__ import COMMANDS
from kinarm.evaluation import EvaluationRequest, ReplayRequest
from kinarm.policies import Policy, recipe, train_policy
from kinarm.problem import PROBLEMS

ROOT = Path(__file__).resolve().parents[2]
MODULES = {f"kinarm-{name}": module for name, (module, _) in COMMANDS.items()}


class Answer(NamedTuple):
    """What a command line left behind."""

    status: int
    out: str
    err: str


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """Run a command line in this process; an error that it does not catch fails the test."""

    def call(program: str, *arguments: object) -> Answer:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stopped:
            import_module(MODULES[program]).main([str(argument) for argument in arguments])
        return Answer(stopped.value.code or 0, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def command() -> Callable[..., list[str]]:
    """Spell a command line out for a process of its own."""

    def spell(program: str, *arguments: object) -> list[str]:
        name = program.removeprefix("kinarm-")
        return [sys.executable, "-m", "kinarm", name, *map(str, arguments)]

    return spell


@pytest.fixture(scope="session")
def run_outside(command: Callable[..., list[str]]) -> Callable[..., Answer]:
    """Run a command line in a process of its own."""

    def call(
        program: str,
        *arguments: object,
        environment: dict[str, str] | None = None,
        **settings: object,
    ) -> Answer:
        done = subprocess.run(
            command(program, *arguments),
            **{"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **settings},
            text=True,
            timeout=600,
            check=False,
            env={**os.environ, "COLUMNS": "100", **(environment or {})},
        )
        return Answer(done.returncode, done.stdout or "", done.stderr or "")

    return call


@pytest.fixture(scope="session")
def policy() -> Policy:
    """A policy for ``right``, hardly trained."""
    return train_policy(recipe("ars", "paper", problem="right", iterations=5)).policy


@pytest.fixture(scope="session")
def policy_folder(policy: Policy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Policy files: two seeds for ``right``, one for ``left``, one for another arm."""
    folder = tmp_path_factory.mktemp("policies")
    policy.save(folder / "mine-seed0.npz")
    others = {
        "mine-seed1": {"problem": "right", "seed": 1},
        "lefty": {"problem": "left"},
        "flange": {"problem": PROBLEMS["right"].replace(arm="paper_flange")},
    }
    for name, settings in others.items():
        config = recipe("ars", "paper", iterations=2, **settings)
        train_policy(config).policy.save(folder / f"{name}.npz")
    return folder


@pytest.fixture
def evaluated(run):
    """Run ``kinarm-eval --json`` and return the document."""

    def call(*arguments):
        answer = run("kinarm-eval", "--json", *arguments)
        assert (answer.status, answer.err) == (0, "")
        return json.loads(answer.out)

    return call


@pytest.fixture
def solved(monkeypatch) -> list[int]:
    """How many trials the oracle is asked to solve, call by call."""
    return count_calls(monkeypatch)


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture(name="replay")
def replaying(run, tmp_path) -> Callable[..., Answer]:
    """Run ``kinarm-replay``; its page goes to ``made.html``."""

    def call(*arguments):
        return run("kinarm-replay", *arguments, "--out", tmp_path / "made.html")

    return call


@pytest.fixture(scope="session")
def evaluation(policy_folder, tmp_path_factory) -> Path:
    """An evaluation of a policy and of a baseline."""
    folder = tmp_path_factory.mktemp("evaluation")
    policies = (str(policy_folder / "mine-seed0.npz"), "random")
    settings = {"problems": ("right",), "trials": 12, "seed": 4, "oracle": False}
    EvaluationRequest(policies=policies, out=folder, **settings).run()
    return folder / "evaluation.json"


@pytest.fixture(scope="session")
def recordings(policy_folder, tmp_path_factory) -> Path:
    """Recordings of four trials."""
    folder = tmp_path_factory.mktemp("recordings")
    policy = str(policy_folder / "mine-seed0.npz")
    files = {"out": folder / "page.html", "record": folder / "made.npz"}
    ReplayRequest(policy=policy, trials=4, oracle=False, **files).run()
    return folder / "made.npz"
