"""Pages that are made from the code hold all of it."""

import sys
from types import ModuleType

import pytest
from known_arms import is_installed
from pages import DOCS, pages

from docs import tables
from kinarm.evaluation.metrics import METRICS

PAGES = {name: path for name, path in pages().items() if "<!-- end -->" in path.read_text()}


def module(monkeypatch: pytest.MonkeyPatch, name: str) -> ModuleType:
    """A Sphinx extension of the docs."""
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(str(DOCS))
    found = __import__(name)
    monkeypatch.delitem(sys.modules, name)
    return found


def test_every_program_and_option_is_described(monkeypatch: pytest.MonkeyPatch) -> None:
    commands = module(monkeypatch, "commands")
    parsers = {parser.prog: parser for parser in commands.all_parsers()}
    assert {"kinarm-eval", "kinarm-train ars", "kinarm-train ppo", "kinarm-problem check"} <= {
        *parsers
    }
    assert {*commands.programs()} <= {*parsers}
    for parser in parsers.values():
        text = commands.describe(parser)
        told = [action for action in parser._actions if action.dest not in commands.EVERYWHERE]
        options = [each for action in told for each in action.option_strings]
        assert [each for each in options if each not in text] == []


def test_every_figure_is_defined() -> None:
    table = tables.metrics_table()
    assert [name for name in METRICS if f"| `{name}` |" not in table] == []
    assert [
        letter for letter in tables.SYMBOLS if f"| {letter} |" not in tables.symbols_table()
    ] == []


@pytest.mark.parametrize("name", PAGES)
def test_a_page_holds_what_would_be_written_now(name: str) -> None:
    text = PAGES[name].read_text()
    if "<!-- table arms -->" in text and not is_installed():
        pytest.skip("the table of arms needs the extra robots")
    assert tables.filled(PAGES[name]) == text
