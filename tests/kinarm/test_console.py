"""Bars and messages: of what takes long, and how far it is; in a notebook, too."""

import io
import re

import numpy as np
from rich.console import Console

from kinarm import _console
from kinarm._console import COMPILING, ProgressLine, say_why_it_waits
from kinarm.kernels.compiling import kernel


def fresh_terminal(monkeypatch):
    """Standard error that is a terminal, to which nothing was said yet."""
    error = io.StringIO()
    error.isatty = lambda: True
    monkeypatch.setattr("sys.stderr", error)
    say_why_it_waits.cache_clear()
    return error


def test_what_is_compiled_is_said_once(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))  # where nothing lies from an earlier run
    error = fresh_terminal(monkeypatch)

    @kernel
    def fill(numbers):
        for i in range(len(numbers)):
            numbers[i] = 2.0

    for precision in (np.float64, np.float64, np.float32):
        fill(np.ones(3, dtype=precision))
    assert error.getvalue() == f"kinarm: {COMPILING}...\n"


def test_nothing_is_said_where_nobody_looks(monkeypatch):
    error = fresh_terminal(monkeypatch)
    error.isatty = lambda: False
    say_why_it_waits("learning")
    assert not error.getvalue()


def test_it_is_said_above_what_shows_progress(monkeypatch):
    error = fresh_terminal(monkeypatch)
    console = Console(file=error, force_terminal=True, width=80)
    with console.status("evaluating"):
        say_why_it_waits("learning")
    assert re.search(r"kinarm: learning\.\.\.\n.* evaluating", error.getvalue())


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
