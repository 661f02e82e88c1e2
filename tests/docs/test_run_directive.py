"""Pages whose code runs in the build: the directive that runs it, and that the pages use it."""

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = sorted(
    page.relative_to(DOCS).with_suffix("").as_posix()
    for page in DOCS.rglob("*.md")
    if "{kinarm-run}" in page.read_text(encoding="utf-8")
)
FROM_FILE_TO_REPLAY = ("how-to/own_arm", "how-to/own_scene")


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


@pytest.mark.parametrize("name", FROM_FILE_TO_REPLAY)
def test_from_file_to_replay_takes_thirty_lines(name):
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```\{kinarm-run\} (?:xml|toml|sh)\n(.*?)^```$", text, re.M | re.S)
    lines = [line for block in blocks for line in block.splitlines() if line.strip(": ")]
    assert len([line for line in lines if not line.startswith(":")]) <= 30
    assert "kinarm-replay" in blocks[-1]


def test_at_least_ten_pages_run_with_figures_and_five_with_replays():
    shown = [
        re.findall(r"^:shows: (\S+)$", (DOCS / f"{page}.md").read_text(), re.M) for page in PAGES
    ]
    examples = [*(DOCS / "examples").glob("plot_*.py")]
    with_replays = [names for names in shown if any(name.endswith(".html") for name in names)]
    assert len([names for names in shown if names]) + len(examples) >= 15
    assert len(with_replays) >= 5


def test_blocks_share_names_and_a_folder_and_their_prints_are_kept(page):
    assert page.run_python("from pathlib import Path\nmade = Path('made.txt')") == ""
    assert page.run_python("made.write_text('made')\nprint(made)") == "made.txt\n"
    assert page.run_commands("cat made.txt") == "made"
    assert page.read("made.txt") == b"made"


def test_commands_are_those_of_this_python(page):
    code = "import sys; print(sys.prefix)"
    assert page.run_commands(f'python -c "{code}"').strip() == sys.prefix


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
