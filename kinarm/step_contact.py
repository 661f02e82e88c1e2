"""Contact in the course of steps, where bodies of the scene may move."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.collision import Contact, ContactModel, Step
from kinarm.episodes import Episodes, Rules
from kinarm.errors import finite_array, whole_number
from kinarm.kernels.compiling import Array
from kinarm.motion_contact import contact_in_motion, steps_in_contact
from kinarm.problem import ReachProblem


class StepContact:
    """Asks Coal about steps, by the rules of a problem.

    Attributes
    ----------
    problem, rules, contact_model
        As of `kinarm.World`.
    """

    problem: ReachProblem
    rules: Rules
    contact_model: ContactModel

    def contact(
        self, configuration: ArrayLike, target: ArrayLike | None = None, *, step: int = 0
    ) -> Contact | None:
        """Describe the contact of a configuration, or the first one of a step; None if none.

        Parameters
        ----------
        configuration : array_like, shape (n_joints,)
            Where the arm is or the step begins [rad or m].
        target : array_like, shape (n_joints,), optional
            Where the step ends [rad or m].
        step : int
            Steps taken before, which tell where bodies are that move.
        """
        model, taken = self.contact_model, np.array([whole_number("step", step, 0)])
        q = finite_array("configuration", configuration, (model.arm.n_joints,))
        aim = q if target is None else finite_array("target", target, q.shape)
        scenes = model.shapes.placed[None][: len(model.shapes.moving)]
        (asked,) = self.steps_of(q[None], aim[None], scenes, taken)
        if target is None:
            model, _ = asked.at(0.0)
            return model.contact(q)
        return self.contact_of_step(asked)

    def contact_of_step(self, step: Step) -> Contact | None:
        """Describe the first contact of a step of `steps_of`, or return None."""
        if self.rules.tested == 0:
            return contact_in_motion(step)
        asked = (step.at(k / self.rules.tested) for k in range(1, self.rules.tested + 1))
        contacts = (model.contact(q) for model, q in asked)
        return next((contact for contact in contacts if contact), None)

    def steps_of(
        self, starts: Array, ends: Array, scenes: Array, taken: NDArray[np.int64]
    ) -> Iterator[Step]:
        """Steps of episodes, each to be used before the next.

        Parameters
        ----------
        starts, ends : ndarray, shape (n, n_joints)
            Where the arm moves [rad or m].
        scenes : ndarray, shape (n, n_placed, 16) or (0, n_placed, 16)
            Rows of the bodies when the episodes began, if they differ or move.
        taken : ndarray of int, shape (n,)
            Steps that the episodes have taken before.
        """
        model, before = self.contact_model, self.moved(scenes, taken)
        after = self.moved(scenes, taken + 1)
        for row, (start, end) in enumerate(zip(starts, ends, strict=True)):
            if not len(scenes):
                yield Step(model, start, end)
            elif not len(model.shapes.moving):
                # They are placed once for all of the step.
                yield Step(model.at(scenes[row]), start, end)
            else:
                yield Step(model, start, end, before[row], after[row])

    def moved(self, scenes: Array, taken: NDArray[np.int64]) -> Array:
        """Rows of the bodies of episodes after some steps; see `steps_of`."""
        moving = self.contact_model.shapes.moving
        if not len(scenes) or not len(moving):
            return scenes
        rows = scenes.copy()
        rows[:, moving, 13:] += self.problem.body_offsets(taken)
        return rows

    def decided(self, episodes: Episodes, rows: NDArray[np.int64]) -> tuple[NDArray[np.bool_], int]:
        """Let Coal decide about the steps of some episodes; see ``steps_in_contact``."""
        bodies = episodes.scenes_at(rows), episodes.steps[rows]
        steps = self.steps_of(episodes.q[rows], episodes.target[rows], *bodies)
        return steps_in_contact(steps, episodes.doubt[rows], self.rules)

    def contact_pair(
        self, configuration: ArrayLike, target: ArrayLike | None = None, *, step: int = 0
    ) -> tuple[str, str] | None:
        """Names of the bodies of what `contact` describes, or None."""
        contact = self.contact(configuration, target, step=step)
        return contact.pair if contact else None
