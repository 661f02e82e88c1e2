"""The scenes of episodes, and worlds that differ in one of them, or in settings."""

from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from kinarm.arm import Arm
from kinarm.bodies import PARKED
from kinarm.collision import ContactModel
from kinarm.episode_plants import EpisodePlants
from kinarm.episode_scenes import drawn_rows
from kinarm.episodes import Rules
from kinarm.errors import finite_array
from kinarm.kernels.compiling import Array
from kinarm.problem import ReachProblem
from kinarm.scene_draws import SceneDraws


class WorldChanges:
    """Makes other worlds of one; they share all else."""

    problem: ReachProblem
    arm: Arm
    contact_model: ContactModel
    rules: Rules
    plants: EpisodePlants
    has_random_bodies: bool
    threads: int

    @cached_property
    def _draws(self) -> SceneDraws:
        return SceneDraws.of(self.problem.scene)

    @cached_property
    def _no_scenes(self) -> Array:
        return np.zeros((0, *self.contact_model.shapes.placed.shape))

    def scenes_of(self, starts: Array, goals: Array) -> Array:
        """Rows of the bodies of each episode, shape (n, n_placed, 16); empty if all have the same.

        See `kinarm.contact_shapes.ContactShapes.placed`. Takes starts, shape (n, n_joints) [rad or
        m], and goals, shape (n, goal_width); ProblemError if a body finds no place.
        """
        if not self.has_random_bodies:
            return self._no_scenes
        drawn = self.problem.scene, self._draws, self.arm.chain
        return drawn_rows(*drawn, starts, np.ascontiguousarray(goals[:, :3]), self.threads)

    def changed(self, **changes: Any) -> Self:
        """The same world of a problem with other settings of task, plant, observation or stepping.

        Takes what `kinarm.ReachProblem.replace` does, but for arm and scene. Raises ProblemError if
        arm or scene cannot have the observation.
        """
        other = copy(self)
        other.problem = self.problem.replace(**changes)
        other._derive()
        return other

    def _derive(self) -> None:
        raise NotImplementedError

    def in_scene(self, start: ArrayLike, goal: ArrayLike) -> Self:
        """The world of one episode, whose random bodies stay where they are.

        Takes its start, shape (n_joints,) [rad or m], and its goal, shape (3 or goal_width,).
        """
        if not self.has_random_bodies:
            return self
        q = finite_array("start", start, (self.arm.n_joints,))
        aim = finite_array("goal", goal, (None,))
        other, scenes = copy(self), self.scenes_of(q[None], aim[None])
        other.has_random_bodies = False
        other.contact_model = self.contact_model.fixed(scenes[0])
        return other

    def without_moving_bodies(self) -> Self:
        """The same world without the bodies that move."""
        shapes = self.contact_model.shapes
        if not len(shapes.moving):
            return self
        rows = shapes.placed.copy()
        # What is on the other side of a half-space is far from its plane.
        rows[shapes.moving, 13:] = PARKED[2] * rows[shapes.moving][:, [6, 9, 12]]
        other, model = copy(self), self.contact_model.fixed(rows)
        none = np.zeros(0, dtype=np.int64)
        other.contact_model = replace(model, shapes=model.shapes._replace(moving=none))
        return other
