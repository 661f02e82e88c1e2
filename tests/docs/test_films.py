"""*Record a film*: the blocks of the page run as they stand, and make what the page shows."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "films.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```\{kinarm-film\}[ ]?(\S*)\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def films(monkeypatch: pytest.MonkeyPatch) -> object:
    """The page's directive."""
    pytest.importorskip("sphinx")
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    yield __import__("films")
    sys.modules.pop("films")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning:moviepy")
@pytest.mark.parametrize(("made", "code"), BLOCKS)
def test_blocks_run(films, made, code):
    if made.endswith("mp4"):
        pytest.importorskip("moviepy")
    content = films.run(code, made or None)
    assert (content is None) == (made == "")
    if content is not None:
        assert len(content) > 10_000
        assert films.shown(made, content).startswith("<video" if made.endswith("mp4") else "<img")


def test_every_way_is_shown():
    assert [made for made, _ in BLOCKS] == [
        *("films/reach-episode-0.mp4", "picture.png", "films/batch-step-0.mp4", "", "moment.png"),
    ]
