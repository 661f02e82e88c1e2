"""Sphinx directive ``kinarm-api``: what a page of the API reference documents, a line for each."""

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

ENTRY = re.compile(
    r"^\.\. (?:auto(?:class|function|exception)|py:data):: (\S+)\n((?: +.*\n|\n)*)", re.MULTILINE
)
MODULE = re.compile(r"^\.\. currentmodule:: (\S+)$", re.MULTILINE)


def entries(page: str) -> Iterator[tuple[str, str]]:
    """Names that a page documents, with their modules, and a line about each."""
    for found in ENTRY.finditer(page):
        name, body = found[1], found[2]
        if found[0].startswith(".. py:data"):
            module = MODULE.findall(page[: found.start()])[-1]
            name, text = f"{module}.{name}", body.strip().rpartition("\n\n")[2]
        else:
            module, _, attribute = name.rpartition(".")
            text = inspect.getdoc(getattr(import_module(module), attribute)) or ""
        line = " ".join(text.partition("\n\n")[0].split())
        yield name, re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", line)  # as plain text


class ApiIndex(SphinxDirective):
    """Tell what is on a page: its first paragraph, and a table of the names."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        path = Path(self.env.doc2path(self.arguments[0]))
        self.env.note_dependency(path)
        page = path.read_text(encoding="utf-8")
        lines = [page.split("\n\n")[1], "", ".. list-table::", "   :widths: 1 3", ""]
        for name, line in entries(page):
            shown = name.rpartition(".")[2]
            lines += [f"   * - :py:obj:`{shown} <{name}>`", f"     - {line}"]
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-api", ApiIndex)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
