"""Sphinx directive ``kinarm-run``: code that runs when the page is built, and what came of it.

The blocks of a page run one after the other, in a folder that is empty before the first of them.
Python shares one namespace, and a block that fails fails the build.
"""

import ast
import base64
import contextlib
import io
import os
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import Any
from unittest import mock

import matplotlib.pyplot as plt
from comments import FILE
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

from kinarm.viewer.html_page import HtmlPage

TERMINAL = {"COLUMNS": "92", "LINES": "40", "TERM": "dumb"}
"""The terminal in which commands run, for programs that ask."""

COLUMNS = re.compile(r"[│|]|\S {2,}\S")
"""What there is between columns of tables, whose lines must not wrap."""

KINDS = {".mp4": "video/mp4", ".png": "image/png", ".gif": "image/gif"}
"""Files that can be shown, by their ending."""


class Page:
    """Where the blocks of a page run.

    Parameters
    ----------
    source : str
        File of the page, for tracebacks.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self._folder = TemporaryDirectory()
        self._names: dict[str, Any] = {"__name__": "__main__"}

    def run_python(self, code: str | ast.Module, line: int = 1) -> str:
        """Run code that begins at a line of the page, without a browser; what it printed."""
        printed = io.StringIO()
        tree = ast.parse(code) if isinstance(code, str) else code
        with (
            contextlib.chdir(self._folder.name),
            contextlib.redirect_stdout(printed),
            mock.patch.dict(os.environ, {"BROWSER": "true"}),
        ):
            exec(compile(ast.increment_lineno(tree, line - 1), self._source, "exec"), self._names)
        return printed.getvalue()

    def run_cell(self, code: str, line: int = 1) -> tuple[str, str]:
        """Run a cell of a notebook: what it printed, and its last value and figures as HTML."""
        tree, made = ast.parse(code), []

        def display(value: object) -> None:
            if hasattr(value, "_repr_html_"):
                made.append(value._repr_html_())
            elif value is not None:
                print(repr(value))

        self._names["display"] = display
        last = tree.body[-1]
        if isinstance(last, ast.Expr) and not code.rstrip().endswith(";"):
            last.value = ast.Call(ast.Name("display", ast.Load()), [last.value], [])
        printed = self.run_python(ast.fix_missing_locations(tree), line)
        for number in plt.get_fignums():
            drawn = io.BytesIO()
            plt.figure(number).savefig(drawn, dpi=120)
            made.append(shown("figure.png", drawn.getvalue()))
        plt.close("all")
        return printed, "".join(made)

    def run_commands(self, commands: str, line: int = 1, *, fails: bool = False) -> str:
        """Run command lines, with the commands of this Python first; what they printed.

        Where the last one ``fails``, its message is part of that, and a status of 0 is an error.
        """
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        terminal, theirs = os.openpty()
        with TemporaryFile("w+") as said:
            process = subprocess.Popen(
                ["sh", "-e", "-c", commands],
                cwd=self._folder.name,
                env={**os.environ, "PATH": path, **TERMINAL},
                stdout=theirs,
                stderr=said,
            )
            os.close(theirs)
            printed = read_terminal(terminal)
            failed = process.wait() != 0
            said.seek(0)
            message = said.read()
        if failed != fails:
            how = "were to fail" if fails else "failed"
            raise ExtensionError(f"{self._source}:{line}: commands {how}: {message}")
        return printed + message if fails else printed

    def write(self, name: str, text: str) -> None:
        """Write a file that later blocks use."""
        Path(self._folder.name, name).write_text(f"{text}\n", encoding="utf-8")

    def read(self, name: str) -> bytes:
        """Read a file that a block made."""
        return Path(self._folder.name, name).read_bytes()

    def close(self) -> None:
        """Delete the folder."""
        self._folder.cleanup()


def read_terminal(terminal: int) -> str:
    """Read what is printed in a terminal until nobody is left to print."""
    printed = bytearray()
    with suppress(OSError):  # Linux's way to say that it has ended
        while piece := os.read(terminal, 4096):
            printed += piece
    os.close(terminal)
    return printed.decode().replace("\r\n", "\n")


def shown(name: str, content: bytes) -> str:
    """A film, picture or page as HTML that refers to nothing outside."""
    if name.endswith(".html"):
        return HtmlPage(content.decode())._repr_html_()
    kind = KINDS[Path(name).suffix]
    source = f"data:{kind};base64,{base64.b64encode(content).decode()}"
    if kind.startswith("video"):
        return f'<video src="{source}" autoplay loop muted playsinline controls></video>'
    return f'<img src="{source}" alt="What the code above made">'


class KinarmRun(SphinxDirective):
    """Show Python or command lines (``sh``), run them, and show what they printed and made.

    A word ``fails`` behind the language says that command lines end with a message, which is
    shown, ``shows=FILE`` which file is shown, and ``cell`` that Python is a cell of a notebook. A
    block that names a file is written to it.
    """

    has_content = True
    required_arguments = 1
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        language, *words = self.arguments
        options = dict(word.partition("=")[::2] for word in words)
        page, code = self._page(), "\n".join(self.content)
        found: list[nodes.Node] = [nodes.literal_block(code, code, language=language)]
        if file := FILE.match(code):
            page.write(file[1], code)
            return found
        line = self.lineno + self.content_offset + 1
        drawn = ""
        if "cell" in options:
            printed, drawn = page.run_cell(code, line)
        elif language == "python":
            printed = page.run_python(code, line)
        else:
            printed = page.run_commands(code, line, fails="fails" in options)
        if printed.strip():
            kinds = ["printed"] if COLUMNS.search(printed) else ["printed", "wraps"]
            found.append(nodes.literal_block(printed, printed, language="text", classes=kinds))
        if made := options.get("shows"):
            drawn = shown(made, page.read(made))
        if drawn:
            found.append(nodes.raw("", drawn, format="html"))
        return found

    def _page(self) -> Page:
        """Where the blocks of this page run; made for the first of them."""
        data = self.env.temp_data
        if "kinarm-run" not in data:
            data["kinarm-run"] = Page(str(self.env.doc2path(self.env.docname)))
        return data["kinarm-run"]


def close_page(app: Sphinx, _doctree: nodes.document) -> None:
    """Delete what the blocks of a page made, once it is read."""
    page = app.env.temp_data.pop("kinarm-run", None)
    if page is not None:
        page.close()


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-run", KinarmRun)
    app.connect("doctree-read", close_page)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
