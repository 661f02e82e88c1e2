"""Options derived from dataclasses, and what help says of them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from kinarm._options import add_options, given_options, request_of
from kinarm._parser import Parser


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

    def test_what_has_no_default_has_to_be_given(self, capsys):
        options = parsed("eggs", "--bowl", "pan", kind=Mixing)
        assert request_of(options, Mixing) == Mixing(what="eggs", bowl="pan")
        said = "the following arguments are required"
        assert f"{said}: what" in refused(capsys, "--bowl", "pan", kind=Mixing)
        assert f"{said}: --bowl" in refused(capsys, "eggs", kind=Mixing)

    def test_what_is_false_by_default_can_be_negated(self):
        options = parsed("--no-quiet", explicit=True)
        assert given_options(options, Baking) == {"quiet": False}

    def test_help_comes_from_the_docstring(self, capsys, monkeypatch):
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit):
            parsed("--help")
        lines = capsys.readouterr().out.splitlines()
        shown = {line.split()[0]: " ".join(line.split()) for line in lines if line.strip()}
        assert shown["--guests"] == "--guests N Number of people (default: 4)"
        assert shown["--share"].endswith("Share of the flour that is rye, in 100 % (default: 0.25)")
        assert shown["--shape"] == "--shape {loaf,roll} Form of the bread (default: loaf)"
        assert shown["--minutes"] == "--minutes N [N ...] Minutes of each pass (default: 20 40)"
        assert shown["--topping"] == "--topping SEED What is strewn on it"
        assert shown["--quiet"] == "--quiet Say nothing"
        assert shown["--output"] == "--output FILE Where it goes"
        assert shown["--oven-heat"] == "--oven-heat X How hot it is [K] (default: 450.0)"
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
