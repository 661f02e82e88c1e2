"""A chain that hangs straight down: parallel axes, whose motion attains its bounds."""

import numpy as np

from kinarm.arm import Arm
from kinarm.problem import PROBLEMS
from kinarm.scene import Obstacle, Scene
from kinarm.simulator import Simulator

LENGTHS = np.array([0.5, 0.4, 0.3])
"""From each horizontal axis to the next one, and to the tool [m]."""

RADIUS = 0.05
"""Of the balls about the tool and on the base, the only shapes [m]."""

BASE = (0.09, 0.0, 2.0)
"""Middle of the ball on the base [m]."""

SLAB = Obstacle(name="slab", lower=(-3, -1, 0), upper=(3, 1, 0.2))


def hanging_chain(make_joint, make_collision, write_robot, *obstacles):
    """Simulator of three axes along y below a vertical slide, above obstacles and the ground."""
    limit = '<limit lower="-3" upper="4" velocity="1" effort="0"/>'
    offsets = ("0 0 0", *(f"0 0 {-length}" for length in LENGTHS[:-1]))
    joints = [make_joint("prismatic", xyz="0 0 0", limit=limit)]
    joints += [make_joint(xyz=xyz, axis="0 1 0", limit=limit) for xyz in offsets]
    places = {0: "{} {} {}".format(*BASE), len(joints): f"0 0 {-LENGTHS[-1]}"}
    ball = f'<sphere radius="{RADIUS}"/>'
    shapes = {link: make_collision(ball, xyz=place) for link, place in places.items()}
    arm = Arm.load(write_robot(joints, shapes, tool=places[len(joints)]))
    scene = Scene(obstacles=obstacles)
    return Simulator(PROBLEMS["both"].replace(arm=arm, scene=scene), threads=1)


def tips(configurations):
    """Where the tool is along x and z, shape (..., 2) [m]."""
    angles = np.cumsum(configurations[..., 1:], axis=-1)
    below = np.stack([np.sin(angles) @ LENGTHS, np.cos(angles) @ LENGTHS], axis=-1)
    return np.stack([0 * configurations[..., 0], configurations[..., 0]], axis=-1) - below
