"""Sphinx directive ``kinarm-film``: code that runs when the page is built, and what it films."""

import base64
import contextlib
import os
import tempfile
from pathlib import Path
from unittest import mock

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

KINDS = {".mp4": "video/mp4", ".png": "image/png", ".gif": "image/gif"}
"""Files that can be shown, by their ending."""


def run(code: str, made: str | None) -> bytes | None:
    """Run code in a folder of its own, without a browser, and read a file that it made there."""
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
        mock.patch.dict(os.environ, {"BROWSER": "true"}),
    ):
        exec(compile(code, "<page>", "exec"), {})
        return Path(made).read_bytes() if made else None


def shown(name: str, content: bytes) -> str:
    """A film or picture as HTML that refers to nothing outside."""
    kind = KINDS[Path(name).suffix]
    source = f"data:{kind};base64,{base64.b64encode(content).decode()}"
    if kind.startswith("video"):
        return f'<video src="{source}" autoplay loop muted playsinline controls></video>'
    return f'<img src="{source}" alt="What the code above made">'


class KinarmFilm(SphinxDirective):
    """Show code, run it, and show the file that it made, if one is named."""

    has_content = True
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        code, made = "\n".join(self.content), self.arguments[0] if self.arguments else None
        content = run(code, made)
        block = nodes.literal_block(code, code, language="python")
        if made is None or content is None:
            return [block]
        return [block, nodes.raw("", shown(made, content), format="html")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("kinarm-film", KinarmFilm)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
