"""Command lines on policies that are not kinarm's own."""

import sys

import pytest


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
