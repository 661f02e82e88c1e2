"""Listeners hear what takes long, such as compilation, and commands say so on a terminal."""

import os
import pty
import subprocess
import sys

import numpy as np
import pytest

from kinarm._activities import COMPILING, doing, told_of_activities
from kinarm._console import working
from kinarm.kernels.compiling import inlined, kernel


def test_a_kernel_is_told_of_once_and_its_helpers_are_not():
    @inlined
    def doubled(x):
        return 2.0 * x

    @kernel
    def fill(numbers):
        for i in range(len(numbers)):
            numbers[i] = doubled(numbers[i])

    heard = []
    with told_of_activities(heard.append):
        for _ in range(2):
            fill(np.ones(3))
    assert heard == [COMPILING, ""]
    fill(np.ones(3, dtype=np.float32))  # compiled anew, and nobody listens
    assert heard == [COMPILING, ""]


def test_a_failure_ends_it_too():
    heard = []
    with told_of_activities(heard.append), pytest.raises(ValueError, match="no"), doing(COMPILING):
        raise ValueError("no")
    assert heard == [COMPILING, ""]


def test_one_within_another_is_told_of_and_the_same_is_not():
    heard = []
    with told_of_activities(heard.append), doing("learning"):
        for each in ("learning", COMPILING):
            with doing(each), doing(each):
                pass
    assert heard == ["learning", COMPILING, "learning", ""]


def test_what_was_said_comes_back(monkeypatch):
    said = []
    monkeypatch.setattr("rich.status.Status.update", lambda _, text: said.append(text))
    with working("evaluating") as say:
        say("right: 2 of 3")
        with doing(COMPILING):
            pass
    assert said == ["right: 2 of 3", f"right: 2 of 3; {COMPILING}", "right: 2 of 3"]


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo-terminal")
def test_the_first_run_says_so_and_the_second_does_not(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "TERM": "xterm"}
    command = [sys.executable, "-m", "kinarm", "eval", "--policy", "zero", "--no-oracle"]
    texts = []
    for _ in range(2):
        terminal, line = pty.openpty()
        with subprocess.Popen(
            [*command, "--trials", "2", "--problem", "right"],
            stdout=subprocess.DEVNULL,
            stderr=line,
            env=environment,
        ) as process:
            os.close(line)
            texts.append(read_all(terminal))
        assert process.returncode == 0
    assert COMPILING in texts[0]
    assert COMPILING not in texts[1]
    assert "evaluating" in texts[1]


def read_all(terminal):
    """Everything that is written to a terminal until its other end is closed."""
    parts = []
    while True:
        try:
            part = os.read(terminal, 4096)
        except OSError:  # what Linux says then
            break
        if not part:
            break
        parts.append(part)
    os.close(terminal)
    return b"".join(parts).decode()
