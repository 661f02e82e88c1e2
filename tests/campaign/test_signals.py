"""The small campaign of signals: every kind of command, a moment each."""

import signal
from pathlib import Path

import pytest

from .processes import SUBJECTS
from .signals import Disturbance, Ended, before_kinarm, campaign, disturbed, finding

QUICK = ("arms", "eval, printed", "replay, live", "train, ars")


@pytest.mark.slow
def test_a_few_signals_to_some_commands():
    tallies = campaign(4, seed=0, names=QUICK)
    assert {name: tally.examples for name, tally in tallies.items()} == {name: {} for name in QUICK}
    assert all(tally.runs == 1 for tally in tallies.values())


@pytest.mark.slow
@pytest.mark.parametrize("as_module", [True, False])
def test_ctrl_c_thrice_while_workers_start(tmp_path, as_module):
    disturbance = Disturbance(as_module, signal.SIGINT, (6.0, 0.05, 0.3), to_all=True)
    ended, left = disturbed(SUBJECTS["reproduce"], disturbance, tmp_path)
    assert finding("kinarm-reproduce", ended, left) == ""


@pytest.mark.parametrize(
    ("status", "err", "left", "found"),
    [
        (0, "", [], ""),
        (130, "kinarm-eval: interrupted\n", [], ""),
        (130, "30 of 30\nkinarm-eval: interrupted\n", [], ""),
        (130, "", [], ""),
        (None, "", [], "hangs"),
        (143, "", [], "status 143"),
        (1, "Traceback (most recent call last):\nValueError: 3\n", [], "traceback: ValueError: 3"),
        (130, "kinarm-eval: a\nkinarm-eval: b\n", [], "more than a line"),
        (130, "kinarm-eval: a\nwarning\n", [], "more than a line"),
        (130, "", ["a process"], "leaves a process"),
    ],
)
def test_what_counts_as_a_finding(status, err, left, found):
    assert finding("kinarm-eval", Ended(status, err, 1.0), left) == found


@pytest.mark.parametrize(
    ("status", "err", "early"),
    [
        (-2, "", True),
        (1, 'Traceback\n  File "<frozen site>", line 1\nKeyboardInterrupt\n', True),
        (-2, 'Traceback\n  File "/x/kinarm/_interrupts.py", line 1\nKeyboardInterrupt\n', True),
        (-2, 'Traceback\n  File "/x/kinarm/arm.py", line 1\nKeyboardInterrupt\n', False),
        (1, "", False),
        (130, "", False),
    ],
)
def test_the_start_of_python_itself_is_told_apart(status, err, early):
    assert before_kinarm(Ended(status, err, 1.0), signal.SIGINT) is early


def test_commands_of_all_programs_are_disturbed():
    programs = {subject.program for subject in SUBJECTS.values()}
    scripts = Path(__file__).resolve().parents[2] / "pyproject.toml"
    text = scripts.read_text().partition("[project.scripts]")[2].partition("[tool")[0]
    assert programs == {line.partition(" =")[0] for line in text.split("\n") if "=" in line}
