"""The plant: what lies between commands and joints, and between joints and what is seen."""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

from kinarm._fields import OPTIONAL, Checked, from_plain, read_toml
from kinarm._files import named_file, shipped_files
from kinarm.errors import NOT_NEGATIVE, ProblemError

LONGEST_DELAY = 32
"""Largest delay [steps]: an episode holds as many commands."""

FASTEST_SERVO = 1e4
"""Largest bandwidth [Hz]."""

Range = float | tuple[float, float]
"""A number, or a range from which each episode draws one."""

SETTING = {**OPTIONAL, **NOT_NEGATIVE}


@dataclass(frozen=True, kw_only=True)
class Plant(Checked):
    """What lies between a command and the joints, and between the joints and what is seen.

    Each setting is a number, or a range from which every episode draws its own,
    uniformly. Zero leaves an effect out. In each step an action moves the
    command; with a delay, servos get an earlier one. Joints never exceed their
    velocity limits.

    Parameters
    ----------
    delay : int or tuple of int
        Steps by which a command comes late, 32 at most.
    bandwidth : float or tuple of float
        Natural frequency of the servos [Hz]; 0 for joints that obey at once.
    damping : float or tuple of float
        Their damping ratio; 1 is critical.
    acceleration : float or tuple of float
        Largest acceleration of a joint [rad/s^2 or m/s^2]: servos are cut off
        there.
    resolution : float or tuple of float
        Steps in which joints are commanded [rad or m].
    noise : float or tuple of float
        Standard deviation of each measurement of a joint [rad or m].
    bias : float or tuple of float
        Measured joints are off by up to it, each by its own amount, throughout
        an episode [rad or m].
    calibration : float or tuple of float
        Joints are up to so far from where both command and measurement have
        them [rad or m].
    goal_noise : float or tuple of float
        Standard deviation of each coordinate of the goal, as seen in a step [m].
    goal_bias : float or tuple of float
        The goal is seen up to so far from where it is, along each axis [m].
    feedback : {"measured", "commanded"}
        Which joint positions are seen: measured ones, or the command's. Actions
        count from the command.
    """

    delay: int | tuple[int, int] = field(default=0, metadata={**OPTIONAL, "at_least": 0})
    bandwidth: Range = field(default=0.0, metadata=SETTING)
    damping: Range = field(default=1.0, metadata=SETTING)
    acceleration: Range = field(default=0.0, metadata=SETTING)
    resolution: Range = field(default=0.0, metadata=SETTING)
    noise: Range = field(default=0.0, metadata=SETTING)
    bias: Range = field(default=0.0, metadata=SETTING)
    calibration: Range = field(default=0.0, metadata=SETTING)
    goal_noise: Range = field(default=0.0, metadata=SETTING)
    goal_bias: Range = field(default=0.0, metadata=SETTING)
    feedback: Literal["measured", "commanded"] = field(default="measured", metadata=OPTIONAL)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in RANGES:
            lower, upper = self.range_of(name)
            if lower > upper:
                raise ProblemError(f"{name} must be a range from low to high, got {lower}, {upper}")
            if lower == 0 < upper and name in ("bandwidth", "acceleration"):
                raise ProblemError(f"a range of {name} starts above 0, which stands for no limit")
        if self.range_of("acceleration")[1] and not self.range_of("bandwidth")[1]:
            raise ProblemError("acceleration is limited in servos: it needs a bandwidth")
        if self.range_of("delay")[1] > LONGEST_DELAY:
            raise ProblemError(f"delay must be at most {LONGEST_DELAY} steps, got {self.delay}")
        if self.range_of("bandwidth")[1] > FASTEST_SERVO:
            raise ProblemError(f"bandwidth must be at most {FASTEST_SERVO:g} Hz")

    @classmethod
    def load(cls, plant: "Plant | str | Path") -> "Plant":
        """Find a plant by name, such as ``"hard"``, or read it from a TOML file."""
        if isinstance(plant, Plant):
            return plant
        path = named_file("plant", plant)
        return from_plain(cls, read_toml(path, "plant"), str(path))

    @property
    def ideal(self) -> bool:
        """Whether joints are where they are told to be, and so seen."""
        return not any(self.range_of(name)[1] for name in RANGES if name != "damping")

    def range_of(self, name: str) -> tuple[float, float]:
        """Lower and upper end of a setting."""
        value = getattr(self, name)
        return value if isinstance(value, tuple) else (value, value)


MOST_NOISE = 3.5
"""Largest noise in standard deviations."""

RANGES = tuple(item.name for item in fields(Plant) if item.name != "feedback")
"""Names of the settings that an episode draws, in the order in which kernels have them."""


def plant_names() -> tuple[str, ...]:
    """Names of the plants that ship."""
    return tuple(shipped_files("plants"))
