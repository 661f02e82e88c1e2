"""The looks of an industrial six-axis arm with the proportions of a FANUC LR Mate 200iC.

Housings are blended castings, joints are turned pins, the lengths of the upper arm, the forearm and
the tool come from the arm. Nothing here touches the simulation: contact is decided by the
collision shapes.
"""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from kinarm.arm import Arm
from kinarm.viewer.meshes import Mesh, box, capsule, cylinder, housing, lathe, loft
from kinarm.viewer.parts import ACCENT, GRAPHITE, PAINT, STEEL, ArmPart

TIP = 0.014
"""Radius of the ball at the end of the tool, whose surface is the tool point [m]."""

SHOULDER = (
    (-0.166, 0.0, 0.09, 0.09, 2),
    (-0.16, 0.0, 0.099, 0.099, 2),
    (-0.125, 0.002, 0.1, 0.099, 2.1),
    (-0.085, 0.016, 0.104, 0.092, 2.5),
    (-0.045, 0.04, 0.098, 0.072, 3.0),
    (0.0, 0.062, 0.084, 0.056, 3.2),
    (0.035, 0.07, 0.068, 0.05, 3.0),
    (0.06, 0.074, 0.042, 0.042, 2.6),
    (0.068, 0.075, 0.022, 0.03, 2.2),
)
"""Cross sections of the casting between the first two axes; see `housing`."""

ELBOW = (
    (-0.052, 0.0, 0.03, 0.04, 2.4),
    (-0.04, 0.0, 0.048, 0.047, 3.0),
    (0.0, 0.004, 0.06, 0.05, 3.6),
    (0.04, 0.008, 0.066, 0.054, 3.8),
    (0.075, 0.01, 0.066, 0.055, 3.4),
    (0.11, 0.01, 0.058, 0.047, 3.0),
    (0.128, 0.008, 0.042, 0.034, 2.6),
    (0.133, 0.006, 0.02, 0.02, 2.2),
)
"""Cross sections of the casting between the third and the fourth axis."""

AXES = np.array([(0, 0, 1), (0, 1, 0), (0, -1, 0), (-1, 0, 0), (0, -1, 0), (-1, 0, 0)])


def fits(arm: Arm) -> bool:
    """Whether an arm has the axes and offsets that these looks are made for."""
    chain = arm.chain
    if chain.n_joints != 6 or chain.prismatic.any() or not np.allclose(chain.axis, AXES):
        return False
    upper, forearm = chain.translation[2][2], chain.translation[3][0]
    first = arm.model.frames[1].placement * pin.SE3(np.eye(3), np.array([0, 0, 0.33]))
    expected = [(0.075, 0, 0), (0, 0, upper), (forearm, 0, 0.075), (0, 0, 0), (0.08, 0, 0)]
    return (
        arm.model.jointPlacements[1].isApprox(first, 1e-6)
        and np.allclose(chain.translation[1:], expected)
        and np.allclose(chain.rotation[1:], [1, 0, 0, 0])
        and np.allclose(chain.tool[1:], 0)
        and 0.2 <= upper <= 0.6
        and 0.25 <= forearm <= 0.6
        and (chain.tool[0] == 0 or chain.tool[0] >= 0.08)
    )


def parts(arm: Arm) -> Iterator[ArmPart]:
    """All parts of an arm that `fits`."""
    chain, base = arm.chain, arm.model.frames[1].placement  # of the link fixed in the world
    for part in _base():
        yield part._replace(mesh=part.mesh.moved(base.translation, base.rotation))
    yield from _shoulder()
    yield from _upper_arm(float(chain.translation[2][2]))
    yield from _elbow()
    yield from _forearm(float(chain.translation[3][0]))
    yield from _wrist()
    yield from _hand(float(chain.tool[0]))


def _base() -> Iterator[ArmPart]:
    casting = [
        (0.02, -0.005, 0.122, 0.108, 4.5),
        (0.05, -0.005, 0.116, 0.104, 4.0),
        (0.085, 0.0, 0.104, 0.1, 2.8),
        (0.12, 0.0, 0.097, 0.097, 2.1),
        (0.15, 0, 0.096, 0.096, 2),
    ]
    yield ArmPart(0, PAINT, housing(casting))
    yield ArmPart(0, GRAPHITE, box((0.27, 0.25, 0.022), 0.006).moved((-0.012, 0, 0.011)))
    yield ArmPart(0, GRAPHITE, box((0.05, 0.13, 0.07), 0.008).moved((-0.125, 0, 0.062)))
    for y in (-0.035, 0.0, 0.035):
        yield ArmPart(0, STEEL, cylinder(0.02, 0.012, 0.002, "x").moved((-0.156, y, 0.064)))
    for x in (-0.125, 0.101):
        for y in (-0.105, 0.105):
            yield ArmPart(0, STEEL, cylinder(0.01, 0.0085, 0.002).moved((x, y, 0.026)))


def _shoulder() -> Iterator[ArmPart]:
    second_axis = (0.075, 0, 0)
    ring = [(-0.182, 0.088), (-0.18, 0.1), (-0.168, 0.1), (-0.166, 0.088)]
    motor = [(0.06, 0.062), (0.13, 0.061), (0.14, 0.055), (0.142, 0.03)]
    bearing = [(-0.122, 0.052), (-0.118, 0.06), (-0.07, 0.062), (0.07, 0.062)]
    cap = [(-0.124, 0.03), (-0.121, 0.034), (-0.115, 0.034)]
    yield ArmPart(1, STEEL, lathe(ring))
    yield ArmPart(1, PAINT, housing(SHOULDER))
    yield ArmPart(1, GRAPHITE, lathe(bearing, "y").moved(second_axis))
    yield ArmPart(1, GRAPHITE, lathe(motor, "y").moved(second_axis))
    yield ArmPart(1, STEEL, lathe(cap, "y").moved(second_axis))
    yield ArmPart(1, GRAPHITE, cylinder(0.09, 0.05, 0.007).moved((-0.045, 0, -0.045)))


def _upper_arm(length: float) -> Iterator[ArmPart]:
    lower_hub = [(0.05, 0.078), (0.056, 0.082), (0.086, 0.078), (0.092, 0.06)]
    upper_hub = [(0.056, 0.058), (0.06, 0.062), (0.087, 0.06), (0.091, 0.046)]
    cheek = [
        (0.0, 0.0, 0.074, 0.017, 4.0),
        (0.06, 0.0, 0.066, 0.018, 4.0),
        (0.4 * length, 0.0, 0.056, 0.019, 4.0),
        (0.75 * length, 0.0, 0.05, 0.018, 4.0),
        (length, 0.0, 0.056, 0.015, 4.0),
    ]
    web = [
        (0.105, -0.006, 0.034, 0.066, 4.0),
        (0.13, -0.006, 0.042, 0.068, 4.0),
        (length - 0.115, -0.006, 0.036, 0.068, 4.0),
        (length - 0.085, -0.006, 0.026, 0.066, 4.0),
    ]
    yield ArmPart(2, PAINT, housing(web))
    for side in (-1, 1):
        lower, upper = (  # profiles to the left, or their mirror images
            [(side * position, radius) for position, radius in hub[::side]]
            for hub in (lower_hub, upper_hub)
        )
        yield ArmPart(2, PAINT, lathe(lower, "y"))
        yield ArmPart(2, PAINT, lathe(upper, "y").moved((0, 0, length)))
        yield ArmPart(2, PAINT, housing(cheek).moved((0, 0.072 * side, 0)))
        yield ArmPart(2, STEEL, cylinder(0.006, 0.04, 0.002, "y").moved((0, 0.093 * side, length)))
    for angle in np.arange(6) * np.pi / 3 + 0.26:
        place = (0.05 * np.cos(angle), -0.093, 0.05 * np.sin(angle))
        yield ArmPart(2, STEEL, cylinder(0.006, 0.006, 0.001, "y").moved(place))


def _elbow() -> Iterator[ArmPart]:
    fourth_axis = (0, 0, 0.075)
    snout = [(0.05, 0.054), (0.08, 0.055), (0.092, 0.051), (0.096, 0.046)]
    ring = [(0.094, 0.044), (0.096, 0.048), (0.106, 0.048), (0.108, 0.044)]
    motor = [(-0.118, 0.03), (-0.112, 0.038), (-0.06, 0.041), (-0.05, 0.041)]
    yield ArmPart(3, PAINT, housing(ELBOW))
    yield ArmPart(3, GRAPHITE, cylinder(0.112, 0.054, 0.004, "y"))
    yield ArmPart(3, PAINT, lathe(snout, "x").moved(fourth_axis))
    yield ArmPart(3, STEEL, lathe(ring, "x").moved(fourth_axis))
    yield ArmPart(3, GRAPHITE, lathe(motor, "x").moved(fourth_axis))


def _forearm(length: float) -> Iterator[ArmPart]:
    start = 0.108 - length
    rear = [(start, 0.044), (start + 0.008, 0.05), (start + 0.06, 0.049)]
    front = [(-0.1, 0.041), (-0.075, 0.044), (-0.068, 0.04)]
    yield ArmPart(4, PAINT, lathe([*rear, *front], "x"))
    for side in (-1, 1):
        yield ArmPart(4, PAINT, _fork().moved((0, 0.043 * side, 0)))
        yield ArmPart(4, GRAPHITE, cylinder(0.008, 0.026, 0.002, "y").moved((0, 0.0545 * side, 0)))
        yield ArmPart(4, STEEL, cylinder(0.003, 0.012, 0.001, "y").moved((0, 0.0595 * side, 0)))


def _fork() -> Mesh:
    """A plate along x with a round end about the fifth axis."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, 17)
    end = np.column_stack([0.036 * np.cos(turn), 0.036 * np.sin(turn)])
    root = [(-0.08, 0.04), (-0.088, 0.03), (-0.088, -0.03), (-0.08, -0.04)]
    outline = np.concatenate([end, root])[::-1]
    levels = ((-0.011, 0.94), (-0.008, 1.0), (0.008, 1.0), (0.011, 0.94))
    return loft(np.array([np.insert(scale * outline, 1, y, axis=1) for y, scale in levels]))


def _wrist() -> Iterator[ArmPart]:
    barrel = [(0.0, 0.028), (0.03, 0.03), (0.058, 0.031), (0.062, 0.028)]
    yield ArmPart(5, STEEL, cylinder(0.062, 0.033, 0.003, "y"))
    yield ArmPart(5, GRAPHITE, lathe(barrel, "x"))


def _hand(tool: float) -> Iterator[ArmPart]:
    flange = [(-0.017, 0.028), (-0.015, 0.0315), (-0.002, 0.0315), (0.0, 0.03)]
    yield ArmPart(6, STEEL, lathe(flange, "x"))
    for angle in np.arange(4) * np.pi / 2 + np.pi / 4:
        place = (0.0005, 0.0235 * np.cos(angle), 0.0235 * np.sin(angle))
        yield ArmPart(6, GRAPHITE, cylinder(0.004, 0.0032, 0.0005, "x").moved(place))
    if tool == 0:
        return
    holder = [(0.0, 0.021), (0.02, 0.021), (0.034, 0.013), (0.04, 0.011)]
    rod = [(0.036, 0.0095), (0.04, 0.01), (tool - 0.03, 0.0085), (tool - 0.026, 0.0075)]
    yield ArmPart(6, GRAPHITE, lathe(holder, "x"))
    yield ArmPart(6, STEEL, lathe(rod, "x"))
    yield ArmPart(6, ACCENT, capsule(0.0, TIP).moved((tool - TIP, 0, 0)))
