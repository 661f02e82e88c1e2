"""Command lines on policies that are not kinarm's own, and cards."""

import sys

import pytest
from refusals import check_refused


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


@pytest.fixture
def module(here):
    """A module in the current directory."""
    source = "import numpy as np\n\ndef still(seen):\n    return np.zeros((len(seen), 5))\n"
    (here / "still_for_tests.py").write_text(source)
    yield "still_for_tests:still"
    sys.modules.pop("still_for_tests", None)


class TestModule:
    @pytest.mark.parametrize("command", ["kinarm-eval", "kinarm-replay"])
    def test_takes_part(self, run, module, command):
        answer = run(command, "--policy", module, "--problem", "left", "--trials", 3)
        assert answer.status == 0, answer.err
        assert module in answer.out


class TestCard:
    def test_of_a_file(self, run, here, policy):
        policy.save("mine.npz")
        arguments = ("--policy", "mine.npz", "--trials", 4, "--card", "mine.md")
        answer = run("kinarm-eval", *arguments)
        assert answer.status == 0, answer.err
        assert "written: mine.md, mine.npz and mine.html" in answer.out
        text = (here / "mine.md").read_text()
        assert "kinarm-eval --policy mine.npz --trials 4 --card mine.md" in text
        assert (here / "mine.html").is_file()
        check_refused(run("kinarm-eval", *arguments), "mine.md' exists", "--overwrite")
        assert run("kinarm-eval", *arguments, "--overwrite").status == 0
        assert (here / "mine.md").read_text() == text.replace(
            "--card mine.md", "--card mine.md --overwrite"
        )
