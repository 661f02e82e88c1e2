"""Bars and messages: of what takes long, and how far it is; in a notebook, too."""

import io
import re
from functools import cache

import numpy as np
import pytest
from rich.console import Console

from kinarm import _console
from kinarm._console import (
    COMPILING,
    ProgressLine,
    _say_why_it_waits,
    doing,
    told_of_activities,
)
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


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_is_told_once_where_nobody_listens(monkeypatch, terminal):
    monkeypatch.setattr(_console, "_say_why_it_waits", cache(_say_why_it_waits.__wrapped__))
    error = io.StringIO()
    error.isatty = lambda: terminal
    monkeypatch.setattr("sys.stderr", error)
    with told_of_activities(str), doing(COMPILING):
        pass
    assert not error.getvalue()
    for activity in ("learning", COMPILING, COMPILING):
        with doing(activity):
            pass
    assert error.getvalue() == f"kinarm: {COMPILING}...\n" * terminal


def test_one_within_another_is_told_of_and_the_same_is_not():
    heard = []
    with told_of_activities(heard.append), doing("learning"):
        for each in ("learning", COMPILING):
            with doing(each), doing(each):
                pass
    assert heard == ["learning", COMPILING, "learning", ""]


def shown(monkeypatch, width=80, **settings):
    """What a line of progress shows on a console."""
    monkeypatch.setattr(_console, "LINE_SECONDS", 0.0)
    file = io.StringIO()
    with ProgressLine("baking", 4, "loaves", Console(file=file, width=width, **settings)) as line:
        line.update(0, ["starting"])
        line.update(2, ["crisp"])
        line.update(4, ["done"])
    return file.getvalue()


def test_without_a_terminal_there_are_lines_of_progress_now_and_then(monkeypatch):
    first, *_, last = shown(monkeypatch).splitlines()
    assert first == "baking: 0/4 loaves, -:--:-- left, starting"
    assert last == "baking: 4/4 loaves, 0:00:00 left, done"


def test_on_a_terminal_there_is_a_bar(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    text = shown(monkeypatch, force_terminal=True)
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text)
    assert "---------- baking: 4/4 0:00:00 left done" in plain.replace(
        "\N{BOX DRAWINGS HEAVY HORIZONTAL}", "-"
    )
