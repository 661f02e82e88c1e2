"""What the build makes of pages: comments become directives, and code runs."""

import sys
from pathlib import Path
from types import ModuleType

import pytest

from docs.comments import for_site

DOCS = Path(__file__).resolve().parents[2] / "docs"

PAGE = """\
`kinarm.Scene` [`kinarm.World`](a.md) `kinarm-eval`
<!-- run shows=a.png -->
```python
`kinarm.Scene`
```
<!-- name metric -->
```toml
# a.toml
```
<!-- {toctree}
:hidden:
-->
<!-- table arm -->
"""
BUILT = """\
{py:obj}`kinarm.Scene` [`kinarm.World`](a.md) `kinarm-eval`

```{kinarm-run} python shows=a.png
`kinarm.Scene`
```

```{kinarm-run} toml
# a.toml
```
```{toctree}
:hidden:
```
<!-- table arm -->
"""


def test_comments_become_directives_and_names_links_in_their_lines():
    assert for_site(PAGE) == BUILT


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The directive's module."""
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(str(DOCS))
    yield __import__("runs")
    sys.modules.pop("runs")


@pytest.fixture
def page(runs):
    """Where the blocks of a page run."""
    page = runs.Page("some.md")
    yield page
    page.close()


def test_files_are_there_for_later_blocks(page):
    page.write("mine.toml", 'arm = "paper"')
    assert page.run_commands("cat mine.toml") == 'arm = "paper"\n'


def test_blocks_share_names_and_a_folder_and_their_prints_are_kept(page):
    assert page.run_python("from pathlib import Path\nmade = Path('made.txt')") == ""
    assert page.run_python("made.write_text('made')\nprint(made)") == "made.txt\n"
    assert page.run_commands("cat made.txt") == "made"
    assert page.read("made.txt") == b"made"


def test_a_cell_shows_its_last_value_and_its_figures(page):
    assert page.run_cell("x = 2\nprint(1)\nx") == ("1\n2\n", "")
    assert page.run_cell("x;") == page.run_cell("None") == page.run_cell("x = 3") == ("", "")
    drawn = "import matplotlib.pyplot as plt\nplt.plot([1, x]);"
    printed, made = page.run_cell(drawn)
    assert printed == ""
    assert made.startswith('<img src="data:image/png;base64,')
    assert page.run_cell("x") == ("3\n", "")  # the figure is not shown again


def test_a_block_that_fails_says_where(page, runs):
    with pytest.raises(NameError) as caught:
        page.run_python("x = 1\nunknown", line=30)
    end = caught.traceback[-1]
    assert (str(end.path), end.lineno + 1) == ("some.md", 31)
    with pytest.raises(runs.ExtensionError, match=r"some\.md:7: .*no-such-file"):
        page.run_commands("cat no-such-file\necho done", line=7)


def test_a_command_that_is_to_fail_shows_its_message(page, runs):
    assert "no-such-file" in page.run_commands("cat no-such-file", fails=True)
    with pytest.raises(runs.ExtensionError, match="were to fail"):
        page.run_commands("echo done", fails=True)


def test_films_and_pictures_refer_to_nothing_outside(runs):
    assert runs.shown("a/film.mp4", b"film").startswith('<video src="data:video/mp4;base64,Zmls')
    assert runs.shown("picture.png", b"film").startswith('<img src="data:image/png;base64,Zmls')
