"""Consoles print what they are given."""

import io

import pytest
from rich.table import Table

from kinarm._console import open_console

HOSTILE = ["x/[/o]", "p[v2].npz", "[bold]b", ":smile:", "[link=http://a]"]


@pytest.mark.parametrize("text", HOSTILE)
def test_names_hold_no_markup(text):
    file = io.StringIO()
    console = open_console(file=file, piped_width=100)
    table = Table("name")
    table.add_row(text)
    console.print(f"written: {text}")
    console.print(table)
    assert file.getvalue().count(text) == 2


def test_width_of_what_is_no_terminal():
    assert open_console(file=io.StringIO(), piped_width=123).width == 123
