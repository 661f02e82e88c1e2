"""The simulator: a problem, stepped in batches of episodes, and what a step gives."""

from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.episode_runner import EpisodeRunner
from kinarm.episodes import TRUNCATED, Control, Episodes, Rollouts
from kinarm.errors import InvalidInputError, finite_array
from kinarm.kernels.compiling import Array
from kinarm.kernels.rollout import results_of_step
from kinarm.networks import CompiledPolicy, Networks, PolicyFunction, network_control
from kinarm.plant import Plant
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.scenarios import draw_scenarios
from kinarm.scene import Scene
from kinarm.task import ReachTask
from kinarm.world import World


class StepResult(NamedTuple):
    """Outcome of one step of n episodes, in tables that the kernel fills.

    Attributes
    ----------
    numbers : ndarray, shape (2 + n_told + n_terms, n)
        Rewards, distances to the goal [m], what goals have beside it
        (``GoalSpecification.told``), and weighted terms, as in
        ``RewardWeights.terms``. Rewards are zero for episodes that were
        over.
    flags : ndarray of bool, shape (3, n)
        Truncation, success and refusal by contact; false for episodes that go
        on or were over.
    contact : ndarray of int, shape (n,)
        Number, from 1, of the pair that refused the step; 0 if none or unknown.
    task : ReachTask
        The task.
    """

    numbers: Array
    flags: NDArray[np.bool_]
    contact: NDArray[np.int64]
    task: ReachTask

    @property
    def reward(self) -> Array:
        """Sums of the terms, shape (n,)."""
        return self.numbers[0, :]

    @property
    def distance(self) -> Array:
        """From the tool to the goal [m], shape (n,)."""
        return self.numbers[1, :]

    @property
    def terms(self) -> Array:
        """The weighted terms, shape (n, n_terms)."""
        return self.numbers[-len(self.task.reward.terms) :].T

    @property
    def told(self) -> dict[str, Array]:
        """What goals have beside a distance, ``turn`` and ``goals_reached``, shape (n,) each."""
        return dict(zip(self.task.goal.told, self.numbers[2:], strict=False))

    @property
    def truncated(self) -> NDArray[np.bool_]:
        """Whether the step ended an episode at the horizon, shape (n,)."""
        return self.flags[0, :]

    @property
    def success(self) -> NDArray[np.bool_]:
        """Whether it reached the goal, shape (n,)."""
        return self.flags[1, :]

    @property
    def collision(self) -> NDArray[np.bool_]:
        """Whether it was refused, shape (n,)."""
        return self.flags[2, :]

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Success or collision, shape (n,)."""
        return self.flags[1, :] | self.flags[2, :]


class Simulator(EpisodeRunner):
    """Steps batches of rate-limited joint kinematics with contact checks.

    An action in [-1, 1] (clipped) moves its joint by at most its velocity limit
    times the time step, within the limits. All of the move is tested for
    contact, or some of its configurations, as the problem says. One that
    touches something is refused and ends the episode, as does the tool within
    the tolerance of the goal. Episodes are truncated at the horizon.

    Results depend on the inputs alone: not on threads, nor on batches. Arrays
    of a wrong shape, entries that are not finite and starts more than 1e-6
    beyond the limits are a `kinarm.InvalidInputError`, starts that touch
    something a `kinarm.StartInContactError`.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem, its name or file.
    threads : int, optional
        Threads for large batches; as many as available processors by default.

    Attributes
    ----------
    world : World
        Arm and scene, and questions about configurations.
    checked_by_coal : int
        Configurations that Coal was asked about so far.
    """

    def __init__(self, problem: ProblemLike, *, threads: int | None = None) -> None:
        super().__init__(World(problem, threads=threads))

    def __repr__(self) -> str:
        return f"Simulator({self.problem!r})"

    @property
    def problem(self) -> ReachProblem:
        """The problem that is stepped."""
        return self.world.problem

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.world.arm

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.problem.scene

    @property
    def task(self) -> ReachTask:
        """The task."""
        return self.problem.task

    @property
    def step_limit(self) -> Array:
        """Largest move of each actuated joint, shape (n_actions,) [rad or m]."""
        return self.world.rules.step_limit.copy()

    def _in(self, world: World) -> "Simulator":
        """The same simulator in another world."""
        other = copy(self)
        other.world = world
        return other

    def changed(self, **changes: Any) -> "Simulator":
        """Another simulator of the world with other settings; see `kinarm.World.changed`."""
        return self._in(self.world.changed(**changes))

    def in_scene(self, start: ArrayLike, goal: ArrayLike) -> "Simulator":
        """The simulator of one episode; see `kinarm.World.in_scene`."""
        return self._in(self.world.in_scene(start, goal))

    def with_plant(self, plant: Plant | str | Path) -> "Simulator":
        """Another simulator of the same world with another plant, itself, its name or file."""
        return self.changed(plant=plant)

    def shielded(self, shield: bool = True) -> "Simulator":
        """The same simulator with or without a shield."""
        return self.changed(shield=shield)

    def without_moving_bodies(self) -> "Simulator":
        """The same simulator without the bodies that move."""
        return self._in(self.world.without_moving_bodies())

    def sample(self, rng: np.random.Generator, count: int) -> tuple[Array, Array]:
        """Draw starts and goals.

        Parameters
        ----------
        rng, count
            As for `kinarm.scenarios.draw_scenarios`.

        Returns
        -------
        tuple of ndarray, shape (count, n_joints) and (count, goal_width)
            Starts [rad or m] and goals [m].
        """
        starts, goals = draw_scenarios(self.world, [rng], count)
        return starts[0], goals[0]

    def reset(
        self,
        starts: ArrayLike,
        goals: ArrayLike,
        *,
        record: bool = False,
        origins: Array | None = None,
        taken: NDArray[np.int64] | int = 0,
        drive: Array | None = None,
        done: NDArray[np.int64] | None = None,
    ) -> Episodes:
        """Begin a batch of episodes, to be driven by `step`.

        Parameters
        ----------
        starts, goals : array_like, shape (n, n_joints) and (n, goal_width)
            Start configurations [rad or m], and (first) goals: positions [m], and
            their rests.
        record : bool
            Keep the configurations visited.
        origins : ndarray, shape (n, n_joints), optional
            Where episodes that go on at these starts had begun [rad or m]:
            random bodies and later goals stay.
        taken : ndarray of int, shape (n,), or int
            Steps that they have taken before; after the last one they are over.
        drive : ndarray, shape (n, n_rows, n_actions), optional
            States of their plants; by default the arms rest.
        done : ndarray of int, shape (2, n), optional
            Goals that they have reached before, and steps in a row that they have
            kept the present one.
        """
        episodes = self.world.episodes(*self.world.check_scenarios(starts, goals), record=record)
        episodes.steps[:] = self.world.checked_steps(taken)
        reached, held = (0, None) if done is None else done
        rows = np.arange(len(episodes.steps))
        self._start(rows, self._stepped(episodes), origins, drive, reached)
        if held is not None:
            episodes.pursuit.held[:] = held
        episodes.status[episodes.steps >= self.task.horizon] = TRUNCATED
        return episodes

    def step(self, episodes: Episodes, actions: ArrayLike) -> StepResult:
        """Advance every running episode by one step, in place.

        Parameters
        ----------
        episodes : Episodes
            What `reset` returned.
        actions : array_like, shape (n, n_actions)
            Fractions of the velocity limits, clipped to [-1, 1].
        """
        session, task, n = self._step(episodes, actions), self.task, len(episodes.status)
        numbers = np.empty((2 + len(task.goal.told) + len(task.reward.terms), n))
        result = StepResult(numbers, np.empty((3, n), bool), np.empty(n, np.int64), task)
        results_of_step(session, result.numbers, result.flags, result.contact)
        return result

    def rollout(
        self,
        policies: Networks | CompiledPolicy | PolicyFunction,
        starts: ArrayLike,
        goals: ArrayLike,
        *,
        policy_index: ArrayLike | None = None,
        record: bool = False,
        shift: Array | None = None,
    ) -> Rollouts:
        """Run whole episodes.

        Parameters
        ----------
        policies : Networks, policy or function
            One policy for all episodes, or networks for each. What has
            ``networks()`` runs compiled; a function from observations (n,
            n_observations) to actions (n, n_actions) is called once a step for
            the running episodes; if it takes ``rows``, it gets their numbers.
            A policy with an attribute ``observation`` sees that, one with ``shield``
            acts behind a shield.
        starts, goals, record
            As for `reset`.
        policy_index : array_like of int, shape (n,), optional
            Network of each episode, if there are several.
        shift : ndarray, shape (n_observations,), optional
            Collect moments of the observations about it.
        """
        own = self._own_of(policies)
        if own is not self:
            return own.rollout(
                policies, starts, goals, policy_index=policy_index, record=record, shift=shift
            )
        q, goal = self.world.check_scenarios(starts, goals)
        if shift is not None:
            shift = finite_array("shift", shift, (self.n_observations,))
        if callable(policies) and not isinstance(policies, CompiledPolicy):
            if policy_index is not None:
                raise InvalidInputError("policy_index does not apply to a function")
            episodes = self.world.episodes(q, goal, record=record, shift=shift)
            self._start(np.arange(len(q)), self._stepped(episodes))
            self._follow(policies, episodes)
            return Rollouts.from_episodes(q, episodes)
        widths = (self.n_observations, self.n_actions)
        control = network_control(policies, policy_index, len(q), widths)
        if record:
            episodes = self.world.episodes(q, goal, record=True, shift=shift)
            return Rollouts.from_episodes(q, self._run(self.world.session(control, episodes)))
        session = self._refilled(control, q, goal, shift)
        rollouts = Rollouts.from_episodes(q, self._run(session), copy=True)
        self._idle[:] = [session]
        return rollouts

    def _own_of(self, policies: object) -> "Simulator":
        """The simulator that policies act in: with their own observation and shield, if any."""
        own, seen = self, getattr(policies, "observation", self.problem.observation)
        if seen != self.problem.observation:
            own = own.changed(observation=seen)
        if getattr(policies, "shield", False) and not self.problem.stepping.shield:
            own = own.shielded()
        return own

    def rollout_actions(
        self,
        actions: ArrayLike,
        starts: ArrayLike,
        goals: ArrayLike,
        *,
        record: bool = False,
        taken: NDArray[np.int64] | int = 0,
    ) -> Rollouts:
        """Run whole episodes on given actions.

        Parameters
        ----------
        actions : array_like, shape (n, horizon, n_actions)
            Fractions of the velocity limits, clipped to [-1, 1].
        starts, goals, record, taken
            As for `reset`; of actions, those of steps taken before are left out.
        """
        q, goal = self.world.check_scenarios(starts, goals)
        table = finite_array("actions", actions, (len(q), self.task.horizon, self.n_actions))
        episodes = self.world.episodes(q, goal, record=record)
        episodes.steps[:] = self.world.checked_steps(taken)
        session = self.world.session(Control(actions=table), episodes)
        return Rollouts.from_episodes(q, self._run(session))

    def contact_pairs(self, rollouts: Rollouts) -> tuple[tuple[str, str] | None, ...]:
        """Bodies that touched, per episode; None where nothing did."""
        pairs: list[tuple[str, str] | None] = [None] * len(rollouts)
        for i in np.flatnonzero(rollouts.collision):
            there = self.world.in_scene(rollouts.starts[i], rollouts.goals[i])
            step = rollouts.configurations[i], rollouts.targets[i]
            pairs[i] = there.contact_pair(*step, step=int(rollouts.steps[i]) - 1)
        return tuple(pairs)
