"""The scripts of rl-zoo3 run on the ids as they are: what the page shows, shortened."""

import os
import re
import shlex
import subprocess
import sys

import numpy as np
import pytest
from pages import DOCS, ROOT, named_blocks

pytest.importorskip("rl_zoo3")

pytestmark = pytest.mark.rare

PAGE = (DOCS / "how-to" / "stable_baselines3.md").read_text(encoding="utf-8")
BLOCKS = named_blocks(DOCS / "how-to" / "stable_baselines3.md")


def run(line, folder, *others):
    """Run a command line in a process of its own, with further arguments; returns its output."""
    program, *words = shlex.split(line)
    if program == "kinarm-eval":
        words = ["-m", "kinarm", "eval", *words]
    done = subprocess.run(
        [sys.executable, *words, *map(str, others)],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder to work in, with the file by which rl-zoo3 learns of other environments."""
    path = tmp_path_factory.mktemp("zoo")
    content, name = re.search(r'^echo "(.*)" > (\S+)$', PAGE, re.MULTILINE).groups()
    (path / name).write_text(f"{content}\n")
    return path


@pytest.fixture(scope="module")
def trained(folder):
    """The logs of a training as the page has it, for a moment."""
    line = BLOCKS["zoo-train"].replace("data/zoo/ppo", str(ROOT / "data" / "zoo" / "ppo")).strip()
    short = "-params n_envs:4 batch_size:64 -n 800 --eval-freq 400 --eval-episodes 4"
    assert "Success rate" in run(f"{line} {short}", folder)
    return folder / "logs" / "ppo" / "kinarm-ReachRight-v0_1"


def test_train(trained):
    assert (trained / "kinarm-ReachRight-v0.zip").exists()
    assert (trained / "kinarm-ReachRight-v0" / "vecnormalize.pkl").exists()
    log = np.load(trained / "evaluations.npz")
    assert log["results"].shape == log["successes"].shape == (2, 4)


def test_enjoy_evaluates(folder, trained):
    printed = run(BLOCKS["zoo-enjoy"], folder, "-n", 200)
    assert "Success rate" in printed
    assert "Mean reward" in printed


def test_kinarm_evaluates_the_model(folder, trained):
    assert "kinarm-ReachRight-v0" in run(BLOCKS["zoo-judge"], folder, "--trials", 10)
