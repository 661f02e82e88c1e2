"""Where the parts of an observation are, for an arm."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, ProblemError, finite_array
from kinarm.goals import REST_PARTS
from kinarm.kernels.compiling import Array
from kinarm.kernels.network import turn_away
from kinarm.observation import OBSERVATION, VERSION
from kinarm.observation_part import ACTUATED, JOINTS, ONCE, SLOTS, Part, Ranges
from kinarm.problem import ReachProblem

GOAL_KEYS = ("observation", "achieved_goal", "desired_goal")
"""Entries of a dictionary observation; the achieved goal is what the tool has reached."""

WITH_MEMORY = {"joint_velocities", "last_action", "time_left"}
"""Parts that tell of earlier steps."""


class ObservationLayout(NamedTuple):
    """Where the parts of a problem's observation are.

    Attributes
    ----------
    parts : tuple of Part
        The parts of a step's observation, one after the other.
    counts : mapping of str to int
        How often those of each kind (`Part.of`) are there.
    history : int
        Steps that are shown, the last one first.
    """

    parts: tuple[Part, ...]
    counts: Mapping[str, int]
    history: int = 1

    @classmethod
    def of(cls, problem: ReachProblem, arm: Arm) -> "ObservationLayout":
        """The layout of a problem and its arm; ProblemError if they cannot have a part."""
        layout = cls.sized(problem, arm.n_joints, arm.n_actuated)
        for part in layout.parts:
            if reason := part.lacks(arm, problem.scene):
                raise ProblemError(f"the observation cannot have {part.name!r}: {reason}")
        return layout

    @classmethod
    def sized(cls, problem: ReachProblem, n_joints: int, n_actuated: int) -> "ObservationLayout":
        """The layout for an arm with so many joints."""
        known, chosen = {part.name: part for part in OBSERVATION}, problem.observation
        parts = tuple(known[name] for name in chosen.names(problem.task.goal.kind))
        counts = {ONCE: 1, JOINTS: n_joints, ACTUATED: n_actuated, SLOTS: chosen.obstacle_slots}
        return cls(parts, counts, chosen.history)

    @classmethod
    def filling(cls, problem: ReachProblem, size: int, n_actuated: int) -> "ObservationLayout":
        """The layout for the fewest joints that fill so many entries, as of a policy's mean."""
        for n_joints in range(1, size + 1):
            layout = cls.sized(problem, n_joints, n_actuated)
            if layout.size >= size:
                return layout
        raise InvalidInputError(f"mean has {size} values, its observation has fewer")

    def length(self, part: Part) -> int:
        """Number of entries of a part in the observation of a step."""
        return (len(part.signs) + self.slopes(part)) * self.counts[part.of]

    def slopes(self, part: Part) -> int:
        """Number of entries of actuated joints that each of a part is followed by."""
        return self.counts[ACTUATED] if part.sloped else 0

    @property
    def width(self) -> int:
        """Length of the observation of a step."""
        return sum(map(self.length, self.parts))

    @property
    def size(self) -> int:
        """Length of an observation."""
        return self.width * self.history

    @property
    def places(self) -> dict[str, slice]:
        """Place of each part, by name, in the last step's observation, which comes first."""
        ends = np.cumsum([self.length(part) for part in self.parts]).tolist()
        pairs = zip(self.parts, ends, strict=True)
        return {part.name: slice(end - self.length(part), end) for part, end in pairs}

    @property
    def shown(self) -> NDArray[np.uint32]:
        """First entry of each part, and how often it is there, shape (n_parts, 2), for kernels."""
        places = zip(self.parts, self.places.values(), strict=True)
        rows = [(place.start, self.counts[part.of]) for part, place in places]
        return np.array(rows, dtype=np.uint32).reshape(-1, 2)

    def rules(self, problem: ReachProblem) -> dict[str, Any]:
        """What `kinarm.episodes.Rules` have of it."""
        turned = problem.task.goal.kind in ("direction", "pose")
        newton, near, places = 0, -1, self.places
        if {"resolved_rate", "proximity"} & places.keys():
            newton = 6 if turned else 3
        if "proximity" in places:
            near = places["proximity"].start
        return {"shown": self.shown, "width": self.width, "newton": newton, "near": near}

    @property
    def side(self) -> int | None:
        """Entry of the goal's y, which is positive on the left [m]; None if it is not shown."""
        goal = self.places.get("goal")
        return None if goal is None else goal.start + 1

    @property
    def goal_entries(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Entries of the goal, and of goal less tool; InvalidInputError if one is not shown."""
        places, pairs = self.places, [("goal", "goal_minus_tool")]
        pairs += [pair for pair in REST_PARTS.values() if set(pair) & places.keys()]
        try:
            slices = [[places[name] for name in names] for names in zip(*pairs, strict=True)]
        except KeyError as error:
            raise InvalidInputError(
                f"goals as a dictionary need the part {error} of the observation, which has "
                f"{', '.join(self.places)}"
            ) from error
        goal, offset = (np.r_[tuple(part)] for part in slices)
        return goal, offset

    def flat(self, given: Mapping[str, ArrayLike]) -> Array:
        """Make a flat observation of a dictionary observation, shape (..., n_observations).

        It holds just ``observation``, shape (..., n_own), ``achieved_goal`` and ``desired_goal``,
        shape (..., goal_width) [m].
        """
        if set(given) != set(GOAL_KEYS):
            wanted, found = (", ".join(map(str, keys)) for keys in (GOAL_KEYS, given))
            raise InvalidInputError(f"a dictionary observation has the keys {wanted}, got {found}")
        (goals, offsets), entries = self.goal_entries, self.entries(of_goal=False)
        if len(goals) + len(offsets) + len(entries) < self.size:
            raise InvalidInputError(
                "a policy that sees resolved_rate or a history needs a flat observation"
            )
        batch = np.shape(given["desired_goal"])[:-1]
        rows = (None,) * len(batch)
        goal, tool = (
            finite_array(name, given[name], (*rows, len(goals)))
            for name in ("desired_goal", "achieved_goal")
        )
        rest = finite_array("observation", given["observation"], (*rows, len(entries)))
        flat = np.empty((*batch, self.size))
        flat[..., goals], flat[..., offsets], flat[..., entries] = goal, goal - tool, rest
        return flat

    @property
    def remembers(self) -> bool:
        """Whether it tells of earlier steps."""
        return self.history > 1 or not WITH_MEMORY.isdisjoint(self.places)

    @property
    def sees_bodies(self) -> bool:
        """Whether a part tells of bodies of the scene."""
        return bool({"proximity", "obstacles"} & self.places.keys())

    def turn_away(self, observations: Array, actions: NDArray[Any]) -> None:
        """Turn actions off bodies, in place, if ``proximity`` is seen: see `keep_away`.

        Both have one row, or the shapes (n, n_observations) and (n, n_actuated).
        """
        if (near := self.places.get("proximity")) is not None:
            seen = np.ascontiguousarray(observations).reshape(-1, self.size)
            rows = actions.reshape(len(seen), -1)
            turn_away(seen, near.start, self.counts[JOINTS], rows)

    def entries(self, *, of_goal: bool) -> NDArray[np.int64]:
        """Entries of the parts that depend on the goal, or of the others, of all steps."""
        chosen = np.concatenate([np.full(self.length(p), p.of_goal == of_goal) for p in self.parts])
        return np.flatnonzero(np.tile(chosen, self.history))

    def signs(self, axes: Array) -> Array:
        """Signs of entries in the reflection y -> -y, shape (n_observations,).

        Takes those of the joints, shape (n_joints,).
        """
        signs = []
        for part in self.parts:
            rows = np.tile(np.array(part.signs, dtype=np.float64), (self.counts[part.of], 1))
            of_joint = axes[: len(rows), None] if 0 in part.signs else 1.0
            slopes = np.tile(axes[: self.slopes(part)], (len(rows), 1))
            signs.append(np.hstack([np.where(rows == 0, of_joint, rows), slopes]).ravel())
        return np.tile(np.concatenate(signs), self.history)

    def bounds(self, ranges: Ranges) -> tuple[Array, Array]:
        """Lowest and highest values of the entries, shape (n_observations,) each."""
        pairs = [(part, part.bounds(ranges)) for part in self.parts]
        lower, upper = (
            np.concatenate([self._repeated(part, each[end]) for part, each in pairs])
            for end in (0, 1)
        )
        return np.tile(lower, self.history), np.tile(upper, self.history)

    def _repeated(self, part: Part, values: ArrayLike) -> Array:
        """Values of a part's entries, given for all joints, for one, or one for all."""
        array = np.asarray(values, dtype=np.float64)
        if array.shape == (self.length(part),):
            return array
        once = np.broadcast_to(array, len(part.signs))
        return np.tile(once, self.counts[part.of])


def observation_layout(problem: ReachProblem) -> str:
    """Names and lengths of a problem's parts, to compare."""
    layout, chosen = ObservationLayout.sized(problem, 1, 1), problem.observation
    parts = (f"{part.name} {len(part.signs)}{'+a' * part.sloped}{part.of}" for part in layout.parts)
    slots = f"; k = {chosen.obstacle_slots}" if any(p.of == SLOTS for p in layout.parts) else ""
    history = f"; history {chosen.history}" if chosen.history > 1 else ""
    return f"{VERSION}: {', '.join(parts)}{slots}{history}"
