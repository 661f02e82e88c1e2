"""The world of a problem: arm and scene, and what can be asked about configurations in it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import available_threads, run_rows
from kinarm._validation import finite_array, whole_number
from kinarm.collision import Contact, ContactModel
from kinarm.episodes import Control, Episodes, Rules
from kinarm.errors import ProblemError
from kinarm.kernels.rollout import begin, bind, screen
from kinarm.kernels.session import Session
from kinarm.networks import table_control
from kinarm.observation import observation_size
from kinarm.problem import ProblemLike, ReachProblem


class World:
    """An arm in a scene.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem, its name or its file.
    threads : int, optional
        Threads for large batches; as many as the processors that this process may use by default.

    Attributes
    ----------
    problem : ReachProblem
        What it was built from.
    arm : Arm
        The arm.
    contact_model : ContactModel
        Shapes that may touch.
    rules : Rules
        Task and motion limits as the kernels need them.
    """

    def __init__(self, problem: ProblemLike, *, threads: int | None = None) -> None:
        self.problem = ReachProblem.load(problem)
        self.threads = (
            available_threads() if threads is None else whole_number("threads", threads, 1)
        )
        self.arm = self.problem.load_arm()
        self.contact_model = ContactModel.build(self.arm, self.problem.scene)
        self._check_starts()
        task, stepping = self.problem.task, self.problem.stepping
        n_tested = stepping.tested_configurations
        self.rules = Rules(
            step_limit=self.arm.velocity_limits[: self.arm.n_actuated] * stepping.time_step,
            tested=n_tested,
            tolerance=float(task.tolerance),
            horizon=int(task.horizon),
            reward=task.reward.vector,
        )
        self._shares = np.arange(1, n_tested + 1)[:, None] / n_tested

    def _check_starts(self) -> None:
        """Refuse configurations that the task lists but that nothing can start at."""
        for number, start in enumerate(self.problem.task.starts):
            name = f"task.starts[{number}]"
            q = finite_array(name, start, (self.arm.n_joints,))
            if ((q < self.arm.lower) | (q > self.arm.upper)).any():
                raise ProblemError(f"{name} lies outside the limits: {list(start)}")
            pair = self.contact_model.contact_pair(q)
            if pair is not None:
                raise ProblemError(f"{name} is in contact: {pair[0]} touches {pair[1]}")

    def __repr__(self) -> str:
        return f"World({self.problem!r})"

    @property
    def n_observations(self) -> int:
        """Length of an observation."""
        return observation_size(self.arm.n_joints)

    @property
    def n_actions(self) -> int:
        """Length of an action."""
        return self.arm.n_actuated

    def observe(self, configurations: ArrayLike, goals: ArrayLike) -> NDArray[np.float64]:
        """Observations of configurations, whether or not they touch something.

        Parameters
        ----------
        configurations : array_like, shape (n, n_joints)
            Joint positions [rad or m].
        goals : array_like, shape (n, 3)
            Goal positions [m].

        Returns
        -------
        ndarray, shape (n, n_observations)
        """
        return self._begun_at(configurations, goals).observation

    def distances(self, configurations: ArrayLike, goals: ArrayLike) -> NDArray[np.float64]:
        """Distances from the tool to goals [m], shape (n,).

        Parameters
        ----------
        configurations, goals : array_like
            As for `observe`.
        """
        return self._begun_at(configurations, goals).distance

    def screen(self, configurations: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Find tool points, and which configurations touch something.

        Parameters
        ----------
        configurations : array_like, shape (n, n_joints)
            Joint positions [rad or m].

        Returns
        -------
        tools : ndarray, shape (n, 3)
            Tool points [m].
        touching : ndarray of bool, shape (n,)
        """
        q = finite_array("configurations", configurations, (None, self.arm.n_joints))
        n = len(q)
        tools, proven = np.empty((n, 3)), np.empty(n, dtype=bool)
        arrays = (self.arm.chain, self.contact_model.shapes, q, tools, proven)
        run_rows(screen, n, n, self.threads, *arrays)
        touching = ~proven
        touching[touching] = self.contact_model.in_contact(q[touching])
        return tools, touching

    def contact(self, configuration: ArrayLike, target: ArrayLike) -> Contact | None:
        """Describe the first contact on the way of a step, or return None.

        Parameters
        ----------
        configuration, target : array_like, shape (n_joints,)
            Ends of the step [rad or m].
        """
        q = finite_array("configuration", configuration, (self.arm.n_joints,))
        aim = finite_array("target", target, (self.arm.n_joints,))
        tested = self.substeps(q[None], aim[None])[0]
        touching = np.flatnonzero(self.contact_model.in_contact(tested))
        return self.contact_model.contact(tested[touching[0]]) if touching.size else None

    def contact_pair(self, configuration: ArrayLike, target: ArrayLike) -> tuple[str, str] | None:
        """Name the first two bodies that touch on the way of a step, or None.

        Parameters
        ----------
        configuration, target : array_like, shape (n_joints,)
            Ends of the step [rad or m].
        """
        contact = self.contact(configuration, target)
        return contact.pair if contact else None

    def substeps(
        self, configurations: NDArray[np.float64], targets: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Configurations at which the motion of a step is tested for contact.

        Parameters
        ----------
        configurations, targets : ndarray, shape (n, n_joints)
            Ends of the steps [rad or m].

        Returns
        -------
        ndarray, shape (n, n_tested, n_joints)
            Evenly spaced; the last one is the target.
        """
        ways = configurations[:, None] + self._shares * (targets - configurations)[:, None]
        ways[:, -1] = targets
        return ways

    def session(self, control: Control, episodes: Episodes) -> Session:
        """Bind episodes, and where their actions come from, for the kernels."""
        return bind(self.arm.chain, self.contact_model.shapes, self.rules, control, episodes)

    def _begun_at(self, configurations: ArrayLike, goals: ArrayLike) -> Episodes:
        """Episodes that begin at configurations, whether or not those touch something."""
        q = finite_array("configurations", configurations, (None, self.arm.n_joints))
        goal = finite_array("goals", goals, (len(q), 3))
        n_pairs = len(self.contact_model.shapes.pairs)
        episodes = Episodes.allocate(q, goal, n_pairs=n_pairs, horizon=1)
        at_rest = table_control(np.zeros((len(q), 1, self.n_actions)))
        begin(0, len(q), np.arange(len(q)), self.session(at_rest, episodes))
        return episodes
