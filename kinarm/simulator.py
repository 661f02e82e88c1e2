"""The simulator: an arm in a scene with a task, stepped in batches of episodes."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm import kernels
from kinarm.arm import Arm
from kinarm.collision import Contact, ContactModel
from kinarm.episodes import (
    COLLISION,
    PAUSED,
    RUNNING,
    SUCCESS,
    TRUNCATED,
    Control,
    Episodes,
    Rules,
    observation_size,
)
from kinarm.errors import InvalidInputError, StartInContactError
from kinarm.networks import CompiledPolicy, Networks, network_control, table_control
from kinarm.parallel import available_threads, run_rows
from kinarm.rollouts import Rollouts
from kinarm.scenarios import draw_scenarios
from kinarm.scene import Scene
from kinarm.task import ReachTask, RewardTerms, load_task, reward_terms
from kinarm.validation import finite_array, whole_number

TIME_STEP = 0.02
"""Duration of a step [s]."""

PolicyFunction = Callable[[NDArray[np.float64]], ArrayLike]
"""Maps observations, shape (n, n_observations), to actions, shape (n, n_actuated)."""


class StepResult(NamedTuple):
    """Outcome of one step of n episodes; arrays of shape (n,).

    Attributes
    ----------
    reward : ndarray
        Sum of the terms; zero for episodes that were over before.
    terms : RewardTerms
        The weighted terms.
    success, collision, truncated : ndarray of bool
        How the step ended; all false for episodes that go on or were over before.
    """

    reward: NDArray[np.float64]
    terms: RewardTerms
    success: NDArray[np.bool_]
    collision: NDArray[np.bool_]
    truncated: NDArray[np.bool_]

    @property
    def terminated(self) -> NDArray[np.bool_]:
        """Success or collision."""
        return self.success | self.collision


class Simulator:
    """Steps batches of rate-limited joint kinematics with contact checks.

    An action in [-1, 1] (clipped) moves its axis by at most the rated speed times the time step,
    within the limits. The motion of a step is tested for contact at four evenly spaced
    configurations, the last one included; a move that touches something is refused and ends the
    episode. An episode also ends when the tool comes within the tolerance of the goal, and is
    truncated at the horizon.

    Results depend on nothing but the inputs: not on the number of threads, nor on how episodes
    are batched.

    Parameters
    ----------
    arm : Arm or str
        The arm, or what `Arm.load` takes.
    task : ReachTask or str
        The task, or its name.
    scene : Scene, optional
        The paper's scene by default.
    time_step : float
        Duration of a step [s].
    threads : int, optional
        Threads for large batches; as many as the processors that this process may use by default.

    Attributes
    ----------
    judged : int
        Configurations that rollouts and steps have asked Coal about so far.
    """

    def __init__(
        self,
        arm: Arm | str = "paper",
        task: ReachTask | str = "right",
        scene: Scene | None = None,
        *,
        time_step: float = TIME_STEP,
        threads: int | None = None,
    ) -> None:
        if not 0 < time_step < float("inf"):
            raise InvalidInputError(f"time_step must be finite and above 0 s, got {time_step}")
        if threads is not None:
            whole_number("threads", threads, 1)
        self.arm = arm if isinstance(arm, Arm) else Arm.load(arm)
        self.task = load_task(task)
        self.scene = scene or Scene()
        self.time_step = time_step
        self.threads = threads or available_threads()
        self.contact_model = ContactModel.build(self.arm, self.scene)
        self.judged = 0
        for bench in self.task.benches:
            self.scene.bench(bench)
        reward = self.task.reward
        self._rules = Rules(
            step_limit=self.arm.speed[: self.arm.n_actuated] * time_step,
            tolerance=self.task.tolerance,
            horizon=self.task.horizon,
            progress=float(reward.progress),
            collision=float(reward.collision),
            success=float(reward.success),
            step=float(reward.step),
        )

    @property
    def n_observations(self) -> int:
        """Length of an observation."""
        return observation_size(self.arm.n_axes)

    @property
    def n_actions(self) -> int:
        """Length of an action."""
        return self.arm.n_actuated

    @property
    def step_limit(self) -> NDArray[np.float64]:
        """Largest move of each actuated axis in a step, shape (n_actions,) [rad or m]."""
        return self._rules.step_limit.copy()

    def sample(
        self, rng: np.random.Generator, count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Draw starts and goals.

        Goals are uniform over the task's benches. Each actuated axis starts uniformly within
        its limits (scaled by the task's start_spread), rejected until the arm touches nothing
        and its tool is farther from the goal than the tolerance.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        count : int
            How many.

        Returns
        -------
        starts : ndarray, shape (count, n_axes)
            Configurations [rad or m].
        goals : ndarray, shape (count, 3)
            Goal positions [m].

        Raises
        ------
        SceneError
            If no acceptable start is found for some goal in 2000 attempts.
        """
        return draw_scenarios(self, rng, count)

    def reset(self, starts: ArrayLike, goals: ArrayLike, *, record: bool = False) -> Episodes:
        """Begin a batch of episodes, to be driven by `step`.

        Parameters
        ----------
        starts : array_like, shape (n, n_axes)
            Start configurations within the limits [rad or m].
        goals : array_like, shape (n, 3)
            Goal positions [m].
        record : bool
            Keep the configurations visited.

        Raises
        ------
        InvalidInputError
            If a shape is wrong, an entry is not finite or a start is beyond the limits.
        StartInContactError
            If a start touches something.
        """
        return self._begin(*self.check_scenarios(starts, goals), record, None)

    def step(self, episodes: Episodes, actions: ArrayLike) -> StepResult:
        """Advance every running episode by one step, in place.

        Parameters
        ----------
        episodes : Episodes
            What `reset` returned.
        actions : array_like, shape (n, n_actions)
            Fractions of the rated speeds, clipped to [-1, 1].

        Raises
        ------
        InvalidInputError
            If the shape is wrong or an entry is NaN.
        """
        table = finite_array("actions", actions, (len(episodes.status), self.n_actions))
        running = episodes.status == RUNNING
        np.copyto(episodes.stop, episodes.steps + 1)
        self._advance(table_control(table[:, None, :]), episodes, len(table))
        success = running & (episodes.status == SUCCESS)
        collision = running & (episodes.status == COLLISION)
        before = np.where(running, episodes.previous_distance, episodes.distance)
        terms = reward_terms(self.task.reward, before, episodes.distance, collision, success)
        if self.task.reward.step:
            terms = terms._replace(step=np.where(running, terms.step, 0.0))
        return StepResult(
            reward=terms.total,
            terms=terms,
            success=success,
            collision=collision,
            truncated=running & (episodes.status == TRUNCATED),
        )

    def rollout(
        self,
        policies: "Networks | CompiledPolicy | Sequence[CompiledPolicy] | PolicyFunction",
        starts: ArrayLike,
        goals: ArrayLike,
        *,
        policy_index: ArrayLike | None = None,
        record: bool = False,
        shift: NDArray[np.float64] | None = None,
    ) -> Rollouts:
        """Run whole episodes.

        Parameters
        ----------
        policies : Networks, policy, sequence of policies, or function
            One policy for all episodes, or one for each. Policies that offer ``networks()`` run
            compiled; a function from observations (n, n_observations) to actions (n, n_actions)
            is called once a step for all running episodes.
        starts : array_like, shape (n, n_axes)
            Start configurations [rad or m].
        goals : array_like, shape (n, 3)
            Goal positions [m].
        policy_index : array_like of int, shape (n,), optional
            Which compiled policy drives which episode, where there are several.
        record : bool
            Keep the configurations visited.
        shift : ndarray, shape (n_observations,), optional
            Collect moments of the observations about this point.

        Raises
        ------
        InvalidInputError
            If a shape is wrong or an entry is not finite.
        StartInContactError
            If a start touches something.
        """
        q, goal = self.check_scenarios(starts, goals)
        if shift is not None:
            shift = finite_array("shift", shift, (self.n_observations,))
        episodes = self._begin(q, goal, record, shift)
        if callable(policies) and not isinstance(policies, CompiledPolicy):
            if policy_index is not None:
                raise InvalidInputError("policy_index does not apply to a function")
            self._follow(policies, episodes)
        else:
            widths = (self.n_observations, self.n_actions)
            control = network_control(policies, policy_index, len(q), widths)
            self._advance(control, episodes, len(q) * self.task.horizon)
        return Rollouts.from_episodes(q, episodes)

    def rollout_actions(
        self, actions: ArrayLike, starts: ArrayLike, goals: ArrayLike, *, record: bool = False
    ) -> Rollouts:
        """Run whole episodes on given actions.

        Parameters
        ----------
        actions : array_like, shape (n, horizon, n_actions)
            Fractions of the rated speeds, clipped to [-1, 1].
        starts, goals, record
            As for `rollout`.
        """
        q, goal = self.check_scenarios(starts, goals)
        table = finite_array("actions", actions, (len(q), self.task.horizon, self.n_actions))
        episodes = self._begin(q, goal, record, None)
        self._advance(table_control(table), episodes, len(q) * self.task.horizon)
        return Rollouts.from_episodes(q, episodes)

    def contact(
        self, configuration: NDArray[np.float64], target: NDArray[np.float64]
    ) -> Contact | None:
        """Describe the first contact on the way of a step, or return None.

        Parameters
        ----------
        configuration, target : ndarray, shape (n_axes,)
            Ends of the step [rad or m].
        """
        tested = substeps(configuration[None], target[None])[0]
        touching = np.flatnonzero(self.contact_model.in_contact(tested))
        return self.contact_model.contact(tested[touching[0]]) if touching.size else None

    def contact_pair(
        self, configuration: NDArray[np.float64], target: NDArray[np.float64]
    ) -> tuple[str, str] | None:
        """Name the first two bodies that touch on the way of a step, or None.

        Parameters
        ----------
        configuration, target : ndarray, shape (n_axes,)
            Ends of the step [rad or m].
        """
        contact = self.contact(configuration, target)
        return contact.pair if contact else None

    def contact_pairs(self, rollouts: Rollouts) -> tuple[tuple[str, str] | None, ...]:
        """Name the bodies that touched, per episode; None where nothing did."""
        return tuple(
            self.contact_pair(rollouts.configurations[i], rollouts.targets[i]) if collided else None
            for i, collided in enumerate(rollouts.collision)
        )

    def begin(self, episodes: Episodes, rows: NDArray[np.int64]) -> None:
        """Start some episodes at their ``q`` and ``goal``; Coal judges doubtful starts.

        Parameters
        ----------
        episodes : Episodes
            What `reset` returned; changed in place.
        rows : ndarray of int
            Which episodes.

        Raises
        ------
        StartInContactError
            If a start touches something.
        """
        shapes = self.contact_model.shapes
        arrays = (rows, self.arm.chain, shapes, episodes)
        run_rows(kernels.begin, len(rows), len(rows), self.threads, *arrays)
        paused = rows[episodes.status[rows] == PAUSED]
        touching = self.contact_model.in_contact(episodes.q[paused])
        if touching.any():
            index = int(paused[touching.argmax()])
            pair = self.contact_model.contact_pair(episodes.q[index])
            raise StartInContactError(index, pair or ("arm", "scene"))
        episodes.status[paused] = RUNNING

    def check_scenarios(
        self, starts: ArrayLike, goals: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Validate starts and goals.

        Returns
        -------
        starts : ndarray, shape (n, n_axes)
            Configurations [rad or m].
        goals : ndarray, shape (n, 3)
            Goal positions [m].

        Raises
        ------
        InvalidInputError
            If a shape is wrong, an entry is not finite or a start is beyond the limits.
        """
        q = finite_array("starts", starts, (None, self.arm.n_axes))
        goal = finite_array("goals", goals, (len(q), 3))
        outside = ((q < self.arm.lower) | (q > self.arm.upper)).any(axis=1)
        if outside.any():
            index = int(outside.argmax())
            raise InvalidInputError(f"start {index} lies outside the limits: {q[index].tolist()}")
        return q, goal

    def _begin(
        self,
        starts: NDArray[np.float64],
        goals: NDArray[np.float64],
        record: bool,
        shift: NDArray[np.float64] | None,
    ) -> Episodes:
        """Allocate and start episodes."""
        n_pairs = len(self.contact_model.shapes.pairs)
        episodes = Episodes.allocate(
            starts, goals, n_pairs=n_pairs, horizon=self.task.horizon, record=record, shift=shift
        )
        self.begin(episodes, np.arange(len(starts)))
        return episodes

    def _advance(self, control: Control, episodes: Episodes, work: int) -> None:
        """Advance episodes to their stop, asking Coal about every step that is in doubt."""
        arrays = (self.arm.chain, self.contact_model.shapes, self._rules, control, episodes)
        while True:
            run_rows(kernels.advance, len(episodes.status), work, self.threads, *arrays)
            paused = np.flatnonzero(episodes.status == PAUSED)
            if paused.size == 0:
                return
            self._judge(episodes, paused)
            resumed = paused[episodes.cleared[paused]]
            if resumed.size == 0:
                return
            work = int((episodes.stop - episodes.steps)[resumed].sum())

    def _judge(self, episodes: Episodes, paused: NDArray[np.int64]) -> None:
        """Let Coal decide the steps in doubt: refuse those that touch, clear the others.

        Configurations are judged in the order of the motion, and not beyond the first contact.
        """
        tested = substeps(episodes.q[paused], episodes.target[paused])
        doubt = episodes.doubt[paused]
        refused = np.zeros(paused.size, dtype=bool)
        for k in range(kernels.SUBSTEPS):
            rows = np.flatnonzero((doubt & 1 << k != 0) & ~refused)
            if rows.size:
                refused[rows] = self.contact_model.in_contact(tested[rows, k])
                self.judged += rows.size
        episodes.status[paused] = np.where(refused, COLLISION, RUNNING)
        episodes.cleared[paused] = ~refused
        ended = paused[refused]
        episodes.previous_distance[ended] = episodes.distance[ended]
        episodes.steps[ended] += 1
        episodes.total[ended] += self._rules.collision + self._rules.step
        if episodes.path.shape[0]:
            episodes.path[ended, episodes.steps[ended]] = episodes.q[ended]

    def _follow(self, policy: PolicyFunction, episodes: Episodes) -> None:
        """Drive episodes to their end with a Python function."""
        actions = np.zeros((len(episodes.status), self.n_actions))
        while (running := episodes.status == RUNNING).any():
            chosen = finite_array(
                "actions", policy(episodes.observation[running]), (running.sum(), self.n_actions)
            )
            actions[running] = chosen
            np.copyto(episodes.stop, episodes.steps + 1)
            self._advance(table_control(actions[:, None, :]), episodes, len(actions))

    def observe(
        self, configurations: NDArray[np.float64], goals: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Observations of configurations, whether or not they touch something.

        Parameters
        ----------
        configurations : ndarray, shape (n, n_axes)
            Axis positions [rad or m].
        goals : ndarray, shape (n, 3)
            Goal positions [m].

        Returns
        -------
        ndarray, shape (n, n_observations)
        """
        return self._at(configurations, goals).observation

    def distances(
        self, configurations: NDArray[np.float64], goals: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distances from the tool to goals, as in episodes.

        Parameters
        ----------
        configurations : ndarray, shape (n, n_axes)
            Axis positions [rad or m].
        goals : ndarray, shape (n, 3)
            Goal positions [m].

        Returns
        -------
        ndarray, shape (n,)
            Distances [m].
        """
        return self._at(configurations, goals).distance

    def _at(self, configurations: NDArray[np.float64], goals: NDArray[np.float64]) -> Episodes:
        """Episodes that begin at configurations, whether or not those touch something."""
        episodes = Episodes.allocate(
            finite_array("configurations", configurations, (None, self.arm.n_axes)),
            finite_array("goals", goals, (len(configurations), 3)),
            n_pairs=len(self.contact_model.shapes.pairs),
            horizon=self.task.horizon,
        )
        arrays = (np.arange(len(configurations)), self.arm.chain, self.contact_model.shapes)
        kernels.begin(0, len(configurations), *arrays, episodes)
        return episodes

    def screen(
        self, configurations: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Find tool points, and which configurations touch something.

        Parameters
        ----------
        configurations : ndarray, shape (n, n_axes)
            Axis positions [rad or m].

        Returns
        -------
        tools : ndarray, shape (n, 3)
            Tool points [m].
        touching : ndarray of bool, shape (n,)
        """
        n = len(configurations)
        tools, proven = np.empty((n, 3)), np.empty(n, dtype=bool)
        arrays = (self.arm.chain, self.contact_model.shapes, configurations, tools, proven)
        run_rows(kernels.screen, n, n, self.threads, *arrays)
        touching = ~proven
        touching[touching] = self.contact_model.in_contact(configurations[touching])
        return tools, touching


def substeps(
    configurations: NDArray[np.float64], targets: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Configurations at which the motion of a step is tested for contact.

    Parameters
    ----------
    configurations, targets : ndarray, shape (n, n_axes)
        Ends of the steps [rad or m].

    Returns
    -------
    ndarray, shape (n, 4, n_axes)
        Evenly spaced; the last one is the target.
    """
    shares = np.arange(1, kernels.SUBSTEPS) / kernels.SUBSTEPS
    inner = configurations[:, None] + shares[:, None] * (targets - configurations)[:, None]
    return np.concatenate([inner, targets[:, None]], axis=1)
