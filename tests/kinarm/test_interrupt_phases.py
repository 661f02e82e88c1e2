"""Phases of a command, within this process: what `test_interrupts` sees from outside."""

import os
import signal
import sys
from types import SimpleNamespace

import pytest

from kinarm import _interrupts
from kinarm._interrupts import Interruption


@pytest.fixture
def set_signals(monkeypatch):
    """Signals that would be set, by number; nothing of this process is changed."""
    asked = {}
    monkeypatch.setattr(signal, "signal", asked.__setitem__)
    monkeypatch.setattr(signal, "setitimer", lambda *times: asked.update(timer=times[1]))
    monkeypatch.setattr(_interrupts, "_phase", "foreign")
    monkeypatch.setattr(_interrupts, "_requested", False)
    for hook in ("excepthook", "unraisablehook"):
        monkeypatch.setattr(sys, hook, getattr(sys, hook))
    return asked


@pytest.mark.parametrize(
    ("program", "words", "expected"),
    [
        ("/x/kinarm-eval", ["python", "/x/kinarm-eval", "--help"], True),
        ("/x/kinarm-eval", ["python", "-c", "..."], False),
        ("mine.py", ["python", "mine.py"], False),
        ("-m", ["python", "-m", "kinarm.policies.train"], True),
        ("-m", ["python", "-mkinarm.policies.train"], True),
        ("-m", ["python", "-m", "kinarm", "eval"], True),
        ("-m", ["python", "-X", "importtime", "-Im", "kinarm"], True),
        ("-m", ["python", "-m", "pytest"], False),
        ("-m", ["python", "-m", "pytest", "kinarm"], False),
        ("-m", ["python", "-m", "kinarmor"], False),
        ("-m", ["python"], False),
        (None, ["python"], False),
    ],
)
def test_which_processes_are_commands(monkeypatch, program, words, expected):
    monkeypatch.setattr(sys, "argv", [] if program is None else [program])
    monkeypatch.setattr(sys, "orig_argv", words)
    assert _interrupts.is_command() is expected


def test_from_the_start_to_the_end(monkeypatch, set_signals):
    monkeypatch.setattr(
        signal,
        "getsignal",
        lambda number: signal.SIG_IGN if number == signal.SIGHUP else signal.SIG_DFL,
    )
    _interrupts._take_over()
    assert set(set_signals) == {signal.SIGINT, signal.SIGTERM, signal.SIGALRM}
    monkeypatch.setattr(os, "_exit", sys.exit)
    with pytest.raises(SystemExit) as ended:
        _interrupts._answer(signal.SIGINT, None)
    assert ended.value.code == 130
    _interrupts.begin()
    with pytest.raises(Interruption):
        _interrupts._answer(signal.SIGINT, None)
    assert set_signals["timer"] == _interrupts.AGAIN
    assert _interrupts.was_interrupted(ValueError())
    _interrupts.end()
    assert set_signals["timer"] == 0
    assert set_signals[signal.SIGHUP] == signal.SIG_IGN
    _interrupts._answer(signal.SIGINT, None)  # too late
    _interrupts.begin()
    assert _interrupts._phase == "ending"


def test_what_was_made_of_an_interruption_is_on_its_way(monkeypatch, set_signals):
    monkeypatch.setattr(_interrupts, "_phase", "running")
    try:
        try:
            _interrupts._answer(signal.SIGINT, None)
        except Interruption:
            raise TypeError("a library's own") from None
    except TypeError:
        _interrupts._answer(signal.SIGINT, None)


def test_work_is_asked_to_stop_before_it_is_interrupted(monkeypatch, set_signals):
    monkeypatch.setattr(_interrupts, "_phase", "running")
    seen = []

    def work():
        with _interrupts.asking(lambda: seen.append("asked")):
            _interrupts._answer(signal.SIGINT, None)
            seen.append(set_signals["timer"])

    with pytest.raises(Interruption):
        work()
    assert seen == ["asked", _interrupts.PATIENCE]


def test_work_that_does_not_stop_is_interrupted(monkeypatch, set_signals):
    monkeypatch.setattr(_interrupts, "_phase", "running")

    def work():
        with _interrupts.asking(lambda: None):
            _interrupts._answer(signal.SIGINT, None)
            _interrupts._answer(signal.SIGALRM, None)
            pytest.fail("it goes on")

    with pytest.raises(Interruption):
        work()
    assert _interrupts._ask is None


def test_work_that_nobody_stops_is_left_alone(set_signals):
    with _interrupts.asking(lambda: pytest.fail("asked")):
        pass


def test_other_processes_keep_their_own_ways(set_signals):
    _interrupts.begin()
    _interrupts._answer(signal.SIGINT, None)
    _interrupts.end()
    assert set_signals == {}
    assert not _interrupts.was_interrupted(ValueError())


@pytest.mark.parametrize(("error", "told"), [(Interruption(), False), (ValueError("x"), True)])
def test_only_interruptions_are_not_printed(monkeypatch, error, told):
    seen = []
    monkeypatch.setattr(sys, "__excepthook__", lambda *_: seen.append("printed"))
    monkeypatch.setattr(sys, "__unraisablehook__", lambda _: seen.append("unraisable"))
    _interrupts._tell_printed(type(error), error, None)
    _interrupts._tell_unraisable(SimpleNamespace(exc_value=error))
    assert seen == (["printed", "unraisable"] if told else [])
