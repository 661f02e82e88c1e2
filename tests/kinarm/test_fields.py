"""Dataclasses from plain values and back, and what their docstrings say about them."""

import json
import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from kinarm._fields import Checked, field_docs, from_plain, init_fields, to_plain
from kinarm.errors import InvalidInputError, ProblemError, check_range


@dataclass(frozen=True, kw_only=True)
class Wheel(Checked):
    """A wheel.

    Parameters
    ----------
    radius : float
        From the hub to the ground [m]. Larger ones are slower.
    spokes : int
        Number of spokes.
    """

    radius: float
    spokes: int = 28

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.radius <= 0:
            raise ProblemError(f"radius must be above 0 m, got {self.radius}")


@dataclass(frozen=True, kw_only=True)
class Bicycle(Checked):
    """A bicycle.

    Parameters
    ----------
    name : str
        What it is called.
    wheels : tuple of Wheel
        Front and rear.
    saddle, handlebar : tuple of float
        Where they are [m].
    gears : tuple of int
        Teeth of each.
    colour : {"red", "blue"}
        Colour of the frame.
    bell : bool
        Whether it has one.
    picture : Path
        File that shows it.
    spare : Wheel, optional
        Another wheel.
    notes : dict
        Anything else.

    Raises
    ------
    ProblemError
        Never.
    """

    name: str
    wheels: tuple[Wheel, ...] = ()
    saddle: tuple[float, float] = (0.0, 1.0)
    handlebar: tuple[float, float] = (0.5, 1.0)
    gears: tuple[int, ...] = (11, 13)
    colour: Literal["red", "blue"] = "red"
    bell: bool = True
    picture: Path | None = None
    spare: Wheel | None = None
    notes: dict[str, Any] = field(default_factory=dict)


@pytest.mark.parametrize("character", ["\x1b", "\n", "\x9b", "\u202e"])
def test_texts_have_no_control_characters(character):
    with pytest.raises(InvalidInputError, match=r"bad.toml: .* must be printable on a line, got '"):
        from_plain(Bicycle, {"name": f"a{character}b"}, "bad.toml")


@pytest.mark.parametrize("sign", [1, -1])
def test_numbers_are_at_most_a_million(sign):
    check_range("size", sign * 1e6, {})
    with pytest.raises(InvalidInputError, match=r"size must be at most 1e\+06"):
        check_range("size", sign * np.nextafter(1e6, np.inf), {})


wheels = st.builds(Wheel, radius=st.floats(1e-6, 1e6), spokes=st.integers(1, 2**63 - 1))
numbers = st.floats(-1e6, 1e6)
bicycles = st.builds(
    Bicycle,
    name=st.text().filter(str.isprintable),
    wheels=st.lists(wheels, max_size=3).map(tuple),
    saddle=st.tuples(numbers, numbers),
    gears=st.lists(st.integers(1, 2**63 - 1)).map(tuple),
    colour=st.sampled_from(["red", "blue"]),
    bell=st.booleans(),
    picture=st.none() | st.text("abc/. ", min_size=1).map(Path),
    spare=st.none() | wheels,
)


@settings(max_examples=40)
@given(bicycles)
def test_json_and_toml_are_without_loss(bicycle):
    plain = to_plain(bicycle)
    assert from_plain(Bicycle, json.loads(json.dumps(plain)), "it") == bicycle
    assert from_plain(Bicycle, tomllib.loads(tomli_w.dumps(plain)), "it") == bicycle


class TestFromPlain:
    def build(self, **changes):
        return from_plain(Bicycle, {"name": "a", **changes}, "shed.toml")

    def test_nested(self):
        made = self.build(wheels=[{"radius": 1}, {"radius": 0.5, "spokes": 3}], spare={"radius": 2})
        assert made.wheels == (Wheel(radius=1.0), Wheel(radius=0.5, spokes=3))
        assert made.spare == Wheel(radius=2)

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"pedals": 2}, "unknown key 'pedals'; available: name, wheels, saddle"),
            ({"gears": [1, 2.5]}, r"gears\[1\] must be a whole number, got 2.5"),
            ({"saddle": [1]}, r"saddle must be a list of 2, each a number \[m\], got \[1\]"),
            ({"colour": "pink"}, "colour must be one of red, blue, got 'pink'"),
            ({"picture": 1}, "picture must be a path, got 1"),
            ({"wheels": [{"spokes": 3}]}, r"'wheels\[0\].radius' is missing: From the hub to"),
            ({"spare": {"radius": 0}}, "spare: radius must be above 0 m, got 0"),
            ({"spare": {"radius": 10**400}}, r"spare.radius must be a number \[m\], got 1000"),
            ({"wheels": [None]}, r"wheels\[0\] must be a table, got None"),
        ],
    )
    def test_one_line_names_source_key_and_what_is_expected(self, changes, message):
        with pytest.raises(InvalidInputError, match=f"^shed.toml: {message}") as caught:
            self.build(**changes)
        assert "\n" not in str(caught.value)


def test_values_become_what_is_annotated():
    made = Bicycle(
        name="a",
        wheels=[Wheel(radius=1), {"radius": 2}],
        saddle=np.array([-0.0, 2]),
        gears=[np.int64(11)],
        bell=np.bool_(False),
        picture="a.png",
    )
    assert made == Bicycle(
        name="a",
        wheels=(Wheel(radius=1.0), Wheel(radius=2.0)),
        saddle=(0.0, 2.0),
        gears=(11,),
        bell=False,
        picture=Path("a.png"),
    )
    assert (type(made.gears[0]), type(made.saddle[0])) == (int, float)
    assert math.copysign(1, made.saddle[0]) == 1
    with pytest.raises(InvalidInputError, match="^spare must be a table, got Bicycle"):
        Bicycle(name="a", spare=Bicycle(name="b"))


def test_descriptions_of_the_fields():
    docs = field_docs(Bicycle)
    assert list(docs) == list(init_fields(Bicycle))
    assert docs["saddle"] == docs["handlebar"] == "Where they are [m]."
    assert docs["notes"] == "Anything else."
