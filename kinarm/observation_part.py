"""A part of the observation, and what it is told of a problem."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from kinarm.kernels.compiling import Array
from kinarm.kernels.session import Session
from kinarm.kernels.surroundings import Seen
from kinarm.scene import Scene

if TYPE_CHECKING:
    from kinarm.arm import Arm

ONCE, JOINTS, ACTUATED, SLOTS = "", "n", "a", "k"
"""What has a part: the arm, each joint, each actuated joint, or each slot for a body."""

UNIT = 1 + 1e-6
"""Largest entry of a unit vector or an action, to within rounding."""


class Ranges(NamedTuple):
    """Ranges of the entries of an observation in a problem.

    A box of all goals with tolerance, a bound on the distance from the world's origin to any point
    of the arm [m], the joints' limits [rad or m], and the actuated ones' largest velocities, as
    fractions of theirs; joints and velocities as they are measured.
    """

    goal_lower: Array
    goal_upper: Array
    reach: float
    lower: Array
    upper: Array
    fastest: Array


class Part(NamedTuple):
    """A part of the observation.

    Attributes
    ----------
    name, meaning : str
        Its name in layouts, and its meaning for people.
    signs : tuple of int
        Signs of its entries in the reflection y -> -y; 0 for that of the joint.
    write : callable
        Formula; see `write_goal`.
    unit : str
        For people; by default they have none.
    bounds : callable
        From `Ranges` to lowest and highest values of its entries, by default
        those of unit vectors and actions.
    of : str
        What has one: `ONCE`, `JOINTS`, `ACTUATED` or `SLOTS`.
    sloped : bool
        Whether each is followed by what each actuated joint adds to it.
    of_goal : bool
        Whether it depends on the goal.
    lacks : callable
        From arm and scene to why they cannot have it, or an empty text.
    """

    name: str
    meaning: str
    signs: tuple[int, ...]
    write: Callable[[Session, Seen, int, int], None]
    unit: str = "1"
    bounds: Callable[[Ranges], tuple[Array | float, Array | float]] = lambda _: (-UNIT, UNIT)
    of: str = ONCE
    sloped: bool = False
    of_goal: bool = False
    lacks: Callable[["Arm", Scene], str] = lambda *_: ""
