"""The walk of a newcomer types what README and tutorial say, also when they change."""

import runpy
from pathlib import Path

import pytest

pytest.importorskip("playwright")

WALK = runpy.run_path(str(Path(__file__).with_name("first_steps.py")))


def test_a_newcomer_installs_trains_evaluates_and_watches():
    typed = list(WALK["typed"]())
    programs = [command.split()[0] for command in typed if not command.startswith("python")]
    assert programs == ["make", "kinarm-train", "kinarm-eval", "kinarm-replay", "kinarm-replay"]
    assert typed[0] == "make eval"


def test_what_the_readme_does_not_say_ends_the_walk(tmp_path, monkeypatch):
    readme = tmp_path / "README.md"
    readme.write_text("make eval\n", encoding="utf-8")
    typed = WALK["typed"]
    monkeypatch.setitem(typed.__globals__, "PAGES", (readme, WALK["PAGES"][1]))
    with pytest.raises(SystemExit, match=r"README\.md does not say: \. \.venv/bin/activate"):
        next(typed())
