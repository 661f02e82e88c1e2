"""Notebooks as pages: the build runs their cells, and shows what they print and draw.

A notebook holds no outputs. Its first two cells serve readers who open it on Colab;
``python -m docs.notebooks`` writes them, and a test compares.
"""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

REPOSITORY = "https://github.com/OWNER/kinarm"
"""Where the sources lie. Replace OWNER, and call this module."""

FOLDER = Path(__file__).parent
INSTALL = """\
# Installs kinarm where it is missing, such as on Colab, in about a minute.
import importlib.util
import subprocess
import sys

if importlib.util.find_spec("kinarm") is None:
    pip = [sys.executable, "-m", "pip", "install", "-q", "git+{repository}"]
    subprocess.run(pip, check=True)"""


def on_colab(path: Path) -> str:
    """Address that opens a notebook on Colab."""
    place = f"{REPOSITORY.split('/', 3)[3]}/blob/main/docs/{path.relative_to(FOLDER).as_posix()}"
    return f"https://colab.research.google.com/github/{place}"


def header(path: Path) -> list[dict[str, Any]]:
    """The first two cells of a notebook: a badge, and what installs kinarm."""
    badge = "[![Open In Colab](https://colab.research.google.com/assets/colab-badge.svg)]"
    return [
        cell("markdown", "colab", f"{badge}({on_colab(path)})"),
        cell("code", "install", INSTALL.format(repository=REPOSITORY)),
    ]


def cell(kind: str, name: str, source: str) -> dict[str, Any]:
    """A cell of a notebook, without outputs."""
    code = {"execution_count": None, "outputs": []} if kind == "code" else {}
    lines = source.splitlines(keepends=True)
    return {"cell_type": kind, **code, "id": name, "metadata": {}, "source": lines}


def markdown(notebook: dict[str, Any], path: Path) -> str:
    """A notebook as Markdown whose code runs, with links in place of the first two cells."""
    title, *cells = ("".join(each["source"]) for each in notebook["cells"][2:])
    kinds = [each["cell_type"] for each in notebook["cells"][3:]]
    links = f"[Open in Colab]({on_colab(path)}), or [download the notebook](path:{path.name})."
    pages = [
        text if kind == "markdown" else f"<!-- run cell -->\n```python\n{text}\n```"
        for kind, text in zip(kinds, cells, strict=True)
    ]
    return "\n\n".join([title, links, *pages, ""])


def _read(app: "Sphinx", page: str, source: list[str]) -> None:
    path = Path(app.env.doc2path(page))
    if path.suffix == ".ipynb":
        source[0] = markdown(json.loads(source[0]), path)


def setup(app: "Sphinx") -> dict[str, bool]:
    """Read notebooks as Markdown, before its comments are read."""
    app.add_source_suffix(".ipynb", "markdown")
    app.connect("source-read", _read, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


if __name__ == "__main__":
    for file in FOLDER.glob("*/*.ipynb"):
        notebook = json.loads(file.read_text("utf-8"))
        notebook["cells"][:2] = header(file)
        file.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", "utf-8")
