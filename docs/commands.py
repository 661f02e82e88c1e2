"""Sphinx directive ``kinarm-commands``: all options of the command lines, from their parsers."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from importlib.metadata import entry_points
from unittest import mock

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from kinarm._command_line import Parser
from kinarm.evaluation.report.templating import markdown_table

BESIDE = {"kinarm-run": ["check"], "kinarm-study": ["status"]}
"""First words that a program answers with a parser of its own, which its own one does not know."""

EVERYWHERE = ("help", "version")
"""Options that all programs have."""


def programs() -> dict[str, Callable[[Sequence[str]], None]]:
    """The programs that an install of kinarm brings, by name; `kinarm` alone only lists them."""
    scripts = entry_points(group="console_scripts")
    ours = (script for script in scripts if script.name.startswith("kinarm-"))
    return {script.name: script.load() for script in sorted(ours, key=lambda each: each.name)}


def parser_of(main: Callable[[Sequence[str]], None], words: Sequence[str] = ()) -> Parser:
    """The parser of which a program prints the help."""
    asked: list[Parser] = []
    record = mock.patch.object(Parser, "print_help", lambda parser: asked.append(parser))
    with record, suppress(SystemExit):
        main([*words, "--help"])
    return asked[0]


def all_parsers() -> Iterator[Parser]:
    """Parsers of all programs, each before those of its commands."""
    for name, main in programs().items():
        parser = parser_of(main)
        yield parser
        for word in [*command_names(parser), *BESIDE.get(name, ())]:
            yield parser_of(main, [word])


def command_names(parser: Parser) -> list[str]:
    """Names of a program's commands."""
    kinds = (argparse._SubParsersAction,)
    return [name for each in parser._actions if isinstance(each, kinds) for name in each.choices]


def describe(parser: Parser) -> str:
    """What help says of a program, in Markdown."""
    parser.format_help()  # reads what it ends with
    formatter = parser._get_formatter()
    formatter._width = 80
    formatter.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups)
    level = "###" if " " in parser.prog else "##"
    parts = [
        f"{level} {parser.prog}",
        parser.description or "",
        fenced(formatter.format_help()),
        *(options_table(group, formatter) for group in parser._action_groups),
        fenced(formatter._fill_text(parser.epilog, 80, "")) if parser.epilog else "",
    ]
    return "\n\n".join(part for part in parts if part)


def options_table(group: argparse._ArgumentGroup, formatter: argparse.HelpFormatter) -> str:
    """What the options of a group are called, and mean."""
    rows = [
        [f"`{formatter._format_action_invocation(action)}`", meaning_of(action, formatter)]
        for action in group._group_actions
        if action.dest not in EVERYWHERE and action.help not in (None, argparse.SUPPRESS)
    ]
    title = f"**{group.title}**" if rows and group.title else ""
    table = markdown_table(["option", "meaning"], rows) if rows else ""
    return f"{title}\n\n{table}".strip()


def meaning_of(action: argparse.Action, formatter: argparse.HelpFormatter) -> str:
    """Help of an option, as text that Markdown leaves as it is."""
    said = formatter._expand_help(action)
    return "".join(f"\\{letter}" if letter in "*_`<>|[]" else letter for letter in said)


def fenced(text: str) -> str:
    """Text as it stands."""
    return f"```text\n{text.strip()}\n```"


class KinarmCommands(SphinxDirective):
    """Describe all programs."""

    def run(self) -> list[nodes.Node]:
        text = "\n\n".join(describe(parser) for parser in all_parsers())
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-commands", KinarmCommands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
