"""A second opinion on contact: MuJoCo's, of the same shapes and pairs, by its own kinematics."""

from importlib.util import find_spec
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import numpy as np
from numpy.typing import NDArray

from docs.measurements.mjcf import body_name, joint_name, mjcf
from kinarm.problem import ReachProblem
from kinarm.world import World

MARGIN = 1.1e-6
"""Distance or depth within which the engines may differ: Coal calls hulls that are 1e-6 m apart
touching, its tolerance, and MuJoCo keeps vertices in float32 [m]."""
ACCURACY = 1e-10
"""At which MuJoCo's iteration ends [m]."""
FARTHEST = 0.01
"""Distances above this are not measured [m]."""


UNFIT = {
    "z1": "MuJoCo 3.10 ends the process for some of its cylinders, near contact",
    "table-paper": "MuJoCo 3.10 overlooks some capsules that pass through a thin table top",
}
"""Arms and problems that MuJoCo is not asked about."""


def is_fit(problem: ReachProblem) -> bool:
    """Whether there is a second engine for a problem."""
    return find_spec("mujoco") is not None and not {problem.name, problem.arm.name} & UNFIT.keys()


class SecondEngine:
    """MuJoCo's view of a world, with exactly the pairs that kinarm tests."""

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
