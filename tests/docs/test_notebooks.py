"""Notebooks of the course: without outputs, with the header that is due, and as pages."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pages import DOCS

from docs.comments import for_site
from docs.notebooks import cell, header, markdown, on_colab

NOTEBOOKS = sorted(DOCS.glob("*/*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_has_the_header_that_is_due_and_no_outputs(path: Path) -> None:
    cells = json.loads(path.read_text())["cells"]
    assert cells[:2] == header(path)
    code = [each for each in cells if each["cell_type"] == "code"]
    assert [(each["outputs"], each["execution_count"]) for each in code] == [([], None)] * len(code)
    assert len({each["id"] for each in cells}) == len(cells)


def test_the_header_installs_nothing_where_kinarm_is(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_options: object) -> None:
        pytest.fail("installed")

    monkeypatch.setattr(subprocess, "run", refuse)
    code = "".join(header(NOTEBOOKS[0])[1]["source"])
    exec(code, {})
    monkeypatch.setitem(sys.modules, "kinarm", None)  # as where it is missing
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(pytest.fail.Exception):
        exec(code, {})


def test_cells_become_blocks_that_run() -> None:
    path = DOCS / "course" / "a.ipynb"
    cells = [*header(path), cell("markdown", "1", "# A"), cell("code", "2", "x = 1\nx")]
    page = for_site(markdown({"cells": cells}, path))
    assert page.startswith(f"# A\n\n[Open in Colab]({on_colab(path)}), or ")
    assert "[download the notebook](path:a.ipynb)" in page
    assert page.endswith("\n\n```{kinarm-run} python cell\nx = 1\nx\n```\n\n")
