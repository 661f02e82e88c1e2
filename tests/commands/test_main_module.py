"""``kinarm`` and ``python -m kinarm``, and the version that every command tells."""

import subprocess
import sys
from importlib import metadata

import pytest

from kinarm.__main__ import COMMANDS, main

SCRIPTS = {
    script.name: script.value.removesuffix(":main")
    for script in metadata.distribution("kinarm").entry_points
    if script.group == "console_scripts" and script.name != "kinarm"
}


def type_in(*words):
    command = [sys.executable, "-m", "kinarm", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_it_knows_all_commands_and_no_other():
    assert {f"kinarm-{name}": module for name, (module, _) in COMMANDS.items()} == SCRIPTS


@pytest.fixture
def run_main(capsys):
    """Run it in this process."""

    def call(*words):
        with pytest.raises(SystemExit) as stopped:
            main(words)
        return stopped.value.code or 0, *capsys.readouterr()

    return call


def test_without_a_command_it_lists_them(run_main):
    status, out, err = run_main()
    assert (status, err) == (0, "")
    assert all(name in out for name in SCRIPTS)
    assert out.index("to:") < out.index("kinarm-eval") < out.index("--help")
    assert all(len(line) <= 80 for line in out.splitlines())


def test_it_runs_the_command_that_is_named(run_main):
    done = type_in("problem", "list")
    assert (done.returncode, done.stderr) == (0, "")
    assert "shelf-panda" in done.stdout
    assert run_main("problem", "list") == (0, done.stdout, "")
    assert "usage: kinarm-eval" in run_main("eval", "--help")[1]
    assert run_main("--", "problem", "list") == (0, done.stdout, "")


def test_an_unknown_command_is_refused_in_one_line(run_main):
    status, out, err = run_main("fly")
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert "invalid choice: 'fly' (choose from " in err


@pytest.mark.parametrize("program", SCRIPTS)
def test_every_command_tells_the_version(run, program):
    answer = run(program, "--version")
    assert (answer.status, answer.err) == (0, "")
    assert answer.out == f"kinarm {metadata.version('kinarm')}\n"
