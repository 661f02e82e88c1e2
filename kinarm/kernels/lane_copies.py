"""Copies between rows of a batch and lanes of a block, and where an episode's bodies are."""

from typing import Any

from kinarm.chain import Chain
from kinarm.contact_shapes import ContactShapes
from kinarm.episodes import Rules
from kinarm.kernels.compiling import Array, inlined
from kinarm.kernels.kinematics import POSE, forward_kinematics
from kinarm.kernels.lanes import as_numbers


@inlined
def put(rows: Array, e: int, held: Array, row: int, lane: int) -> None:
    """Copy a row into a lane of a row of lanes."""
    numbers = as_numbers(held)
    for i in range(numbers.shape[1]):
        numbers[row, i, lane] = rows[e, i]


@inlined
def take(held: Array, row: int, lane: int, rows: Array, e: int) -> None:
    """Copy a lane of a row of lanes into a row."""
    numbers = as_numbers(held)
    for i in range(numbers.shape[1]):
        rows[e, i] = numbers[row, i, lane]


@inlined
def take_rows(held: Array, lane: int, rows: Array) -> None:
    """Copy a lane of rows of lanes into all rows of an array."""
    for row in range(rows.shape[0]):
        take(held, row, lane, rows, row)


@inlined
def copy_rows(held: Array, others: Array) -> None:
    """Copy rows into those of another array."""
    for row in range(others.shape[0]):
        for i in range(others.shape[1]):
            others[row, i] = held[row, i]


@inlined
def spread(held: Array, lane: int, others: Array) -> None:
    """Copy a lane of rows of lanes into all lanes of others."""
    for row in range(others.shape[0]):
        for i in range(others.shape[1]):
            others[row, i] = as_numbers(held)[row, i, lane]


@inlined
def move_lane(held: Array, place: int, others: Array, lane: int) -> None:
    """Copy a lane of rows of lanes into a lane of others."""
    for row in range(others.shape[0]):
        for i in range(others.shape[1]):
            as_numbers(others)[row, i, lane] = as_numbers(held)[row, i, place]


@inlined
def put_scene(scenes: Array, e: int, lane: int, poses: Array) -> None:
    """Put the rows of an episode's bodies, if it has its own, into a lane of poses."""
    if scenes.shape[0] > 0:
        first = poses.shape[0] - scenes.shape[1]
        for body in range(scenes.shape[1]):
            for i in range(POSE):
                as_numbers(poses)[first + body, i, lane] = scenes[e, body, i]


@inlined
def moving_frame(shapes: ContactShapes, k: int, poses: Array) -> int:
    """Row in the poses of the k-th body that moves."""
    return int(poses.shape[0] - shapes.placed.shape[0] + shapes.moving[k])


@inlined
def move_bodies(
    e: int,
    step: int,
    lane: int,
    shapes: ContactShapes,
    rules: Rules,
    scenes: Array,
    poses: Array,
    gone: float = 0.0,
) -> None:
    """Put an episode's moving bodies where they are after so many steps, in a lane of poses.

    Or where they would be if they had ``gone`` on as in the last of these, for as many more.
    """
    numbers = as_numbers(poses)
    for k in range(shapes.moving.shape[0]):
        body, frame = shapes.moving[k], moving_frame(shapes, k, poses)
        for i in range(3):
            place = rules.moves[step, k, i]
            if gone > 0.0:
                place += gone * (place - rules.moves[step - 1, k, i])
            numbers[frame, 13 + i, lane] = scenes[e, body, 13 + i] + place


@inlined
def place_between(
    k: int,
    parts: int,
    lane: int,
    chain: Chain,
    shapes: ContactShapes,
    block: Any,
    alone: Any,
    poses: Array,
) -> None:
    """Fill in an episode's poses at configuration k of its step, where so many parts are over."""
    q, target = as_numbers(block.q), as_numbers(block.target)
    for joint in range(block.q.shape[1]):
        start, end = q[0, joint, lane], target[0, joint, lane]
        alone.q[0, joint] = end if k == parts else start + k / parts * (end - start)
    forward_kinematics(chain, alone.q, 0, poses)
    for moving in range(shapes.moving.shape[0]):
        frame = moving_frame(shapes, moving, poses)
        for i in range(3):
            start, end = alone.moved[moving, i], alone.moved[moving, 3 + i]
            poses[frame, 13 + i] = end if k == parts else start + k / parts * (end - start)
