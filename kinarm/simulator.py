"""The simulator: a problem, stepped in batches of episodes."""

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._parallel import one_torch_thread, run_together
from kinarm.arm import Arm
from kinarm.episodes import PAUSED, RUNNING, Control, Episodes, Rollouts
from kinarm.errors import InvalidInputError, StartInContactError, finite_array
from kinarm.kernels.compiling import Array
from kinarm.kernels.rollout import advance, allow_one_step, begin, refuse, results_of_step
from kinarm.kernels.session import Session
from kinarm.kernels.shield import TRIED
from kinarm.networks import CompiledPolicy, Networks, PolicyFunction, network_control, takes_rows
from kinarm.plant import PlantLike
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.scenarios import draw_followers, draw_scenarios
from kinarm.scene import Scene
from kinarm.step_result import StepResult
from kinarm.task import ReachTask
from kinarm.world import World


class Simulator:
    """Steps batches of rate-limited joint kinematics with contact checks.

    An action in [-1, 1] (clipped) moves its joint by at most its velocity limit
    times the time step, within the limits. A step is tested for contact at
    evenly spaced configurations up to its end; a move that touches something is
    refused and ends the episode, as does the tool within the tolerance of the
    goal. Episodes are truncated at the horizon.

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
        self.world = World(problem, threads=threads)
        self.threads = self.world.threads
        self.checked_by_coal = 0
        self._last: Session | None = None
        self._idle: list[Session] = []

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_last": None, "_idle": []}

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
    def n_observations(self) -> int:
        """Length of an observation."""
        return self.world.n_observations

    @property
    def n_actions(self) -> int:
        """Length of an action."""
        return self.arm.n_actuated

    @property
    def step_limit(self) -> Array:
        """Largest move of each actuated joint, shape (n_actions,) [rad or m]."""
        return self.world.rules.step_limit.copy()

    def with_tolerance(self, tolerance: float) -> "Simulator":
        """Another simulator of the same world with another tolerance [m]."""
        other = copy(self)
        other.world = self.world.with_tolerance(tolerance)
        return other

    def in_scene(self, start: ArrayLike, goal: ArrayLike) -> "Simulator":
        """The simulator of one episode; see `kinarm.World.in_scene`."""
        other = copy(self)
        other.world = self.world.in_scene(start, goal)
        return other

    def with_plant(self, plant: PlantLike) -> "Simulator":
        """Another simulator of the same world with another plant, itself, its name or file."""
        other = copy(self)
        other.world = self.world.with_plant(plant)
        return other

    def shielded(self, shield: bool = True) -> "Simulator":
        """The same simulator with or without a shield."""
        other = copy(self)
        other.world = self.world.shielded(shield)
        return other

    def without_moving_bodies(self) -> "Simulator":
        """The same simulator without the bodies that move."""
        other = copy(self)
        other.world = self.world.without_moving_bodies()
        return other

    def sample(
        self, rng: np.random.Generator, count: int, *, start_spread: float | None = None
    ) -> tuple[Array, Array]:
        """Draw starts and goals.

        Parameters
        ----------
        rng, count, start_spread
            As for `kinarm.scenarios.draw_scenarios`.
        """
        return draw_scenarios(self.world, rng, count, start_spread=start_spread)

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
            Steps that they have taken before.
        drive : ndarray, shape (n, n_rows, n_actions), optional
            States of their plants; by default the arms rest.
        done : ndarray of int, shape (2, n), optional
            Goals that they have reached before, and steps in a row that they have
            kept the present one.
        """
        episodes = self.world.episodes(*self.world.check_scenarios(starts, goals), record=record)
        episodes.steps[:] = taken
        if done is not None:
            episodes.pursuit.goals_reached[:] = done[0]
        self._start(np.arange(len(episodes.steps)), self._stepped(episodes), origins, drive)
        if done is not None:
            episodes.pursuit.held[:] = done[1]
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
        session = self._step(episodes, actions)
        result = StepResult.empty(len(episodes.status), self.task)
        results_of_step(session, result.numbers, result.flags, result.contact)
        return result

    def rollout(
        self,
        policies: Networks | CompiledPolicy | Sequence[CompiledPolicy] | PolicyFunction,
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
        policies : Networks, policy, sequence of policies, or function
            One policy for all episodes, or one for each. Those with
            ``networks()`` run compiled; a function from observations (n,
            n_observations) to actions (n, n_actions) is called once a step for
            the running episodes; if it takes ``rows``, it gets their numbers.
        starts, goals, record
            As for `reset`.
        policy_index : array_like of int, shape (n,), optional
            Compiled policy of each episode, if there are several.
        shift : ndarray, shape (n_observations,), optional
            Collect moments of the observations about it.
        """
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
        episodes.steps[:] = taken
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

    def begin(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Start episodes of some rows, in place, at their ``q`` and ``goal``."""
        episodes.steps[rows] = 0
        self._start(rows, self._stepped(episodes))

    def _refilled(
        self, control: Control, starts: Array, goals: Array, shift: Array | None
    ) -> Session:
        """The last rollout's session, for this thread alone, or another."""
        with suppress(IndexError):
            session = self._idle.pop()
            if session.refill(control, starts, goals, shift):
                return session
        own = control._replace(layers=control.layers.copy(), weights=control.weights.copy())
        return self.world.session(own, self.world.episodes(starts, goals, shift=shift))

    def _run(self, session: Session) -> Episodes:
        """Start a session's episodes, and advance them to their end."""
        n = len(session.episodes.status)
        self._start(np.arange(n), session)
        self._advance(session, n * self.task.horizon)
        return session.episodes

    def _start(
        self,
        rows: NDArray[np.int64],
        session: Session,
        origins: Array | None = None,
        drive: Array | None = None,
    ) -> None:
        """Start some episodes in their scenes; Coal decides about doubtful starts."""
        episodes, contacts = session.episodes, self.world.contact_model
        begun = episodes.q[rows] if origins is None else origins
        goals, followers = episodes.goal[rows], episodes.pursuit.goals
        if self.world.plants.width:
            plants = self.world.plants.of(begun, goals, self.threads)
            rests = drive is None or not len(drive)
            episodes.plant[rows] = plants
            episodes.drive[rows] = (
                self.world.plants.at_rest(plants, episodes.q[rows]) if rests else drive
            )
        if self.world.has_random_bodies:
            episodes.scenes[rows] = self.world.scenes_of(begun, goals)
        if len(followers):
            followers[rows] = draw_followers(self.world, begun, goals)
        if origins is None and not self.task.goal.plain:
            episodes.pursuit.goals_reached[rows] = 0
        if not run_together(begin, len(rows), self.threads, session.of_thread, rows):
            return
        paused = rows[episodes.status[rows] == PAUSED]
        there = self.world.moved(episodes.scenes_at(paused), episodes.steps[paused])
        touching = contacts.touching(episodes.q[paused], there)
        if touching.any():
            first = int(touching.argmax())
            model = contacts.at(there[first]) if len(there) else contacts
            pair = model.contact_pair(episodes.q[paused[first]])
            raise StartInContactError(int(paused[first]), pair or ("arm", "scene"))
        episodes.status[paused] = RUNNING

    def _stepped(self, episodes: Episodes) -> Session:
        """Session of stepped episodes, kept until others come."""
        if self._last is None or self._last.episodes is not episodes:
            control = Control(actions=np.zeros((len(episodes.status), 1, self.n_actions)))
            self._last = self.world.session(control, episodes)
        return self._last

    def _step(self, episodes: Episodes, actions: ArrayLike) -> Session:
        session = self._stepped(episodes)
        table = session.control.actions[:, 0]
        plain = isinstance(actions, np.ndarray) and actions.dtype.kind == "f"
        if not plain or np.shape(actions) != table.shape:
            actions = finite_array("actions", actions, table.shape)
        table[...] = actions
        if not allow_one_step(session):
            finite_array("actions", actions, table.shape)  # which says what is wrong
        self._advance(session, len(table))
        return session

    def _advance(self, session: Session, work: int) -> None:
        """Advance episodes to their stop; Coal decides about steps in doubt."""
        episodes = session.episodes
        while run_together(advance, work, self.threads, session.of_thread):
            paused = np.flatnonzero(episodes.status == PAUSED)
            resumed = self._decide(session, paused)
            if resumed.size == 0:
                return
            work = int((episodes.stop - episodes.steps)[resumed].sum())

    def _decide(self, session: Session, paused: NDArray[np.int64]) -> NDArray[np.int64]:
        """Let Coal refuse steps in doubt; return which episodes go on."""
        episodes = session.episodes
        refused, asked = self.world.decided(episodes, paused)
        self.checked_by_coal += asked
        if len(self.world.rules.shield):
            rows = paused[refused]
            episodes.blocker[rows], episodes.touched[rows] = -1, 0
            episodes.attempt[rows], episodes.tried[rows] = 1, 0.0
            episodes.projected[rows, -2:] = TRIED, 0.0
            episodes.status[paused], episodes.cleared[paused] = RUNNING, ~refused
            return paused
        resumed: NDArray[np.int64] = paused[~refused]
        episodes.status[resumed] = RUNNING
        episodes.cleared[paused] = ~refused
        if refused.any():
            refuse(paused[refused], session)
        return resumed

    @one_torch_thread()
    def _follow(self, policy: PolicyFunction, episodes: Episodes) -> None:
        """Drive episodes to their end with a Python function."""
        numbered = takes_rows(policy)
        actions = np.zeros((len(episodes.status), self.n_actions))
        while (rows := np.flatnonzero(episodes.status == RUNNING)).size:
            seen = episodes.observation[rows]
            chosen = policy(seen, rows=rows) if numbered else policy(seen)
            actions[rows] = finite_array("actions", chosen, (len(rows), self.n_actions))
            self._step(episodes, actions)
