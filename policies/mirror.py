"""Reflection about the x-z plane: what it does to observations and actions.

The reflection y -> -y maps the right bench to the left one and an arm that is symmetric about its
x-z plane to itself, with axes that turn about x or z reversed. In kinarm's observations and actions
it only changes signs. A linear policy commutes with it exactly if its weights vanish wherever the
signs of input and output disagree: it then does on one bench what it does on the other.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kinarm.errors import InvalidInputError
from kinarm.scene import Bench, Scene
from kinarm.simulator import Simulator

TESTED_CONFIGURATIONS = 16
ACCURACY = 1e-9
GOAL_Y = 1
"""Index of the goal's y coordinate in an observation."""


class Mirror(NamedTuple):
    """Signs that the reflection gives to each number.

    Attributes
    ----------
    axes : ndarray, shape (n_axes,)
        Signs of the axis positions.
    observations : ndarray, shape (n_observations,)
        Signs of the entries of an observation.
    actions : ndarray, shape (n_actions,)
        Signs of the entries of an action.
    """

    axes: NDArray[np.float64]
    observations: NDArray[np.float64]
    actions: NDArray[np.float64]

    @property
    def weights(self) -> NDArray[np.bool_]:
        """Where a linear policy that commutes with the reflection may have weights.

        Shape (n_actions, n_observations).
        """
        return np.outer(self.actions, self.observations) > 0

    def seen_on_the_left(self, observations: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which observations, shape (n, n_observations), have a goal to the left of the arm."""
        left: NDArray[np.bool_] = observations[:, GOAL_Y] > 0
        return left

    def to_the_right(self, observations: NDArray[np.float64]) -> NDArray[np.float64]:
        """Reflect those observations, shape (n, n_observations), whose goal lies to the left."""
        left = self.seen_on_the_left(observations)
        return np.where(left[:, None], observations * self.observations, observations)

    @classmethod
    def of(cls, simulator: Simulator) -> "Mirror":
        """Find the signs for an arm, and check them with forward kinematics.

        Raises
        ------
        InvalidInputError
            If the reflection does not map the arm's motions to themselves.
        """
        arm = simulator.arm
        polar = np.array([1.0, -1.0, 1.0])
        along_y = np.abs(arm.chain.axis[:, 1]) > 0.5
        axes = np.where(along_y ^ arm.chain.prismatic, 1.0, -1.0)
        quaternion = np.array([1.0, -1.0, 1.0, -1.0])
        observations = np.concatenate(
            [polar, polar, np.tile(quaternion, arm.n_axes), np.tile(polar, arm.n_axes)]
        )
        mirror = cls(axes, observations, axes[: arm.n_actuated])
        if not mirror._fits(simulator):
            raise InvalidInputError(
                f"arm {arm.name!r} is not its own mirror image: train it without symmetric"
            )
        return mirror

    def _fits(self, simulator: Simulator) -> bool:
        """Whether mirrored configurations lead to mirrored observations, limits included."""
        arm = simulator.arm
        limits = np.sort(np.array([self.axes * arm.lower, self.axes * arm.upper]), axis=0)
        if not np.allclose(limits, [arm.lower, arm.upper], rtol=0, atol=ACCURACY):
            return False
        rng = np.random.default_rng(0)
        q = rng.uniform(arm.lower, arm.upper, (TESTED_CONFIGURATIONS, arm.n_axes))
        goals = rng.normal(size=(TESTED_CONFIGURATIONS, 3))
        seen = simulator.observe(q, goals)
        mirrored = simulator.observe(self.axes * q, goals * self.observations[:3])
        return np.allclose(mirrored, seen * self.observations, rtol=0, atol=ACCURACY)


def task_mirror(symmetric: bool, simulator: Simulator) -> Mirror | None:
    """Reflection that a policy has to commute with, if it is to and the task is its own image.

    Raises
    ------
    InvalidInputError
        If the reflection does not map the arm's motions to themselves.
    """
    if not (symmetric and is_symmetric(simulator.scene, simulator.task.benches)):
        return None
    return Mirror.of(simulator)


def is_symmetric(scene: Scene, benches: tuple[str, ...]) -> bool:
    """Whether the reflection maps a scene, and the benches that carry cubes, to themselves."""
    chosen = [scene.bench(name) for name in benches]
    return _closed_under_reflection(scene.benches) and _closed_under_reflection(chosen)


def _closed_under_reflection(benches: "tuple[Bench, ...] | list[Bench]") -> bool:
    boxes = {(bench.x, bench.y, bench.height) for bench in benches}
    return boxes == {(x, (-y[1], -y[0]), height) for x, y, height in boxes}
