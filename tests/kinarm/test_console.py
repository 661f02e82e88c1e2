"""Bars and messages in a notebook."""

import builtins
import io

import pytest
from rich.progress import track

from kinarm._console import open_console


class ZMQInteractiveShell:
    """What tells rich that it is in a notebook."""


@pytest.fixture
def notebook(monkeypatch):
    monkeypatch.setattr(builtins, "get_ipython", ZMQInteractiveShell, raising=False)


def test_a_bar_without_ipywidgets_is_a_line_at_the_end(notebook, monkeypatch, capsys):
    """And rich does not warn, which would be an error here."""
    monkeypatch.setattr("kinarm._console.find_spec", lambda _: None)
    console = open_console(stderr=True)
    assert list(track(range(3), "training", console=console)) == [0, 1, 2]
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("training")
    assert len(said.err.splitlines()) == 1
    assert "\x1b" not in said.err


@pytest.mark.parametrize(("columns", "width"), [(None, 1000), ("70", 70)])
def test_a_pipe_is_as_wide_as_it_takes_or_as_the_environment_says(monkeypatch, columns, width):
    monkeypatch.delenv("COLUMNS", raising=False)
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    assert open_console().width == width
    assert open_console(file=io.StringIO()).width == 1000


def test_with_ipywidgets_rich_draws_it(notebook, monkeypatch):
    monkeypatch.setattr("kinarm._console.find_spec", lambda _: True)
    assert open_console().is_jupyter
