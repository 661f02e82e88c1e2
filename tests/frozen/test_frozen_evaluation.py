"""An evaluation's document, table and report say what they said when other policies last shipped.

Recorded by ``kinarm-eval --policy ppo-paper-right random --problem right --trials 10 --hold``, but
for the command, versions and commit.
"""

import json
from html.parser import HTMLParser
from pathlib import Path

import pytest

from kinarm.evaluation.commands.evaluate import main

FOLDER = Path(__file__).parent
PROBLEM = str(FOLDER / "right.toml")
"""The paper's, as steps were tested for contact."""

ASKED = ["--policy", "ppo-paper-right", "random", "--problem", PROBLEM, "--trials", "10", "--hold"]
UNSTABLE = ("command", "versions", "commit")


class Words(HTMLParser):
    """Text of a page, that at the pointer included, up to how it was made."""

    def __init__(self) -> None:
        super().__init__()
        self.words: list[str] = []
        self.unread = False

    def handle_starttag(self, tag, attributes):
        self.unread = tag in ("style", "script") or (self.unread and tag != "main")
        self.unread |= dict(attributes).get("id") == "method"

    def handle_data(self, data):
        if data.strip() and not self.unread:
            self.words.append(" ".join(data.split()))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluated")
    with pytest.raises(SystemExit, match="0"):
        main([*ASKED, "--out", str(folder), "--report", str(folder)])
    return folder


def test_document(folder):
    document = json.loads((folder / "evaluation.json").read_text())
    for name in UNSTABLE:
        del document["protocol"][name]
    assert document == json.loads((FOLDER / "evaluation.json").read_text())


def test_report(folder):
    page = Words()
    page.feed((folder / "index.html").read_text())
    assert page.words == (FOLDER / "report.txt").read_text().splitlines()


def test_table(capsys):
    with pytest.raises(SystemExit, match="0"):
        main([*ASKED, "--markdown"])
    assert capsys.readouterr().out == (FOLDER / "evaluation.md").read_text()
