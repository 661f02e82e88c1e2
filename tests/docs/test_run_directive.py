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
