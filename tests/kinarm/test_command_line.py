"""Options derived from dataclasses, and how commands end."""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from kinarm._command_line import (
    Parser,
    add_options,
    given_options,
    request_of,
    run_command,
    run_request,
)
from kinarm.errors import ArmError, WorkerError
from kinarm.problem_options import ProblemOptions


@dataclass(frozen=True, kw_only=True)
class Oven:
    """An oven.

    Parameters
    ----------
    heat : float
        How hot it is [K]. Never mind the door.
    fan : bool
        Whether the air moves.
    """

    heat: float = 450.0
    fan: bool = True


@dataclass(frozen=True, kw_only=True)
class Baking:
    """Bake something.

    Parameters
    ----------
    recipe : Path
        File of the recipe.
    guests : int
        Number of people.
    share : float
        Share of the flour that is rye, in 100 %.
    shape : {"loaf", "roll"}
        Form of the bread.
    names : tuple of str
        Names of the guests.
    minutes : tuple of int
        Minutes of each pass.
    topping : tuple of str
        What is strewn on it.
    quiet : bool
        Say nothing.
    knead : bool
        Whether it is kneaded.
    out : Path
        Where it goes.
    oven : Oven
        What it is baked in.
    window : tuple of float
        Width and height [m].
    """

    recipe: Path | None = field(default=None, metadata={"flag": "recipe"})
    guests: int = 4
    share: float = 0.25
    shape: Literal["loaf", "roll"] = "loaf"
    names: tuple[str, ...] = ()
    minutes: tuple[int, ...] = (20, 40)
    topping: tuple[str, ...] = field(default=(), metadata={"repeat": True, "metavar": "SEED"})
    quiet: bool = False
    knead: bool = True
    out: Path | None = field(default=None, metadata={"flag": "--output"})
    oven: Oven = field(default_factory=Oven)
    window: tuple[float, float] = (0.4, 0.3)


@dataclass(frozen=True, kw_only=True)
class Mixing:
    """Mix something.

    Parameters
    ----------
    what : str
        What is mixed.
    bowl : str
        What it is mixed in.
    speed : int
        Turns.
    """

    what: str = field(metadata={"flag": "what"})
    bowl: str
    speed: int = 1


def parsed(*arguments, kind=Baking, **settings):
    parser = Parser(prog="bake")
    add_options(parser, kind, **settings)
    return parser.parse_args([str(argument) for argument in arguments])


def refused(capsys, *arguments, **settings):
    """What is said on standard error of arguments that are refused."""
    with pytest.raises(SystemExit) as caught:
        parsed(*arguments, **settings)
    assert caught.value.code == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    return said.err


class TestOptions:
    def test_only_what_is_given_is_parsed(self):
        assert vars(parsed()) == {}
        assert given_options(parsed(), Baking) == {}
        assert request_of(parsed("--guests", 3), Baking) == Baking(guests=3)

    def test_every_kind_of_field(self):
        options = parsed(
            *("cake.toml", "--guests", 7, "--share", "1e-1", "--shape", "roll"),
            *("--names", "Ann", "Bob", "--minutes", 5, "--topping", "rye", "--topping", "salt"),
            *("--quiet", "--no-knead", "--output", "bread", "--oven-heat", 500, "--no-oven-fan"),
            *("--window", 1, 2),
        )
        assert given_options(options, Baking) == {
            "recipe": Path("cake.toml"),
            "guests": 7,
            "share": 0.1,
            "shape": "roll",
            "names": ("Ann", "Bob"),
            "minutes": (5,),
            "topping": ("rye", "salt"),
            "quiet": True,
            "knead": False,
            "out": Path("bread"),
            "oven": {"heat": 500.0, "fan": False},
            "window": (1.0, 2.0),
        }

    def test_fields_can_be_left_out(self, capsys):
        assert "unrecognized arguments: --guests" in refused(
            capsys, "--guests", 3, skip=("guests",)
        )

    def test_what_has_no_default_has_to_be_given(self, capsys):
        options = parsed("eggs", "--bowl", "pan", kind=Mixing)
        assert request_of(options, Mixing) == Mixing(what="eggs", bowl="pan")
        said = "the following arguments are required"
        assert f"{said}: what" in refused(capsys, "--bowl", "pan", kind=Mixing)
        assert f"{said}: --bowl" in refused(capsys, "eggs", kind=Mixing)

    def test_what_is_false_by_default_can_be_negatable(self):
        options = parsed("--no-quiet", negatable=True)
        assert given_options(options, Baking) == {"quiet": False}

    def test_options_of_others_are_left_alone(self):
        parser = Parser(prog="bake")
        add_options(parser, Baking)
        add_options(parser.add_argument_group("mixing"), Mixing)
        options = parser.parse_args(["--guests", "3", "--bowl", "pan", "cake.toml", "eggs"])
        assert given_options(options, Baking) == {"guests": 3, "recipe": Path("cake.toml")}
        assert request_of(options, Mixing) == Mixing(what="eggs", bowl="pan")

    def test_help_comes_from_the_docstring(self, capsys, monkeypatch):
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit):
            parsed("--help")
        lines = capsys.readouterr().out.splitlines()
        shown = {line.split()[0]: " ".join(line.split()) for line in lines if line.strip()}
        assert shown["--guests"] == "--guests N Number of people (4)"
        assert shown["--share"].endswith("Share of the flour that is rye, in 100 % (0.25)")
        assert shown["--shape"] == "--shape {loaf,roll} Form of the bread (loaf)"
        assert shown["--minutes"] == "--minutes N [N ...] Minutes of each pass (20 40)"
        assert shown["--topping"] == "--topping SEED What is strewn on it"
        assert shown["--quiet"] == "--quiet Say nothing"
        assert shown["--output"] == "--output FILE Where it goes"
        assert shown["--oven-heat"] == "--oven-heat X How hot it is [K] (450.0)"
        assert shown["recipe"] == "recipe File of the recipe"

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (("--guests", "many"), "argument --guests: must be a whole number, got 'many'"),
            (("--guests", "2.5"), "argument --guests: must be a whole number, got '2.5'"),
            (("--share", "half"), "argument --share: must be a finite number, got 'half'"),
            (("--share", "nan"), "argument --share: must be a finite number, got 'nan'"),
            (("--share", "inf"), "argument --share: must be a finite number, got 'inf'"),
            (("--share", "1e999"), "argument --share: must be a finite number"),
            (("--minutes", "5", "x"), "argument --minutes: must be a whole number, got 'x'"),
            (("--shape", "ring"), "argument --shape: invalid choice: 'ring'"),
            (("--oven-heat", "hot"), "argument --oven-heat: must be a finite number, got 'hot'"),
            (("--guests",), "argument --guests: expected one argument"),
            (("--names",), "argument --names: expected at least one argument"),
            (("--window", 1), "argument --window: expected 2 arguments"),
            (("--no-quiet",), "unrecognized arguments: --no-quiet"),
            (("--icing",), "unrecognized arguments: --icing"),
        ],
    )
    def test_bad_values_are_one_line(self, capsys, arguments, message):
        said = refused(capsys, *arguments)
        assert said.startswith("bake: ")
        assert message in said
        assert said.endswith("(see bake --help)\n")

    def test_problem_options_are_shared_by_the_commands(self):
        options = parsed(
            *("--problem", "both", "--arm", "paper_flange", "--tolerance", "0.1"),
            *("--horizon", "5", "--start-spread", "0.5", "--task", "left", "--scene", "right"),
            kind=ProblemOptions,
        )
        assert request_of(options, ProblemOptions) == ProblemOptions(
            problem="both",
            arm="paper_flange",
            task="left",
            scene="right",
            tolerance=0.1,
            horizon=5,
            start_spread=0.5,
        )


class TestCommands:
    @pytest.mark.parametrize(
        ("raised", "status", "said"),
        [
            (None, 0, ""),
            (ArmError("no\narm"), 2, "bake: no arm\n"),
            (WorkerError("a worker ended"), 1, "bake: a worker ended\n"),
            (KeyboardInterrupt(), 130, "bake: interrupted\n"),
            (KeyboardInterrupt("stopped at 3"), 130, "bake: stopped at 3\n"),
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

    @pytest.mark.parametrize(
        ("statement", "status", "said"),
        [
            ("raise BrokenPipeError", 0, ""),
            ("raise OSError(28, 'No space left', 'bread')", 1, "bake: bread: No space left\n"),
            ("raise MemoryError('Unable to allocate')", 1, "bake: out of memory: Unable to"),
            ("raise OSError(5, 'Input/output error')", 1, "bake: standard output: Input/output"),
        ],
    )
    def test_output_that_cannot_be_written(self, statement, status, said):
        code = (
            "from kinarm._command_line import run_command\n"
            f"def command():\n    print('crumbs')\n    {statement}\n"
            "run_command('bake', command)\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False
        )
        assert done.returncode == status
        assert done.stderr.startswith(said)
        assert done.stderr.count("\n") == bool(said)

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
