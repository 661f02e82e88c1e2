"""Everything of a batch of episodes in one object, with work space for a block in lanes."""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from llvmlite import ir
from numba import types
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.contact_shapes import PLANE, ContactShapes
from kinarm.episodes import Control, Episodes, Rules
from kinarm.kernels.compiling import Array, Stage, helper, lean_kernel
from kinarm.kernels.kinematics import POSE, place_bodies
from kinarm.kernels.lane_copies import move_bodies, put, put_scene, take, take_rows
from kinarm.kernels.lanes import LANES, as_numbers, instruction, lanes
from kinarm.kernels.records import Fixed, Layout, Record, Shapes, table
from kinarm.kernels.views import ViewType

ONE, THREE = Fixed(1), Fixed(3)

POSES = ViewType(lanes, 2)
"""Type of poses in lanes."""

Block: TypeAlias = Any
"""Work space of a block of episodes, a record of lanes (`layouts`)."""

Alone: TypeAlias = Any
"""Work space for an episode of a block, a record of numbers (`layouts`)."""


def work_space(**sizes: int) -> tuple[Block, Alone]:
    """Records of a block and a single episode's space, of sizes as in `layouts`."""
    block, alone = layouts(**sizes)
    return block.record(), alone.record()


@cache
def layouts(
    n_joints: int,
    n_actuated: int = 0,
    n_observations: int = 0,
    n_pairs: int = 0,
    n_terms: int = 0,
    n_placed: int = 0,
    widest: int = 0,
    own: int = 0,
    summed: int = 0,
    plant: int = 0,
    drive: int = 0,
    goal_width: int = 0,
    looks: int = 0,
    shares: int = 0,
    newton: int = 0,
) -> tuple[Layout, Layout]:
    """Layouts of a block and of a single episode's space.

    `kinarm.kernels.lanes.as_numbers` gives arrays of lanes one axis more, of
    the episodes.

    Parameters
    ----------
    n_joints, n_actuated, n_observations, n_pairs, n_terms, n_placed, widest : int
        Sizes of arm, scene, reward and networks; 0 if a kernel does without.
    own : int
        Parameters of an episode's own network.
    summed : int
        Summed entries of the observation, all or none.
    plant, drive : int
        Numbers of an episode's plant, and rows of its state; 0 if it is ideal.
    goal_width : int
        Length of goals; 0 for standing points that are reached at once.
    looks : int
        1 for a shield that looks at what follows from a step, else 0.
    shares : int
        Shares of a step that a shield may try.
    newton : int
        Errors of a goal that a Newton step is to remove; 0 if none is seen.
    """
    has_plant, beyond = Fixed(plant > 0), Fixed(goal_width > 0)
    block = {
        # Configuration, target of the step [rad or m], and goal, its position first [m].
        "q": (ONE, n_joints),
        "target": (ONE, n_joints),
        "goal": (ONE, goal_width or THREE),
        # What the tool has reached, and seems to have; its error of rotation, steps within the
        # tolerances, and goals reached.
        **dict.fromkeys(("reached", "seen_reached"), (beyond, goal_width)),
        **dict.fromkeys(("turn", "held", "goals_reached"), (beyond,)),
        # Observation, and its mirror image for networks.
        "observation": (ONE, n_observations),
        "seen": (ONE, n_observations),
        # Numbers and state of a plant; joint positions and goal as seen, and poses there.
        "plant": (has_plant, plant),
        "drive": (drive, n_actuated),
        # For a shield: its state before the step, and 1 where a command is held.
        "former_drive": (drive * looks, n_actuated),
        "holds": (Fixed(looks),),
        "sensed": (has_plant, n_joints),
        # Joint positions as seen before the step.
        "former": (ONE, n_joints),
        "seen_goal": (has_plant, goal_width or THREE),
        "seen_poses": (has_plant * (n_joints + 1), Fixed(POSE)),
        # Poses before and after the step, which swap from step to step.
        **dict.fromkeys(("before", "after"), (n_joints + 1 + n_placed, Fixed(POSE))),
        # Separating plane of each pair, with its height; the last row is work space.
        "planes": (n_pairs + 1, Fixed(PLANE)),
        # Height before the step, bend, and the bound of both [m].
        **dict.fromkeys(("height", "bend", "bound"), (n_pairs,)),
        # Move of an axis (column) in the step, times itself and twice those before it, from the
        # first one (row) that counts [rad^2].
        "twist": (n_actuated, n_actuated),
        # For a Newton step, joint positions as commanded and poses there, if a plant comes between;
        # errors of the goal, their Jacobian, work space, and the step that removes them.
        "told": (has_plant * (newton > 0), n_joints),
        "told_poses": (has_plant * (newton > 0) * (n_joints + 1), Fixed(POSE)),
        "error": (Fixed(newton),),
        "jacobian": (Fixed(newton), n_actuated),
        "square": (Fixed(newton + 1 if newton else 0), Fixed(newton)),
        "newton": (Fixed(newton > 0), n_actuated),
        # Fractions of step limits; layers and own parameters of networks.
        "action": (ONE, n_actuated),
        "hidden": (Fixed(2), widest),
        "weights": (ONE, own),
        # Distance to the goal [m], return, steps taken, and step to hand back; 1 for an episode
        # that is there, and for a step under way that Coal found free, else 0.
        **dict.fromkeys(
            ("distance", "total", "steps", "stop", "alive", "cleared", "shielding"), (ONE,)
        ),
        # Weighted terms of the last reward.
        "terms": (ONE, n_terms),
        # Sums of the observations acted upon, less the shift, and their squares.
        "moments": (Fixed(2), summed),
    }
    alone = {
        # A configuration, poses before the step or between and after it, and a plane.
        "q": (ONE, n_joints),
        **dict.fromkeys(("before", "after"), (n_joints + 1 + n_placed, Fixed(POSE))),
        "plane": (ONE, Fixed(PLANE)),
        # How a height changes with each joint.
        "slopes": (ONE, n_actuated),
        # The step that was wanted, its projection, and squared distances of its shares from it.
        **dict.fromkeys(("step", "projected"), (ONE, n_actuated)),
        "off": (shares,),
        # Where bodies of the scene that move are before and after the step [m].
        "moved": (n_placed, Fixed(6)),
        # See `kinarm.kernels.planes.separate`.
        "relative": (ONE, Fixed(POSE)),
        "simplex": (Fixed(4), THREE),
    }
    in_lanes: Shapes = {name: (lanes, shape) for name, shape in block.items()}
    numbers: Shapes = {name: (types.float64, shape) for name, shape in alone.items()}
    # Episode in each lane, -1 for none; open pairs, and configurations of each; and 1 for pairs
    # that are looked at first.
    in_lanes["row"] = (types.int64, (Fixed(LANES),))
    numbers["listed"] = (types.int64, (n_pairs + 1, Fixed(2)))
    numbers["suspected"] = (types.int64, (n_pairs,))
    return Layout("Block", in_lanes), Layout("Alone", numbers)


@lean_kernel
def furnish(placed: Array, block: Block, alone: Alone) -> None:
    """Put the scene's bodies into all poses of a work space."""
    place_bodies(placed, block.before)
    place_bodies(placed, block.after)
    place_bodies(placed, alone.before)
    place_bodies(placed, alone.after)


@helper
def load_episode(
    e: int,
    lane: int,
    shapes: ContactShapes,
    rules: Rules,
    control: Control,
    episodes: Episodes,
    block: Block,
) -> None:
    """Put an episode into a lane; its observation only if needed."""
    put(episodes.q, e, block.q, 0, lane)
    put(episodes.target, e, block.target, 0, lane)
    put(episodes.goal, e, block.goal, 0, lane)
    if block.turn.shape[0] > 0:
        pursuit = episodes.pursuit
        put(pursuit.reached, e, block.reached, 0, lane)
        as_numbers(block.turn)[0, lane] = pursuit.turn[e]
        as_numbers(block.held)[0, lane] = pursuit.held[e]
        as_numbers(block.goals_reached)[0, lane] = pursuit.goals_reached[e]
    remembers = rules.width < block.observation.shape[1]
    if control.layers.shape[0] > 0 or block.moments.shape[1] > 0 or remembers:
        put(episodes.observation, e, block.observation, 0, lane)
    if block.plant.shape[0] > 0:
        put(episodes.plant, e, block.plant, 0, lane)
        put(episodes.sensed, e, block.sensed, 0, lane)
        for row in range(block.drive.shape[0]):
            put(episodes.drive[e], row, block.drive, row, lane)
    for pair in range(episodes.planes.shape[1]):
        put(episodes.planes[e], pair, block.planes, pair, lane)
    if episodes.scenes.shape[0] > 0:
        for poses in (block.before, block.after):
            put_scene(episodes.scenes, e, lane, poses)
            move_bodies(e, episodes.steps[e], lane, shapes, rules, episodes.scenes, poses)
    if block.weights.shape[1] > 0:
        put(control.weights, control.policy[e], block.weights, 0, lane)
    for power in range(2):
        put(episodes.moments[e], power, block.moments, power, lane)
    as_numbers(block.distance)[0, lane] = episodes.distance[e]
    as_numbers(block.total)[0, lane] = episodes.total[e]
    as_numbers(block.steps)[0, lane] = episodes.steps[e]
    as_numbers(block.stop)[0, lane] = episodes.stop[e]
    as_numbers(block.cleared)[0, lane] = 1.0 if episodes.cleared[e] else 0.0
    as_numbers(block.shielding)[0, lane] = episodes.shielding[e]
    as_numbers(block.alive)[0, lane] = 1.0


@helper
def store_episode(lane: int, e: int, episodes: Episodes, block: Block) -> None:
    """Hand an episode back and free its lane."""
    steps = int(as_numbers(block.steps)[0, lane])
    take(block.q, 0, lane, episodes.q, e)
    take(block.target, 0, lane, episodes.target, e)
    if block.turn.shape[0] > 0:
        take(block.goal, 0, lane, episodes.goal, e)
        pursuit = episodes.pursuit
        take(block.reached, 0, lane, pursuit.reached, e)
        pursuit.turn[e] = as_numbers(block.turn)[0, lane]
        pursuit.held[e] = int(as_numbers(block.held)[0, lane])
        pursuit.goals_reached[e] = int(as_numbers(block.goals_reached)[0, lane])
    if steps > episodes.steps[e]:
        take(block.observation, 0, lane, episodes.observation, e)
    take_rows(block.planes, lane, episodes.planes[e])
    if block.plant.shape[0] > 0:
        take(block.sensed, 0, lane, episodes.sensed, e)
        take_rows(block.drive, lane, episodes.drive[e])
    take_rows(block.moments, lane, episodes.moments[e])
    take(block.terms, 0, lane, episodes.terms, e)
    episodes.distance[e] = as_numbers(block.distance)[0, lane]
    episodes.total[e] = as_numbers(block.total)[0, lane]
    episodes.steps[e] = steps
    episodes.cleared[e] = False
    as_numbers(block.alive)[0, lane] = 0.0


class SessionFields(NamedTuple):
    """Records in a `Session`, which kernels see as attributes."""

    chain: Chain
    shapes: ContactShapes
    rules: Rules
    control: Control
    episodes: Episodes
    block: Block
    alone: Alone
    tries: Block
    ahead: Block
    stages: NDArray[np.int64]


OBSERVE, ACT, SHIELD = range(3)
"""Stages of a session: addresses of what writes observations, runs networks, and replaces steps."""


class Session(Record):
    """Arm, scene, rules, source of actions, episodes and work space, as records.

    Each thread needs its own, from `of_thread`. Takes the stages `OBSERVE`, `ACT` and `SHIELD`, of
    which those that it has are compiled.

    Attributes
    ----------
    control, episodes : Control and Episodes
        As Python sees them.
    """

    def __init__(
        self,
        chain: Any,
        shapes: Any,
        rules: Any,
        control: Any,
        episodes: Any,
        stages: Sequence[Stage],
    ) -> None:
        self.control: Control = control.values
        self.episodes: Episodes = episodes.values
        weights, n_observations = self.control.weights, self.episodes.observation.shape[1]
        lags = self.episodes.plant.shape[1] > 0 or len(shapes.values.moving) > 0
        sizes = {
            "n_joints": self.episodes.q.shape[1],
            "n_actuated": rules.values.step_limit.shape[0],
            "n_observations": n_observations,
            "n_pairs": self.episodes.planes.shape[1],
            "n_terms": rules.values.reward.shape[0],
            "n_placed": shapes.values.placed.shape[0],
            "widest": max(self.control.layers.tolist()[1:], default=1),
            "own": weights.shape[1] if weights.shape[0] > 1 else 0,
            "summed": n_observations if len(self.episodes.moments) > 0 else 0,
            "plant": self.episodes.plant.shape[1],
            "drive": self.episodes.drive.shape[1],
            "goal_width": self.episodes.pursuit.reached.shape[1],
            "looks": int(lags and len(rules.values.shield) > 0),
            "shares": len(rules.values.shield),
            "newton": rules.values.newton,
        }
        space = work_space(**sizes)
        furnish(shapes.values.placed, *space)
        tries, ahead = (
            layouts(**sizes)[0].record() if needed else space[0]
            for needed in (sizes["shares"], sizes["looks"])
        )
        addresses = np.zeros(len(stages), dtype=np.int64)
        given = (chain, shapes, rules, control, episodes)
        parts = SessionFields(*given, *space, tries, ahead, addresses)
        super().__init__(*table(parts), parts)
        for place, has in enumerate((True, len(self.control.layers) > 0, sizes["shares"] > 0)):
            if has:
                addresses[place] = stages[place].address(self._numba_type_)
        self._others: list[Session] = []
        self._given = (*given, stages)

    def of_thread(self, number: int) -> "Session":
        """The session of a thread; this one is that of thread 0."""
        while len(self._others) < number:
            self._others.append(Session(*self._given))
        return self._others[number - 1] if number else self

    def refill(self, control: Control, starts: Array, goals: Array, shift: Array | None) -> bool:
        """Take networks, starts and goals, if they have the same number and form.

        Parameters
        ----------
        control, starts, goals, shift
            The networks, and as for `kinarm.World.episodes`.
        """
        episodes = self.episodes
        pairs = zip(self.control, control, strict=True)
        parts: list[Any] = [pair for pair in pairs if isinstance(pair[0], np.ndarray)]
        collected = 0 if shift is None else len(starts)
        if (
            episodes.q.shape != starts.shape
            or self.control.side != control.side
            or len(episodes.moments) != collected
            or any(own.shape != other.shape for own, other in parts)
        ):
            return False
        for own, other in parts:
            own[...] = other
        episodes.q[:], episodes.target[:], episodes.goal[:] = starts, starts, goals
        episodes.touched[:], episodes.steps[:] = 0, 0
        if shift is not None:
            episodes.shift[:], episodes.moments[:] = shift, 0.0
        return True


@instruction
def take_number(_: Any, counters: types.Array, place: types.Integer) -> Any:
    """Raise a counter, of an array of int64, by one; return its former value.

    Threads get different numbers.
    """

    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        from numba.np.arrayobj import make_array

        array = make_array(counters)(context, builder, arguments[0])
        index = context.cast(builder, arguments[1], place, types.intp)
        one = ir.Constant(ir.IntType(64), 1)
        return builder.atomic_rmw("add", builder.gep(array.data, [index]), one, "monotonic")

    return types.int64(counters, place), code
