"""Compiled rollouts: kinematics, observation, policy, step and proof of freedom from contact.

Numba kernels over flat arrays, without the GIL and without reordering of floating-point
operations, so that an episode's numbers depend on nothing but its inputs. They stay in one file
because Numba's disk cache notices changes only in the file of the kernel that is called.

A step moves the arm from q to q' and is tested at the four configurations q + k/4 (q' - q). Each
tested pair of bodies carries a *slack*: a certified lower bound of its distance at q. Slack that
outlasts the largest possible motion of a step proves it; else the pair's distance at q' is bounded
anew, and only if that is not enough, at the configurations between. What is still not proven free
pauses the episode until Coal has judged it.
"""

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kinarm.chain import Chain
from kinarm.collision import BETWEEN_CAPSULES, WITH_BOX, WITH_GROUND, ContactShapes
from kinarm.episodes import PAUSED, RUNNING, SUCCESS, TRUNCATED, Control, Episodes, Rules

SUBSTEPS = 4
"""Configurations at which the motion of a step is tested."""

MARGIN = 1e-6
"""Distance below which freedom is not claimed [m]: the tolerance of Coal's iterations."""

LAYOUT = "b91b3b14f472"
"""Hash of what is compiled in from other files; a test tells when to renew it.

Numba's disk cache notices changes only in this file, so changing this line is what makes it
compile anew.
"""


NARROW = 16
"""Layers of fewer outputs keep their sums in registers."""

POSE = 16
"""Entries of a frame's pose: quaternion w x y z, rotation matrix by rows, position."""

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile a function that Python calls, into the disk cache where there can be one."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        return cast("Function", njit(cache=True, **options)(function))
    except RuntimeError:
        return cast("Function", njit(**options)(function))


def inlined(function: Function) -> Function:
    """Compile a helper that allocates nothing: several times faster without reference counts."""
    options: dict[str, Any] = {"error_model": "numpy", "forceinline": True, "_nrt": False}
    return cast("Function", njit(**options)(function))


@inlined
def forward_kinematics(
    prismatic: NDArray[np.bool_],
    translation: NDArray[np.float64],
    rotation: NDArray[np.float64],
    axis: NDArray[np.float64],
    configurations: NDArray[np.float64],
    row: int,
    poses: NDArray[np.float64],
) -> None:
    """Fill in the world poses of all joint frames.

    Parameters
    ----------
    prismatic, translation, rotation, axis : ndarray
        See `Chain`.
    configurations : ndarray, shape (n, n_axes)
        Axis positions [rad or m].
    row : int
        Which of them.
    poses : ndarray, shape (n_axes + 1, POSE)
        Row 0 is the world, row k the frame of the k-th joint. Quaternions are composed along the
        chain, so they are continuous in the axis positions.
    """
    for i in range(POSE):
        poses[0, i] = 1.0 if i == 0 or i == 4 or i == 8 or i == 12 else 0.0
    for k in range(configurations.shape[1]):
        c = k + 1
        tx, ty, tz = translation[k, 0], translation[k, 1], translation[k, 2]
        poses[c, 13] = poses[k, 13] + (poses[k, 4] * tx + poses[k, 5] * ty + poses[k, 6] * tz)
        poses[c, 14] = poses[k, 14] + (poses[k, 7] * tx + poses[k, 8] * ty + poses[k, 9] * tz)
        poses[c, 15] = poses[k, 15] + (poses[k, 10] * tx + poses[k, 11] * ty + poses[k, 12] * tz)
        fw, fx, fy, fz = rotation[k, 0], rotation[k, 1], rotation[k, 2], rotation[k, 3]
        ax, ay, az = axis[k, 0], axis[k, 1], axis[k, 2]
        sine, cosine = 0.0, 1.0
        if not prismatic[k] and configurations[row, k] != 0.0:
            half = 0.5 * configurations[row, k]
            sine, cosine = math.sin(half), math.cos(half)
        ux, uy, uz = sine * ax, sine * ay, sine * az
        if fw == 1.0:
            jw, jx, jy, jz = cosine, ux, uy, uz
        else:
            jw = fw * cosine - fx * ux - fy * uy - fz * uz
            jx = fw * ux + fx * cosine + fy * uz - fz * uy
            jy = fw * uy - fx * uz + fy * cosine + fz * ux
            jz = fw * uz + fx * uy - fy * ux + fz * cosine
        pw, px, py, pz = poses[k, 0], poses[k, 1], poses[k, 2], poses[k, 3]
        w = pw * jw - px * jx - py * jy - pz * jz
        x = pw * jx + px * jw + py * jz - pz * jy
        y = pw * jy - px * jz + py * jw + pz * jx
        z = pw * jz + px * jy - py * jx + pz * jw
        poses[c, 0], poses[c, 1], poses[c, 2], poses[c, 3] = w, x, y, z
        poses[c, 4] = 1.0 - 2.0 * (y * y + z * z)
        poses[c, 5] = 2.0 * (x * y - w * z)
        poses[c, 6] = 2.0 * (x * z + w * y)
        poses[c, 7] = 2.0 * (x * y + w * z)
        poses[c, 8] = 1.0 - 2.0 * (x * x + z * z)
        poses[c, 9] = 2.0 * (y * z - w * x)
        poses[c, 10] = 2.0 * (x * z - w * y)
        poses[c, 11] = 2.0 * (y * z + w * x)
        poses[c, 12] = 1.0 - 2.0 * (x * x + y * y)
        if prismatic[k]:
            poses[c, 13] += configurations[row, k] * (
                poses[c, 4] * ax + poses[c, 5] * ay + poses[c, 6] * az
            )
            poses[c, 14] += configurations[row, k] * (
                poses[c, 7] * ax + poses[c, 8] * ay + poses[c, 9] * az
            )
            poses[c, 15] += configurations[row, k] * (
                poses[c, 10] * ax + poses[c, 11] * ay + poses[c, 12] * az
            )


@inlined
def to_world(
    poses: NDArray[np.float64], frame: int, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Map a point of a joint frame to the world."""
    return (
        poses[frame, 13] + (poses[frame, 4] * x + poses[frame, 5] * y + poses[frame, 6] * z),
        poses[frame, 14] + (poses[frame, 7] * x + poses[frame, 8] * y + poses[frame, 9] * z),
        poses[frame, 15] + (poses[frame, 10] * x + poses[frame, 11] * y + poses[frame, 12] * z),
    )


@inlined
def observe(
    tool: NDArray[np.float64],
    poses: NDArray[np.float64],
    goals: NDArray[np.float64],
    row: int,
    observations: NDArray[np.float64],
) -> float:
    """Fill in a row of the observations and return the distance from the tool to the goal [m].

    The order is goal (3), goal - tool (3), quaternions (4 n_axes), positions (3 n_axes).
    """
    n_axes = poses.shape[0] - 1
    x, y, z = to_world(poses, n_axes, tool[0], tool[1], tool[2])
    gx, gy, gz = goals[row, 0], goals[row, 1], goals[row, 2]
    dx, dy, dz = gx - x, gy - y, gz - z
    observations[row, 0], observations[row, 1], observations[row, 2] = gx, gy, gz
    observations[row, 3], observations[row, 4], observations[row, 5] = dx, dy, dz
    for k in range(n_axes):
        for i in range(4):
            observations[row, 6 + 4 * k + i] = poses[k + 1, i]
        for i in range(3):
            observations[row, 6 + 4 * n_axes + 3 * k + i] = poses[k + 1, 13 + i]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@inlined
def segment_gap(
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    c: tuple[float, float, float],
    d: tuple[float, float, float],
) -> float:
    """Lower bound of the distance between the segments ab and cd, certified by a plane.

    The direction between (nearly) closest points only proposes the plane; the bound is the gap
    between the two segments along it, and so holds however the direction was found.
    """
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = d[0] - c[0], d[1] - c[1], d[2] - c[2]
    rx, ry, rz = a[0] - c[0], a[1] - c[1], a[2] - c[2]
    uu = ux * ux + uy * uy + uz * uz
    vv = vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    ur = ux * rx + uy * ry + uz * rz
    vr = vx * rx + vy * ry + vz * rz
    determinant = uu * vv - uv * uv
    s = 0.0
    if determinant > 1e-12 * uu * vv:
        s = min(max((uv * vr - vv * ur) / determinant, 0.0), 1.0)
    t = 0.0
    if vv > 0.0:
        t = min(max((uv * s + vr) / vv, 0.0), 1.0)
    if uu > 0.0:
        s = min(max((uv * t - ur) / uu, 0.0), 1.0)
    nx, ny, nz = rx + s * ux - t * vx, ry + s * uy - t * vy, rz + s * uz - t * vz
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if norm < 1e-12:
        return 0.0
    along_u = nx * ux + ny * uy + nz * uz
    along_v = nx * vx + ny * vy + nz * vz
    along_r = nx * rx + ny * ry + nz * rz
    return (along_r + min(along_u, 0.0) - max(along_v, 0.0)) / norm


@inlined
def box_gap(
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    lower: tuple[float, float, float],
    upper: tuple[float, float, float],
) -> float:
    """Lower bound of the distance between the segment ab and a box, certified by a plane.

    A safeguarded Newton iteration on the squared distance, which is convex along the segment,
    proposes the plane.
    """
    lx, ly, lz = lower
    hx, hy, hz = upper
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    low, high, t = 0.0, 1.0, 0.5
    nx, ny, nz = 0.0, 0.0, 0.0
    for _ in range(16):
        x, y, z = a[0] + t * ux, a[1] + t * uy, a[2] + t * uz
        nx = x - min(max(x, lx), hx)
        ny = y - min(max(y, ly), hy)
        nz = z - min(max(z, lz), hz)
        slope = nx * ux + ny * uy + nz * uz
        curvature = 0.0
        if nx != 0.0:
            curvature += ux * ux
        if ny != 0.0:
            curvature += uy * uy
        if nz != 0.0:
            curvature += uz * uz
        if slope == 0.0 or (slope > 0.0 and t == 0.0) or (slope < 0.0 and t == 1.0):
            break
        if slope > 0.0:
            high = t
        else:
            low = t
        step = t - slope / curvature
        if abs(step - t) < 1e-12:
            break
        if step <= low:
            step = 0.0 if low == 0.0 else 0.5 * (low + high)
        elif step >= high:
            step = 1.0 if high == 1.0 else 0.5 * (low + high)
        t = step
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if norm < 1e-12:
        return 0.0
    first = nx * a[0] + ny * a[1] + nz * a[2]
    second = nx * b[0] + ny * b[1] + nz * b[2]
    support = max(nx * lx, nx * hx) + max(ny * ly, ny * hy) + max(nz * lz, nz * hz)
    return (min(first, second) - support) / norm


@inlined
def clearance(
    pair: int,
    pairs: NDArray[np.int64],
    capsules: NDArray[np.float64],
    link: NDArray[np.int64],
    boxes: NDArray[np.float64],
    poses: NDArray[np.float64],
) -> float:
    """Lower bound of the distance between the two bodies of a pair [m].

    Parameters
    ----------
    pair : int
        Index of the pair.
    pairs, capsules, link, boxes : ndarray
        See `ContactShapes`.
    poses : ndarray, shape (n_axes + 1, POSE)
        Forward kinematics.
    """
    kind, i, j = pairs[pair, 0], pairs[pair, 1], pairs[pair, 2]
    radius = capsules[i, 6]
    a = to_world(poses, link[i], capsules[i, 0], capsules[i, 1], capsules[i, 2])
    b = to_world(poses, link[i], capsules[i, 3], capsules[i, 4], capsules[i, 5])
    c = d = (0.0, 0.0, 0.0)
    if kind == WITH_BOX:
        c = (boxes[j, 0, 0], boxes[j, 0, 1], boxes[j, 0, 2])
        d = (boxes[j, 1, 0], boxes[j, 1, 1], boxes[j, 1, 2])
    elif kind == BETWEEN_CAPSULES:
        radius += capsules[j, 6]
        c = to_world(poses, link[j], capsules[j, 0], capsules[j, 1], capsules[j, 2])
        d = to_world(poses, link[j], capsules[j, 3], capsules[j, 4], capsules[j, 5])
    if kind == WITH_GROUND:
        gap = min(a[2], b[2])
    elif kind == WITH_BOX:
        gap = box_gap(a, b, c, d)
    else:
        gap = segment_gap(a, b, c, d)
    return float(gap - radius)


@inlined
def is_apart(bound: float) -> bool:
    """Whether a lower bound of a distance proves freedom from contact; NaN proves nothing."""
    return bound > MARGIN


@inlined
def spend_slack(
    row: int,
    travel: NDArray[np.float64],
    q: NDArray[np.float64],
    target: NDArray[np.float64],
    slack: NDArray[np.float64],
    motion: NDArray[np.float64],
) -> bool:
    """Reduce an episode's slack by the motion of a step; return whether some pair has none left.

    Parameters
    ----------
    row : int
        Which episode.
    travel : ndarray, shape (n_actuated, n_pairs)
        See `ContactShapes`.
    q, target : ndarray, shape (n, n_axes)
        Ends of the step [rad or m].
    slack : ndarray, shape (n, n_pairs)
        Lower bounds of the distances at ``q``; on return, at ``target`` [m].
    motion : ndarray, shape (n_pairs,)
        Output: bounds of the relative motion of the pairs [m].
    """
    n_pairs = slack.shape[1]
    for pair in range(n_pairs):
        motion[pair] = 0.0
    for axis in range(travel.shape[0]):
        turn = abs(target[row, axis] - q[row, axis])
        for pair in range(n_pairs):
            motion[pair] += travel[axis, pair] * turn
    least = np.inf
    for pair in range(n_pairs):
        slack[row, pair] -= motion[pair]
        least = min(least, slack[row, pair])
    return not is_apart(least)


@inlined
def prove_step(
    row: int,
    chain: Chain,
    shapes: ContactShapes,
    q: NDArray[np.float64],
    target: NDArray[np.float64],
    slack: NDArray[np.float64],
    motion: NDArray[np.float64],
    poses: NDArray[np.float64],
    between: NDArray[np.float64],
    middle: NDArray[np.float64],
    unproven: NDArray[np.int64],
) -> int:
    """Prove the tested configurations of a step free where the slack ran out, and renew it.

    Parameters
    ----------
    row : int
        Which episode.
    chain, shapes
        The arm and its contact pairs.
    q, target, slack, motion : ndarray
        As `spend_slack` took and left them; on return, ``slack`` is renewed.
    poses : ndarray, shape (n_axes + 1, POSE)
        Forward kinematics at ``target``.
    between, middle, unproven : ndarray, shape (n_axes + 1, POSE), (1, n_axes) and (n_pairs,)
        Work space.

    Returns
    -------
    int
        Bit k - 1 is set if configuration k could not be proven free.
    """
    prismatic, translation, rotation, axes = chain[:4]
    link, capsules, boxes, pairs = shapes[:4]
    n_pairs, n_axes = slack.shape[1], q.shape[1]
    doubt, open_between = 0, 0
    for pair in range(n_pairs):
        unproven[pair] = 0
        if is_apart(slack[row, pair]):
            continue
        before = slack[row, pair] + motion[pair]
        after = clearance(pair, pairs, capsules, link, boxes, poses)
        slack[row, pair] = after
        if not is_apart(after):
            doubt |= 1 << (SUBSTEPS - 1)
        if is_apart(after - motion[pair]):
            continue
        for k in range(1, SUBSTEPS):
            share = k / SUBSTEPS
            left = before - share * motion[pair]
            right = after - (1.0 - share) * motion[pair]
            if not is_apart(max(left, right)):
                unproven[pair] |= 1 << (k - 1)
        open_between |= unproven[pair]
    for k in range(1, SUBSTEPS):
        bit = 1 << (k - 1)
        if open_between & bit:
            for axis in range(n_axes):
                middle[0, axis] = q[row, axis] + k / SUBSTEPS * (target[row, axis] - q[row, axis])
            forward_kinematics(prismatic, translation, rotation, axes, middle, 0, between)
            for pair in range(n_pairs):
                if unproven[pair] & bit and not is_apart(
                    clearance(pair, pairs, capsules, link, boxes, between)
                ):
                    doubt |= bit
                    break
    return doubt


@inlined
def narrow_layer(
    weights: NDArray[np.float64],
    policy: int,
    offset: int,
    n_in: int,
    n_out: int,
    inputs: NDArray[np.float64],
    source: int,
    outputs: NDArray[np.float64],
    sink: int,
) -> None:
    """Apply an affine layer of few outputs: sums stay in registers, five at a time."""
    bias = offset + n_in * n_out
    blocked = n_out - n_out % 5
    for j in range(0, blocked, 5):
        s0, s1 = weights[policy, bias + j], weights[policy, bias + j + 1]
        s2, s3 = weights[policy, bias + j + 2], weights[policy, bias + j + 3]
        s4 = weights[policy, bias + j + 4]
        entry = offset + j
        for i in range(n_in):
            value = inputs[source, i]
            s0 += value * weights[policy, entry]
            s1 += value * weights[policy, entry + 1]
            s2 += value * weights[policy, entry + 2]
            s3 += value * weights[policy, entry + 3]
            s4 += value * weights[policy, entry + 4]
            entry += n_out
        outputs[sink, j], outputs[sink, j + 1], outputs[sink, j + 2] = s0, s1, s2
        outputs[sink, j + 3], outputs[sink, j + 4] = s3, s4
    for j in range(blocked, n_out):
        s0 = weights[policy, bias + j]
        for i in range(n_in):
            s0 += inputs[source, i] * weights[policy, offset + i * n_out + j]
        outputs[sink, j] = s0


@inlined
def wide_layer(
    weights: NDArray[np.float64],
    policy: int,
    offset: int,
    n_in: int,
    n_out: int,
    inputs: NDArray[np.float64],
    source: int,
    outputs: NDArray[np.float64],
    sink: int,
) -> None:
    """Apply an affine layer of many outputs: the loop over outputs fills vector registers."""
    for j in range(n_out):
        outputs[sink, j] = weights[policy, offset + n_in * n_out + j]
    for i in range(n_in):
        value = inputs[source, i]
        for j in range(n_out):
            outputs[sink, j] += value * weights[policy, offset + i * n_out + j]


@inlined
def dense(
    layers: NDArray[np.int64],
    weights: NDArray[np.float64],
    policy: int,
    observations: NDArray[np.float64],
    row: int,
    hidden: NDArray[np.float64],
    action: NDArray[np.float64],
) -> None:
    """Evaluate a network: tanh between layers, output clipped to [-1, 1].

    Parameters
    ----------
    layers : ndarray of int, shape (n_layers + 1,)
        Widths.
    weights : ndarray, shape (n_policies, n_parameters)
        Layer after layer: weights (inputs x outputs), then the bias.
    policy : int
        Which row of ``weights``.
    observations : ndarray, shape (n, n_observations)
        Inputs.
    row : int
        Which row of ``observations``.
    hidden : ndarray, shape (2, widest layer)
        Work space.
    action : ndarray, shape (n_actions,)
        The output.
    """
    offset = 0
    n_layers = layers.shape[0] - 1
    for layer in range(n_layers):
        n_in, n_out = layers[layer], layers[layer + 1]
        sink = (layer + 1) % 2
        inputs, source = (observations, row) if layer == 0 else (hidden, layer % 2)
        if n_out < NARROW:
            narrow_layer(weights, policy, offset, n_in, n_out, inputs, source, hidden, sink)
        else:
            wide_layer(weights, policy, offset, n_in, n_out, inputs, source, hidden, sink)
        if layer < n_layers - 1:
            for j in range(n_out):
                hidden[sink, j] = math.tanh(hidden[sink, j])
        offset += (n_in + 1) * n_out
    for j in range(action.shape[0]):
        action[j] = min(max(hidden[n_layers % 2, j], -1.0), 1.0)


@kernel
def screen(
    first: int,
    last: int,
    chain: Chain,
    shapes: ContactShapes,
    configurations: NDArray[np.float64],
    tools: NDArray[np.float64],
    proven: NDArray[np.bool_],
) -> None:
    """Find the tool points of configurations, and which are proven free of contact.

    Parameters
    ----------
    first, last : int
        Range of rows to work on.
    chain, shapes
        The arm and its contact pairs.
    configurations : ndarray, shape (n, n_axes)
        Axis positions [rad or m].
    tools : ndarray, shape (n, 3)
        Output: tool points [m].
    proven : ndarray of bool, shape (n,)
        Output: whether every pair is certified to be apart.
    """
    prismatic, translation, rotation, axes, tool = chain[:5]
    link, capsules, boxes, pairs = shapes[:4]
    n_axes = configurations.shape[1]
    poses = np.empty((n_axes + 1, POSE))
    for i in range(first, last):
        forward_kinematics(prismatic, translation, rotation, axes, configurations, i, poses)
        tools[i, 0], tools[i, 1], tools[i, 2] = to_world(poses, n_axes, tool[0], tool[1], tool[2])
        proven[i] = True
        for pair in range(pairs.shape[0]):
            if not is_apart(clearance(pair, pairs, capsules, link, boxes, poses)):
                proven[i] = False
                break


@kernel
def begin(
    first: int,
    last: int,
    rows: NDArray[np.int64],
    chain: Chain,
    shapes: ContactShapes,
    episodes: Episodes,
) -> None:
    """Start episodes ``rows[first]`` to ``rows[last - 1]`` at their ``q`` and ``goal``.

    An episode whose start is not proven contact-free is left paused.
    """
    prismatic, translation, rotation, axes, tool = chain[:5]
    link, capsules, boxes, pairs = shapes[:4]
    q, slack, path = episodes.q, episodes.slack, episodes.path
    poses = np.empty((q.shape[1] + 1, POSE))
    for index in range(first, last):
        e = rows[index]
        forward_kinematics(prismatic, translation, rotation, axes, q, e, poses)
        distance = observe(tool, poses, episodes.goal, e, episodes.observation)
        episodes.distance[e] = distance
        episodes.previous_distance[e] = distance
        episodes.steps[e] = 0
        episodes.total[e] = 0.0
        episodes.cleared[e] = False
        episodes.status[e] = RUNNING
        for pair in range(pairs.shape[0]):
            slack[e, pair] = clearance(pair, pairs, capsules, link, boxes, poses)
            if not is_apart(slack[e, pair]):
                episodes.status[e] = PAUSED
        for axis in range(q.shape[1]):
            if path.shape[0] > 0:
                path[e, 0, axis] = q[e, axis]


@kernel
def advance(
    first: int,
    last: int,
    chain: Chain,
    shapes: ContactShapes,
    rules: Rules,
    control: Control,
    episodes: Episodes,
) -> None:
    """Advance the running episodes among ``first`` to ``last - 1``.

    Each goes on until it ends, reaches its ``stop`` or pauses before a step that is not proven
    free of contact.
    """
    prismatic, translation, rotation, axes, tool, lower, upper = chain[:7]
    layers, weights, policy, actions = control
    status, steps, stop, q, target, doubt, cleared, slack, goal, observation, distance = episodes[
        :11
    ]
    previous, total, moments, shift, path = episodes[11:]
    step_limit, travel = rules.step_limit, shapes.travel
    n_axes, n_actuated, n_observations = q.shape[1], step_limit.shape[0], observation.shape[1]
    poses, between = np.empty((n_axes + 1, POSE)), np.empty((n_axes + 1, POSE))
    motion, middle = np.empty(slack.shape[1]), np.empty((1, n_axes))
    unproven = np.empty(slack.shape[1], dtype=np.int64)
    widest = 1
    for layer in range(layers.shape[0]):
        widest = max(widest, layers[layer])
    hidden, action = np.empty((2, widest)), np.empty(n_actuated)
    for e in range(first, last):
        while status[e] == RUNNING and steps[e] < stop[e]:
            if not cleared[e]:
                if layers.shape[0] > 0:
                    dense(layers, weights, policy[e], observation, e, hidden, action)
                else:
                    column = steps[e] if actions.shape[1] > 1 else 0
                    for axis in range(n_actuated):
                        action[axis] = min(max(actions[e, column, axis], -1.0), 1.0)
                if moments.shape[0] > 0:
                    for i in range(n_observations):
                        centred = observation[e, i] - shift[i]
                        moments[e, 0, i] += centred
                        moments[e, 1, i] += centred * centred
                for axis in range(n_actuated):
                    moved = q[e, axis] + action[axis] * step_limit[axis]
                    target[e, axis] = min(max(moved, lower[axis]), upper[axis])
            forward_kinematics(prismatic, translation, rotation, axes, target, e, poses)
            if not cleared[e] and spend_slack(e, travel, q, target, slack, motion):
                doubt[e] = prove_step(
                    e, chain, shapes, q, target, slack, motion, poses, between, middle, unproven
                )
                if doubt[e] != 0:
                    status[e] = PAUSED
                    break
            cleared[e] = False
            before = distance[e]
            after = observe(tool, poses, goal, e, observation)
            previous[e], distance[e] = before, after
            steps[e] += 1
            total[e] += rules.progress * (before - after) + rules.step
            if after <= rules.tolerance:
                total[e] += rules.success
                status[e] = SUCCESS
            elif steps[e] >= rules.horizon:
                status[e] = TRUNCATED
            for axis in range(n_axes):
                q[e, axis] = target[e, axis]
                if path.shape[0] > 0:
                    path[e, steps[e], axis] = q[e, axis]
