"""Requests to end, at moments that a process chooses itself."""

import os
import signal
import subprocess
import sys
import textwrap

import pytest

BEFORE = """
import os, signal, sys, time
from kinarm._command_line import run_command
from kinarm._interrupts import telling

def ask(request=signal.SIGINT):
    os.kill(os.getpid(), request)
    time.sleep(0)

"""


def answer_all():
    """Signals that these tests are told to ignore are not ignored by what they run."""
    for request in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(request, signal.SIG_DFL)


@pytest.fixture
def run(tmp_path):
    """Run a script that is called as a command is; return its status, output and errors."""

    def call(source, name="kinarm-bake", before=BEFORE, **settings):
        script = tmp_path / name
        script.write_text(before + textwrap.dedent(source))
        done = subprocess.run(
            [sys.executable, str(script)],
            **{"preexec_fn": answer_all, **settings},
            env={**os.environ, "PYTHONUNBUFFERED": ""},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        return done.returncode, done.stdout, done.stderr

    return call


INTERRUPTED = 130, "", "bake: interrupted\n"


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_command_says_so_in_one_line(run, name):
    assert run(f"run_command('bake', lambda: ask(signal.{name}))") == INTERRUPTED


def test_what_is_left_is_told(run):
    source = """
    def command():
        with telling(lambda: f"burnt after {minutes} min"):
            for minutes in range(5):
                if minutes == 3:
                    try:
                        ask()
                    except KeyboardInterrupt:
                        raise OSError
    run_command('bake', command)
    """
    assert run(source) == (130, "", "bake: burnt after 3 min\n")


def test_a_request_that_is_ignored_from_the_start_stays_ignored(run):
    """As shells do for commands in the background, and nohup for SIGHUP."""
    ignore = lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)  # noqa: E731
    source = "run_command('bake', lambda: ask() or print('bread'))"
    assert run(source, preexec_fn=ignore) == (0, "bread\n", "")


def test_programs_that_only_use_kinarm_keep_their_own_ways(run):
    source = """
    import signal
    from kinarm._command_line import run_command
    try:
        run_command("bake", lambda: None)
    finally:
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    """
    assert run(source, "bake", before="") == (0, "", "")


def test_children_that_are_kept_from_it(run):
    source = """
    import subprocess
    from kinarm._interrupts import kept_from_children
    with kept_from_children():
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1)"])
    child.send_signal(signal.SIGINT)
    child.send_signal(signal.SIGHUP)
    assert child.wait() == 0
    run_command('bake', ask)
    """
    assert run(source) == INTERRUPTED
