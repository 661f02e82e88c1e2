"""Work space of kernels: for a block of episodes in lanes, and for one of them alone."""

from functools import cache
from typing import Any, TypeAlias

from numba import types

from kinarm.contact_shapes import PLANE, ContactShapes
from kinarm.kernels.compiling import Array, lean_kernel
from kinarm.kernels.kinematics import POSE, place_bodies
from kinarm.kernels.lanes import LANES, lanes
from kinarm.kernels.records import Fixed, Layout, Shapes
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


def sizes_of(shapes: ContactShapes) -> dict[str, int]:
    """Sizes for `layouts` of what may touch."""
    counted = {"n_pairs": shapes.travel.T, "n_own": shapes.around, "n_placed": shapes.placed}
    return {name: len(each) for name, each in counted.items()}


@cache
def layouts(
    n_joints: int,
    n_actuated: int = 0,
    n_observations: int = 0,
    n_pairs: int = 0,
    n_own: int = 0,
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
    n_joints, n_actuated, n_observations, n_pairs, n_own, n_terms, n_placed, widest : int
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
        # Middle and half of the axis of the capsule around each of the arm's shapes [m].
        "axes": (n_own, Fixed(6)),
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
    # Episode in each lane, -1 for none; pairs that a step leaves open in some lane, and last how
    # many; those of an episode, and configurations of each; and 1 for pairs that are looked at
    # first.
    in_lanes["row"] = (types.int64, (Fixed(LANES),))
    in_lanes["open"] = (types.int64, (n_pairs + 1,))
    numbers["listed"] = (types.int64, (n_pairs + 1, Fixed(2)))
    numbers["suspected"] = (types.int64, (n_pairs,))
    # A heap of the shares of a step.
    numbers["shares"] = (types.int64, (shares,))
    return Layout("Block", in_lanes), Layout("Alone", numbers)


@lean_kernel
def furnish(placed: Array, block: Block, alone: Alone) -> None:
    """Put the scene's bodies into all poses of a work space."""
    place_bodies(placed, block.before)
    place_bodies(placed, block.after)
    place_bodies(placed, alone.before)
    place_bodies(placed, alone.after)
