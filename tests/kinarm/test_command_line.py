"""How commands run and end, their options, and what help says of them."""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from kinarm._command_line import add_options, given_options, run_command, run_request
from kinarm._parser import Parser
from kinarm.errors import ArmError, WorkerError


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
    names: tuple[str, ...] = field(default=(), metadata={"names": lambda: ("Ann", "it's Bob")})
    minutes: tuple[int, ...] = (20, 40)
    topping: tuple[str, ...] = field(default=(), metadata={"repeat": True, "metavar": "SEED"})
    quiet: bool = False
    knead: bool = True
    out: Path | None = field(default=None, metadata={"flag": "--output", "metavar": "FOLDER"})
    oven: Oven = field(default_factory=Oven)
    window: tuple[float, float] = (0.4, 0.3)


class TestCommands:
    @pytest.mark.parametrize(
        ("raised", "status", "said"),
        [
            (None, 0, ""),
            (ArmError("no\narm"), 2, "bake: no arm\n"),
            (WorkerError("a worker ended"), 1, "bake: a worker ended\n"),
            (KeyboardInterrupt("stopped at 3"), 130, "bake: stopped at 3\n"),
            (BrokenPipeError(), 0, ""),
            (OSError(28, "No space left", "bread"), 1, "bake: bread: No space left\n"),
            (MemoryError(), 1, "bake: out of memory: no more to be had\n"),
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


def test_letters_that_an_encoding_lacks_are_escaped():
    code = (
        "from kinarm._command_line import run_command\n"
        "run_command('bake', lambda: print('br\u00f6tchen'))\n"
    )
    env = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=env, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"br\\xf6tchen\n", b"")


def parsed(*arguments):
    parser = Parser(prog="bake")
    add_options(parser, Baking)
    return parser.parse_args([str(argument) for argument in arguments])


class TestOptions:
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

    @pytest.mark.parametrize("low", ["-1e-05", "-1E3", "-.5e-2", "-2.5"])
    def test_negative_numbers_are_values(self, low):
        assert parsed("cake.toml", "--window", low, "2", "--share", low).window == [float(low), 2.0]

    def test_help_comes_from_the_docstring(self, capsys, monkeypatch):
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit):
            parsed("--help")
        lines = capsys.readouterr().out.splitlines()
        shown = {line.split()[0]: " ".join(line.split()) for line in lines if line.strip()}
        assert shown["--guests"] == "--guests N Number of people (default: 4)"
        assert shown["--share"].endswith("Share of the flour that is rye, in 100 % (default: 0.25)")
        assert shown["--shape"] == "--shape {loaf,roll} Form of the bread (default: loaf)"
        assert shown["--topping"] == "--topping SEED What is strewn on it"
        assert shown["--oven-heat"] == "--oven-heat X How hot it is [K] (default: 450.0)"
        assert shown["recipe"] == "recipe File of the recipe"

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (("--guests", "many"), "argument --guests: must be a whole number, got 'many'"),
            (("--shape", "ring"), "argument --shape: invalid choice: 'ring'"),
            (("--oven-heat", "hot"), "argument --oven-heat: must be a finite number, got 'hot'"),
            (("--window", 1), "argument --window: expected 2 arguments"),
        ],
    )
    def test_bad_values_are_one_line(self, capsys, arguments, message):
        with pytest.raises(SystemExit) as caught:
            parsed(*arguments)
        assert caught.value.code == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.startswith(f"bake: {message}")
        assert said.err.count("\n") == 1
