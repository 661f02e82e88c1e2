"""Second opinions on contact: MuJoCo's, in a process that it may end, and the definition."""

import multiprocessing
from collections.abc import Callable
from importlib.util import find_spec
from multiprocessing.sharedctypes import RawArray
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from docs.measurements.mjcf import body_name, joint_name, mjcf
from kinarm.world import World

MARGIN = 1.1e-6
"""Distance or depth within which the engines may differ: Coal calls hulls that are 1e-6 m apart
touching, its tolerance, and MuJoCo keeps vertices in float32 [m]."""
ACCURACY = 1e-10
"""At which MuJoCo's iteration ends [m]."""
FARTHEST = 0.01
"""Distances above this are not measured [m]."""


def is_installed() -> bool:
    """Whether there is a second engine."""
    return find_spec("mujoco") is not None


class SecondEngine:
    """MuJoCo's view of a world, with exactly the pairs that kinarm tests.

    Its methods may end the process: MuJoCo 3.10 does so for some cylinders near contact.
    """

    def __init__(self, world: World) -> None:
        import mujoco

        self._mujoco = mujoco
        self._model = mujoco.MjModel.from_xml_string(_described(world))
        self._model.opt.ccd_tolerance = ACCURACY
        self._data = mujoco.MjData(self._model)
        self._pairs = [
            tuple(self._model.geom(f"shape{index}").id for index in (pair.first, pair.second))
            for pair in world.contact_model.geometry.collisionPairs
        ]

    def in_contact(self, configuration: NDArray[np.float64]) -> bool:
        """Whether a configuration, shape (n_joints,) [rad or m], touches something."""
        self._data.qpos[:] = configuration
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_collision(self._model, self._data)
        return bool(self._data.ncon > 0)

    def distance(self, configuration: NDArray[np.float64], pair: int) -> float:
        """Distance of a tested pair, negative if it overlaps; `FARTHEST` at most [m]."""
        self._data.qpos[:] = configuration
        self._mujoco.mj_kinematics(self._model, self._data)
        names, line = self._pairs[pair], np.zeros(6)
        return float(self._mujoco.mj_geomDistance(self._model, self._data, *names, FARTHEST, line))

    def depth(self, configuration: NDArray[np.float64]) -> float:
        """How deep the deepest of the contacts is that are found, 0 without one [m]."""
        self.in_contact(configuration)
        return -float(self._data.contact.dist.min(initial=0.0))


def _described(world: World) -> str:
    """The world as MJCF, with all joints free to move and the tested pairs named one by one."""
    root, arm = ElementTree.fromstring(mjcf(world, 0.01)), world.arm
    for geom in root.iter("geom"):
        geom.attrib.update(contype="0", conaffinity="0")
    bodies = {body.get("name"): body for body in root.iter("body")}
    for k in range(world.n_actions, arm.n_joints):
        SubElement(
            bodies[body_name(k + 1)],
            "joint",
            name=joint_name(k),
            type="slide" if arm.chain.prismatic[k] else "hinge",
            axis=" ".join(repr(float(value)) for value in arm.chain.axis[k]),
            ref=repr(float(arm.home[k])),
        )
    contact = root.find("contact")
    assert contact is not None
    contact.clear()
    for pair in world.contact_model.geometry.collisionPairs:
        SubElement(contact, "pair", geom1=f"shape{pair.first}", geom2=f"shape{pair.second}")
    return ElementTree.tostring(root, encoding="unicode")


def surviving(call: Callable[[int], float], count: int) -> NDArray[np.float64]:
    """What a call gives for each number below a count; NaN where it ends the process.

    A child makes the calls, and another one goes on behind a call that ended it.
    """
    fork = multiprocessing.get_context("fork")
    results = np.frombuffer(RawArray("d", max(1, count)))[:count]
    begun = np.frombuffer(RawArray("q", 1), dtype=np.int64)
    results[:], begun[0] = np.nan, -1

    def work() -> None:
        for number in range(int(begun[0]) + 1, count):
            begun[0] = number
            results[number] = call(number)

    while begun[0] + 1 < count:
        child = fork.Process(target=work)
        child.start()
        child.join()
        if child.exitcode is not None and child.exitcode > 0:
            raise RuntimeError(f"a call ended with status {child.exitcode}")
    return np.array(results)


def capsule_box_distance(
    world: World, configuration: NDArray[np.float64], pair: int
) -> float | None:
    """Distance of a tested pair's capsule from its box by their definition; None for others.

    Where they overlap it is negative, and at least minus the radius [m].
    """
    geometry, model = world.contact_model.geometry, world.arm.model
    placed = geometry.createData()
    pin.updateGeometryPlacements(model, model.createData(), geometry, placed, configuration)
    numbers = geometry.collisionPairs[pair].first, geometry.collisionPairs[pair].second
    shapes = {
        type(solid): (solid, placed.oMg[number])
        for number in numbers
        for solid in [geometry.geometryObjects[number].geometry]
    }
    if set(shapes) != {coal.Capsule, coal.Box}:
        return None
    (capsule, moved), (box, standing) = shapes[coal.Capsule], shapes[coal.Box]

    def outside(along: float) -> float:
        """How far a point of the capsule's axis is from the box; a convex function."""
        point = standing.actInv(moved.act(np.array([0.0, 0.0, along])))
        return float(np.linalg.norm(np.maximum(np.abs(point) - box.halfSide, 0.0)))

    ends = -capsule.halfLength, capsule.halfLength
    found = minimize_scalar(outside, bounds=ends, method="bounded", options={"xatol": 1e-12})
    return min(found.fun, *map(outside, ends)) - float(capsule.radius)
