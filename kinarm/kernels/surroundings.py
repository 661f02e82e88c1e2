"""What is seen after a step: which bodies are near, and where they are.

It depends on the configuration and the bodies alone, not on the planes that proved the step.
"""

from typing import NamedTuple

from kinarm.kernels.compiling import Array, Vector, helper
from kinarm.kernels.kinematics import point_jacobian, rotated, rotated_back
from kinarm.kernels.lanes import any_lane, select
from kinarm.kernels.planes import FINE, foot, height_above, propose
from kinarm.kernels.rough_bounds import ball_gap
from kinarm.kernels.session import Session

NEAR = 0.5
"""Height beyond which nothing is near [m]."""

FAR = 1e10
"""Square of the distance beyond which there are no bodies, but for absent ones [m^2]."""

SLOT = 12
"""Entries of a body."""


class Seen(NamedTuple):
    """What formulas of the observation read, beside the session.

    Attributes
    ----------
    poses, frames : ndarray of lanes, shape (n_frames, POSE)
        Where joint frames and bodies of the scene are, and where joint frames
        seem to be, as joints are measured.
    tool : tuple
        The tool point by these in the world [m].
    goal, joints, before : ndarray of lanes, shape (1, n)
        Goal [m], and joint positions, now and before the step, as they are
        measured [rad or m].
    """

    poses: Array
    frames: Array
    tool: Vector
    goal: Array
    joints: Array
    before: Array


@helper
def write_proximity(session: Session, seen: Seen, start: int, count: int) -> None:
    """Height of each link above the plane that separates it from the nearest body, and its normal.

    Then follows what the largest step of each actuated joint adds to it. The planes are those that
    `propose` finds. So heights are lower bounds of distances.
    """
    shapes, block, poses = session.shapes, session.block, seen.poses
    limit, jacobian, planes = session.rules.step_limit, block.jacobian, block.planes
    row, nothing = shapes.travel.shape[1], 0.0 * poses[0, 13]
    for link in range(1, count + 1):
        least, x, y, z = nothing + NEAR, nothing, nothing, nothing
        px, py, pz = nothing, nothing, nothing
        for k in range(shapes.near.shape[0]):
            pair = shapes.near[k]
            if shapes.bodies[shapes.planes[pair, 1], 2] != link:
                continue
            within = ball_gap(shapes, pair, poses) < least
            if any_lane(within):
                propose(shapes, pair, poses, planes, row)
                height = height_above(shapes, pair, FINE, poses, planes, row)
                normal = planes[row, 0], planes[row, 1], planes[row, 2]
                a, b, c = rotated(poses, shapes.planes[pair, 4], *normal)
                u, v, w = foot(shapes, pair, poses)
                nearer = within & (height < least)
                least = select(nearer, height, least)
                x, y, z = select(nearer, a, x), select(nearer, b, y), select(nearer, c, z)
                px, py, pz = select(nearer, u, px), select(nearer, v, py), select(nearer, w, pz)
        place = start + (4 + limit.shape[0]) * (link - 1)
        block.observation[0, place] = max(least, 0.0)
        block.observation[0, place + 1] = x
        block.observation[0, place + 2] = y
        block.observation[0, place + 3] = z
        point_jacobian(session.chain, poses, (px, py, pz), jacobian)
        for k in range(limit.shape[0]):
            slope = x * jacobian[0, k] + y * jacobian[1, k] + z * jacobian[2, k]
            block.observation[0, place + 4 + k] = slope * limit[k] if k < link else nothing


@helper
def write_obstacles(session: Session, seen: Seen, start: int, count: int) -> None:
    """Boxes around the bodies that are nearest to the tool point, and zeros if there are fewer.

    Half-spaces have no box. Of bodies that are as near, the first comes first.
    """
    boxes, poses, found = session.rules.boxes, seen.poses, session.block.observation
    n_placed, tool, nothing = boxes.shape[0], seen.tool, 0.0 * seen.poses[0, 13]
    last, taken = nothing - 1.0, nothing
    for slot in range(count):
        row = start + SLOT * slot
        for i in range(SLOT):
            found[0, row + i] = nothing
        nearest, chosen = nothing + FAR, nothing
        for body in range(n_placed):
            frame, number = poses.shape[0] - n_placed + body, nothing + body
            middle, half, widened = boxes[body, 0], boxes[body, 1], poses[frame, 3]
            sx, sy, sz = poses[frame, 0], poses[frame, 1], poses[frame, 2]
            hx, hy, hz = sx * half[0] + widened, sy * half[1] + widened, sz * half[2] + widened
            x, y, z = rotated(poses, frame, sx * middle[0], sy * middle[1], sz * middle[2])
            x += poses[frame, 13] - tool[0]
            y += poses[frame, 14] - tool[1]
            z += poses[frame, 15] - tool[2]
            dx, dy, dz = rotated_back(poses, frame, x, y, z)
            dx, dy, dz = max(abs(dx) - hx, 0.0), max(abs(dy) - hy, 0.0), max(abs(dz) - hz, 0.0)
            away = dx * dx + dy * dy + dz * dz
            later = (away > last) | ((away == last) & (number > taken))
            better = later & (away < nearest) & (hx > 0.0)
            nearest, chosen = select(better, away, nearest), select(better, number, chosen)
            found[0, row] = select(better, x, found[0, row])
            found[0, row + 1] = select(better, y, found[0, row + 1])
            found[0, row + 2] = select(better, z, found[0, row + 2])
            found[0, row + 3] = select(better, hx, found[0, row + 3])
            found[0, row + 4] = select(better, hy, found[0, row + 4])
            found[0, row + 5] = select(better, hz, found[0, row + 5])
            for i in range(3):
                first, second = poses[frame, 4 + 3 * i], poses[frame, 5 + 3 * i]
                found[0, row + 6 + i] = select(better, first, found[0, row + 6 + i])
                found[0, row + 9 + i] = select(better, second, found[0, row + 9 + i])
        last, taken = nearest, chosen
