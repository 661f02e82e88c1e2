"""The line that tells how far something is fits every width, and always tells the time left."""

import io
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.progress import Progress

from kinarm import _progress
from kinarm._progress import ProgressLine, progress_line, time_left

WORDS = ("return +0.315", "success 45 %")


class Clock:
    """Time that passes when it is told to."""

    now = 0.0

    def __call__(self):
        return self.now


def task_of(done=1234, total=8000, words=WORDS, seconds_each=0.01, title="ars tuned right seed 0"):
    """A task of which so much was done."""
    clock = Clock()
    progress = Progress(get_time=clock, disable=True, speed_estimate_period=1e9)
    number = progress.add_task(title, total=total, words=words, count="")
    for part in (0, 1, done):
        clock.now = part * seconds_each
        progress.update(number, completed=part)
    return progress.tasks[0]


@pytest.mark.parametrize(
    ("width", "line"),
    [
        (
            100,
            "ars tuned right seed 0 ━━╌╌╌╌╌╌╌╌ 1234/8000 return +0.315 success 45 % 1:08 left",
        ),
        (80, "ars tuned right seed 0 ━━╌╌╌╌╌╌╌╌ 1234/8000 return +0.315 success 45 % 1:08 left"),
        (79, "ars tuned right seed 0 1234/8000 return +0.315 success 45 % 1:08 left"),
        (60, "ars tuned right seed 0 1234/8000 success 45 % 1:08 left"),
        (43, "ars tuned right seed 0 1234/8000 1:08 left"),
        (40, "1234/8000 1:08 left"),
    ],
)
def test_what_is_left_out_for_want_of_width(width, line):
    assert progress_line(task_of(), width, "━╌").plain == line


@given(
    width=st.integers(25, 200),
    total=st.integers(1, 10**6),
    share=st.floats(0, 1),
    title=st.text(st.characters(codec="ascii", categories=["L", "N"]), max_size=60),
    words=st.lists(st.text("abc 0123", min_size=1, max_size=20), max_size=3),
)
def test_count_and_time_left_are_in_every_line(width, total, share, title, words):
    task = task_of(round(share * total), total, words, title=title)
    line = progress_line(task, width, "#-")
    assert line.cell_len <= width
    assert f"{task.completed:.0f}/{total}" in line.plain
    assert line.plain.endswith(" left")


@pytest.mark.parametrize(
    ("done", "seconds_each", "expected"),
    [
        (0, 1, "-:-- left"),
        (7990, 1, "0:10 left"),
        (4400, 1, "1:00:00 left"),
        (8000, 1, "0:00 left"),
    ],
)
def test_time_left(done, seconds_each, expected):
    assert time_left(task_of(done, seconds_each=seconds_each)) == expected


def shown(monkeypatch, **settings):
    """What a line shows on a console."""
    monkeypatch.setattr(_progress, "LINE_SECONDS", 0.0)
    file = io.StringIO()
    with ProgressLine("baking", 4, "loaves", Console(file=file, width=60, **settings)) as line:
        line.update(0, ["starting"])
        line.update(4, ["crisp"])
    return file.getvalue()


def test_without_a_terminal_there_are_lines_now_and_then(monkeypatch):
    first, last = shown(monkeypatch).splitlines()
    assert first == "baking: 0/4 loaves, starting, -:-- left"
    assert last.startswith("baking: 4/4 loaves, crisp, ")


def test_what_is_counted_can_be_other_than_what_is_done():
    task = task_of(2, 8, ("right-seed0", "right-seed1"), title="trainings")
    task.fields["count"] = "1 of 30"
    assert progress_line(task, 80, "#-").plain.startswith(
        "trainings ##-------- 1 of 30 right-seed0"
    )
    assert progress_line(task, 40, "#-").plain == "trainings 1 of 30 right-seed1 0:01 left"


@pytest.mark.parametrize("colourful", [True, False])
def test_no_color_is_respected(monkeypatch, colourful):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    if not colourful:
        monkeypatch.setenv("NO_COLOR", "1")
    text = shown(monkeypatch, force_terminal=True)
    assert bool(re.search(r"\x1b\[[0-9;]*3\d", text)) is colourful
    assert "4/4 crisp" in re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text)
