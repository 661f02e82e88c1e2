"""Runs: a policy drives an arm to goals, behind a shield and a watchdog."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Literal

import numpy as np

from kinarm._fields import Checked
from kinarm.episodes import COLLISION, RUNNING, SUCCESS, Episodes, Outcome
from kinarm.errors import POSITIVE, InvalidInputError, ProblemError, RunStoppedError
from kinarm.kernels.compiling import Array
from kinarm.observation_layout import ObservationLayout
from kinarm.policies.export import WITH_MEMORY
from kinarm.policies.policy import Policy
from kinarm.policies.running.backend import WiredArm
from kinarm.policies.running.watchdog import SafeLimits, Watchdog
from kinarm.recording import Recording
from kinarm.simulator import Simulator

REST = 1e-3
"""Way in `SETTLED` seconds below which a joint rests [rad or m]."""

SETTLED, LONGEST_REST = 0.1, 2.0
"""Time in which an arm is seen to rest, and at most waited for it [s]."""

REHEARSED = 30
"""Steps that are timed before the arm moves."""


@dataclass(frozen=True, kw_only=True)
class RunSettings(Checked):
    """How a policy drives an arm.

    Parameters
    ----------
    speed : float
        Share of the speed of its training, at most 1: steps take longer.
    rate : float, optional
        Commands per second [Hz]; by default what the arm wants, or the policy's.
    feedback : {"commanded", "measured"}
        Which joint positions the policy sees.
    watchdog : SafeLimits
        What stops the run.
    """

    speed: float = field(default=0.2, metadata=POSITIVE)
    rate: float | None = field(default=None, metadata=POSITIVE)
    feedback: Literal["commanded", "measured"] = "commanded"
    watchdog: SafeLimits = field(default_factory=SafeLimits)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.speed > 1.0:
            raise InvalidInputError(f"speed must be at most 1, got {self.speed:g}")


@dataclass(frozen=True, eq=False)
class Attempt:
    """What a run did for one goal.

    Attributes
    ----------
    recording : Recording
        Measured configurations, a step apart.
    reached : bool
        Whether the resting arm was at the goal.
    ended : str
        Why it ended, in words.
    latencies : ndarray, shape (cycles,)
        Times from before reading to after commanding [s].
    interventions : int
        Steps that the shield replaced.
    """

    recording: Recording
    reached: bool
    ended: str
    latencies: Array
    interventions: int


class Run:
    """A policy on an arm: commands are the motion of an episode that obeys at once.

    Each step of the policy is commanded as a straight motion of whole cycles, so that it is the one
    which the shield has proven free.

    Parameters
    ----------
    arm : WiredArm
        The arm, not yet connected.
    policy : Policy
        What drives it.
    simulator : Simulator
        Arm and scene, as the shield knows them; with a shield, if there is to be one.
    settings : RunSettings
        Speed, rate, feedback and watchdog.
    name : str
        What recordings call the policy.

    Attributes
    ----------
    rate, parts : float and int
        Cycles per second [Hz], and cycles of a step.
    attempts : list of Attempt
        What has been done, a goal each; also of a goal at which the run was stopped.

    Raises
    ------
    KinarmError
        If arm, scene or feedback do not suit a run.
    """

    def __init__(
        self,
        arm: WiredArm,
        policy: Policy,
        simulator: Simulator,
        settings: RunSettings,
        name: str = "policy",
    ) -> None:
        policy.check_arm(simulator.arm)
        world, time_step = simulator.world, simulator.problem.stepping.time_step
        if world.has_random_bodies or len(world.contact_model.shapes.moving):
            raise ProblemError("bodies that are random or move are not known in a run")
        if settings.feedback == "measured":
            _check_no_memory(world.layout)
        self.arm, self.policy, self.settings, self.name = arm, policy, settings, name
        self.simulator = simulator.with_plant("ideal")
        self.rate = settings.rate or arm.backend.rate or 1.0 / time_step
        self.parts = max(1, math.ceil(self.rate * time_step / settings.speed - 1e-9))
        self.attempts: list[Attempt] = []
        self._period, self._told = 1.0 / self.rate, np.zeros(0)

    def to_goals(self, goals: Array) -> list[Attempt]:
        """Bring the arm to goals, shape (n, goal_width), one after the other.

        Raises
        ------
        InvalidInputError
            If a goal is out of reach, or cycles take too long here.
        StartInContactError
            If the arm touches something.
        RunStoppedError
            If the watchdog stops it, or the arm does not answer.
        """
        self._check_goals(goals)
        with self.arm.connected(self.rate) as arm:
            self._told = self._within(arm.read())
            self._rehearse(goals[0])
            for goal in goals:
                self._reach(goal)
            arm.stop()
        return self.attempts

    def _check_goals(self, goals: Array) -> None:
        world = self.simulator.world
        nothing = np.zeros((0, *world.contact_model.shapes.placed.shape))
        found, _ = world.solved_goals(goals, np.zeros(len(goals)), nothing)
        if not found.all():
            goal = goals[int(found.argmin())].tolist()
            raise InvalidInputError(f"the goal {goal} is out of reach, or all around it touches")

    def _rehearse(self, goal: Array) -> None:
        """Refuse a start in contact, and a rate that this machine cannot keep."""
        times, episodes = [], self._episode(self._told, goal)
        for _ in range(REHEARSED):
            if episodes.status[0] != RUNNING:
                episodes = self._episode(self._told, goal)
            began = perf_counter()
            self._step(episodes, self._told)
            times.append(perf_counter() - began)
        if (needed := float(np.median(times))) > self._period:
            raise InvalidInputError(
                f"a cycle takes {1e3 * needed:.2g} ms here, and a rate of {self.rate:g} Hz leaves "
                f"{1e3 * self._period:.2g} ms"
            )

    def _within(self, reading: Array) -> Array:
        """A reading within the limits, which it may miss by a step."""
        arm, chain = self.simulator.arm, self.simulator.arm.chain
        within = np.clip(reading, chain.lower, chain.upper)
        limit = arm.velocity_limits * self.simulator.problem.stepping.time_step
        if (beyond := np.abs(reading - within) > limit).any():
            joint = int(beyond.argmax())
            raise InvalidInputError(
                f"{arm.joint_names[joint]} reads {reading[joint]:.6g}, and its limits are "
                f"{chain.lower[joint]:.6g} and {chain.upper[joint]:.6g}"
            )
        return within

    def _episode(self, start: Array, goal: Array) -> Episodes:
        return self.simulator.reset(start[None], goal[None])

    def _step(self, episodes: Episodes, reading: Array) -> Array:
        """Let the policy act; where the step leads, shape (n_joints,) [rad or m]."""
        seen = episodes.observation
        if self.settings.feedback == "measured":
            seen = self.simulator.world.observe(
                reading[None], episodes.goal, int(episodes.steps[0])
            )
        self.simulator.step(episodes, self.policy(seen))
        return np.array(episodes.q[0])

    def _reach(self, goal: Array) -> None:
        """Follow the policy until its episode ends, and rest there."""
        episodes, log = self._episode(self._told, goal), _Log()
        try:
            self._follow(episodes, log)
            log.states.append(self._settle())
            log.aims.append(episodes.goal[0].copy())
        except RunStoppedError as stopped:
            self.arm.stop()
            log.stopped = str(stopped)
            raise
        except KeyboardInterrupt:
            log.stopped = "interrupted"
            log.states.append(self._settle())
            log.aims.append(episodes.goal[0].copy())
            self.arm.stop()
            raise
        finally:
            self.attempts.append(self._attempt(goal, episodes, log))

    def _follow(self, episodes: Episodes, log: "_Log") -> None:
        """Read, observe, act, shield, and command, a cycle after the other."""
        arm, chain, late = self.arm, self.simulator.arm, 0.0
        fastest = chain.velocity_limits * self.settings.speed
        names, period = chain.joint_names, self._period
        watchdog, due = Watchdog(self.settings.watchdog, names, fastest, period), arm.now()
        while episodes.status[0] == RUNNING:
            origin = self._told
            for part in range(1, self.parts + 1):
                began, due = perf_counter(), due + period
                reading = arm.read()
                watchdog.check(reading, self._told, late)
                if part == 1:
                    log.states.append(reading)
                    log.aims.append(episodes.goal[0].copy())
                    target = self._step(episodes, reading)
                share = part / self.parts
                self._told = target if part == self.parts else origin + share * (target - origin)
                arm.command(self._told)
                log.latencies.append(perf_counter() - began)
                late = arm.now() - due
                arm.wait(due)
                due = max(due, arm.now())

    def _settle(self) -> Array:
        """Hold the last command until the joints rest; where they do."""
        arm, before = self.arm, self.arm.read()
        cycles = max(1, round(SETTLED * self.rate))
        for _ in range(round(LONGEST_REST / SETTLED)):
            for _ in range(cycles):
                arm.command(self._told)
                arm.wait(arm.now() + self._period)
            reading = arm.read()
            if np.abs(reading - before).max() < REST:
                return reading
            before = reading
        return before

    def _attempt(self, goal: Array, episodes: Episodes, log: "_Log") -> Attempt:
        """What was done for a goal, by the measured configurations."""
        world, status = self.simulator.world, int(episodes.status[0])
        states = np.array(log.states or [self._told])
        aims = np.array(log.aims or [goal])[: len(states)]
        states = states[: len(aims)]
        distances, turns = world.distances(states, aims), world.turns(states[-1:], aims[-1:])
        task, contact = self.simulator.task, None
        at_goal = distances[-1] <= task.tolerance
        at_goal &= bool((turns <= task.goal.rotation_tolerance).all())
        reached = bool(at_goal) and status == SUCCESS and not log.stopped
        outcome: Outcome = "success" if reached else "truncated"
        ended = log.stopped or f"not reached in {len(states) - 1} steps"
        if reached:
            ended = "reached"
        elif status == SUCCESS and not log.stopped:
            ended = "commanded to the goal, where the joints are not"
        elif status == COLLISION and not log.stopped:
            outcome, contact = "collision", world.contact(episodes.q[0], episodes.target[0])
            ended = f"stopped before {' touches '.join(contact.pair)}" if contact else "contact"
        latencies, replaced = np.array(log.latencies), int(episodes.interventions[0])
        told = {"speed": self.settings.speed, "rate": self.rate, "ended": ended}
        recording = Recording(
            policy=self.name,
            problem=self.simulator.problem.pinned,
            trial=len(self.attempts),
            states=states,
            distances=distances,
            goal=goal,
            goals=None if task.goal.plain else aims,
            outcome=outcome,
            contact=contact.pair if contact else None,
            contact_point=contact.point if contact else None,
            refused=contact.configuration if contact else None,
            provenance={**told, "cycles": len(latencies), "interventions": replaced},
        )
        return Attempt(recording, reached, ended, latencies, replaced)


@dataclass
class _Log:
    """What is kept of an attempt on its way."""

    states: list[Array] = field(default_factory=list)
    aims: list[Array] = field(default_factory=list)
    latencies: list[float] = field(default_factory=list)
    stopped: str = ""


def _check_no_memory(layout: ObservationLayout) -> None:
    """Refuse parts of an observation that depend on more than measured joints and goal."""
    known = [name for name in ("commanded", *sorted(WITH_MEMORY)) if name in layout.places]
    known = [*known, *(["history"] if layout.history > 1 else [])]
    if known and known != ["time_left"]:
        raise InvalidInputError(
            f"a policy that sees {', '.join(known)} takes the commanded feedback in a run"
        )


def drawn_goals(simulator: Simulator, count: int, seed: int) -> tuple[Array, Array]:
    """Start and goals of trials of a task, shape (n_joints,) and (count, goal_width)."""
    starts, goals = simulator.sample(np.random.default_rng(seed), count)
    return starts[0], goals


def latency_summary(attempts: Sequence[Attempt]) -> str:
    """Percentiles of the cycles' latencies, in words."""
    latencies = np.concatenate([attempt.latencies for attempt in attempts])
    half, most = (1e3 * np.percentile(latencies, share) for share in (50, 99))
    return (
        f"{len(latencies)} cycles, {half:.2g} ms in the median, {most:.2g} ms at the 99th percent"
    )
