"""How commands run and end."""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from kinarm._command_line import run_command, run_request
from kinarm.errors import ArmError, WorkerError


@dataclass(frozen=True, kw_only=True)
class Baking:
    """Bake something.

    Parameters
    ----------
    recipe : Path
        File of the recipe.
    share : float
        Share of the flour that is rye.
    """

    recipe: Path | None = field(default=None, metadata={"flag": "recipe"})
    share: float = 0.25


class TestCommands:
    @pytest.mark.parametrize(
        ("raised", "status", "said"),
        [
            (None, 0, ""),
            (ArmError("no\narm"), 2, "bake: no arm\n"),
            (WorkerError("a worker ended"), 1, "bake: a worker ended\n"),
            (KeyboardInterrupt(), 130, "bake: interrupted\n"),
            (KeyboardInterrupt("stopped at 3"), 130, "bake: stopped at 3\n"),
            (BrokenPipeError(), 0, ""),
            (OSError(28, "No space left", "bread"), 1, "bake: bread: No space left\n"),
            (OSError(5, "Input/output error"), 1, "bake: standard output: Input/output error\n"),
            (MemoryError(), 1, "bake: out of memory: no more to be had\n"),
            (SystemExit(5), 5, ""),
            (SystemExit(None), 0, ""),
        ],
    )
    def test_exit_status_and_one_line(self, capsys, raised, status, said):
        def command():
            if raised is not None:
                raise raised

        with pytest.raises(SystemExit) as caught:
            run_command("bake", command)
        assert caught.value.code == status
        assert capsys.readouterr() == ("", said)

    def test_other_errors_are_not_hidden(self):
        def command():
            raise ZeroDivisionError

        with pytest.raises(ZeroDivisionError):
            run_command("bake", command)

    def test_a_reader_that_leaves_is_no_failure(self):
        code = (
            "from kinarm._command_line import run_command\n"
            "run_command('bake', lambda: print('crumb\\n' * 100_000))\n"
        )
        reading, writing = os.pipe()
        os.close(reading)
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=writing, stderr=subprocess.PIPE, check=False
        )
        os.close(writing)
        assert (done.returncode, done.stderr) == (0, b"")

    @pytest.mark.parametrize("given", [True, False])
    def test_a_request_is_run_with_the_command_as_typed(self, monkeypatch, given):
        typed, reported = ["a b", "--share=1"], []
        monkeypatch.setattr(sys, "argv", ["/usr/bin/bake", *(["other"] if given else typed)])
        with pytest.raises(SystemExit) as stopped:
            run_request(
                "bake", Baking, lambda *both: reported.append(both), typed if given else None
            )
        assert not stopped.value.code
        assert reported == [(Baking(recipe=Path("a b"), share=1.0), "bake 'a b' --share=1")]

    def test_help_of_a_request_begins_with_its_first_line_and_keeps_the_epilog(self, capsys):
        with pytest.raises(SystemExit) as stopped:
            run_request(
                "bake", Baking, print, ["--help"], epilog="try:\n  bake it", skip=("share",)
            )
        shown = capsys.readouterr().out
        assert not stopped.value.code
        assert "Bake something.\n" in shown
        assert shown.endswith("try:\n  bake it\n")
        assert "--share" not in shown


class TestStreams:
    """Whatever standard output is, the status tells what happened."""

    SCRIPT = (
        "from kinarm._command_line import run_command\n"
        "run_command('bake', lambda: print('br\u00f6tchen'))\n"
    )

    def run(self, command, **env):
        script = f'"{sys.executable}" -X utf8=0 -c "$SCRIPT" {command}'
        env = {**os.environ, "SCRIPT": self.SCRIPT, **env}
        return subprocess.run(
            ["/bin/sh", "-c", script], capture_output=True, env=env, timeout=60, check=False
        )

    @pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&-"])
    def test_closed_streams(self, closed):
        done = self.run(closed)
        assert (done.returncode, done.stderr) == (0, b"")

    def test_encodings_without_the_letter(self):
        done = self.run("", PYTHONIOENCODING="ascii")
        assert (done.returncode, done.stderr) == (0, b"")
        assert done.stdout == b"br\\xf6tchen\n"
