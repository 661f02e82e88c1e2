"""Runs: a policy drives an arm to goals, behind a shield and a watchdog."""

import math
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from kinarm.episodes import COLLISION, RUNNING, SUCCESS, Episodes, Outcome
from kinarm.errors import InvalidInputError, ProblemError, RunStoppedError
from kinarm.kernels.compiling import Array
from kinarm.policies.policy import Policy
from kinarm.policies.running.backend import WiredArm
from kinarm.policies.running.watchdog import SafeLimits, Watchdog
from kinarm.recording import Recording, replaced_steps
from kinarm.simulator import Simulator

REST, SETTLED, LONGEST_REST = 1e-3, 0.1, 2.0
"""An arm rests if joints move less [rad or m] in such a time [s]; how long it is waited for [s]."""

REHEARSED = 30
"""Steps that are timed before the arm moves."""

OF_COMMANDS = ("commanded", "last_action", "resolved_rate", "time_left")
"""Parts of the observation that tell of commands, whatever is measured."""


class Run:
    """A policy on an arm: commands are the motion of episodes whose joints obey at once.

    Each step of the policy is commanded as a straight motion of whole cycles, so that it is the one
    which the shield has proven free. An episode has one goal, also where the task has a sequence.

    Parameters
    ----------
    arm : WiredArm
        The arm, not yet connected.
    policy : Policy
        What drives it.
    simulator : Simulator
        Arm and scene as the shield knows them; `Simulator.shielded` for one with a shield.
    speed : float
        Share of the speed of its training, at most 1: steps take longer.
    rate : float, optional
        Commands per second [Hz]; by default what the arm wants, or one a step at full speed.
    measured : bool
        The policy sees measured joint positions, not those that were commanded.
    limits : SafeLimits, optional
        What stops the run.
    name : str
        What recordings call the policy.

    Attributes
    ----------
    rate, parts : float and int
        Cycles per second [Hz], and cycles of a step.
    recordings : list of Recording
        Measured configurations for each goal, also for one at which the run was stopped.
    latencies : list of float
        From before reading to after commanding, in each cycle [s].

    Raises
    ------
    KinarmError
        If policy, scene or a setting do not suit a run.
    """

    def __init__(
        self,
        arm: WiredArm,
        policy: Policy,
        simulator: Simulator,
        *,
        speed: float = 0.2,
        rate: float | None = None,
        measured: bool = False,
        limits: SafeLimits | None = None,
        name: str = "policy",
    ) -> None:
        policy.check_arm(simulator.arm)
        seen, alone = policy.observation, {"sequence": 1}
        simulator = simulator.changed(observation=seen, plant="ideal", goal=alone)
        world, time_step = simulator.world, simulator.problem.stepping.time_step
        if world.has_random_bodies or len(world.contact_model.shapes.moving):
            raise ProblemError("a run does not know where bodies are that are random or move")
        if not 0.0 < speed <= 1.0:
            raise InvalidInputError(f"speed must lie in (0, 1], got {speed:g}")
        layout = world.layout
        if measured and (layout.history > 1 or "joint_velocities" in layout.places):
            raise InvalidInputError("joint_velocities and histories need commanded feedback")
        self._told_of = [layout.places[name] for name in OF_COMMANDS if name in layout.places]
        self.arm, self.policy, self.measured, self.name = arm, policy, measured, name
        self.simulator, self.speed = simulator, speed
        self.rate = rate or arm.backend.rate or 1.0 / time_step
        self.parts = max(1, math.ceil(self.rate * time_step / speed - 1e-9))
        self.recordings, self.latencies = list[Recording](), list[float]()
        self._limits, self._told = limits or SafeLimits(), np.zeros(0)

    def to_goals(self, goals: ArrayLike) -> list[Recording]:
        """Bring the arm to goals, shape (n, goal_width), one after the other; their recordings.

        Raises
        ------
        InvalidInputError
            If a goal is none, or out of reach, or cycles take too long here.
        StartInContactError
            If the arm touches something.
        RunStoppedError
            If the watchdog stops it, or the arm does not answer.
        """
        aims = self._checked(goals)
        with self.arm.connected(self.rate) as arm:
            reading = arm.read()
            self._told = self._start(reading)
            self._rehearse(aims[0])
            off, fastest = self._told - reading, self.speed * self.simulator.arm.velocity_limits
            cycles = math.ceil(np.abs(off / fastest).max() * self.rate)
            arm.followed(reading + np.linspace(0.0, 1.0, cycles + 1)[1:, None] * off)
            for goal in aims:
                self._reach(goal)
        return self.recordings[-len(aims) :]

    def _checked(self, goals: ArrayLike) -> Array:
        """Goals, each of which the arm reaches somehow without contact."""
        world = self.simulator.world
        starts = np.tile(world.arm.home, (len(np.atleast_1d(goals)), 1))
        aims = world.check_scenarios(starts, goals)[1]
        found, _ = world.solved_goals(aims, np.zeros(len(aims)), world.no_scenes)
        if not found.all():
            goal = aims[int(found.argmin())].tolist()
            raise InvalidInputError(f"the goal {goal} is out of reach, or all around it touches")
        return aims

    def _start(self, reading: Array) -> Array:
        """A reading within the limits, which it may miss by a step."""
        arm, time_step = self.simulator.arm, self.simulator.problem.stepping.time_step
        within = np.clip(reading, arm.lower, arm.upper)
        near = np.abs(reading - within) <= arm.velocity_limits * time_step
        start = np.where(near, within, reading)
        return arm.chain.within_limits("what the arm reads", start, arm.joint_names)

    def _rehearse(self, goal: Array) -> None:
        """Refuse a start in contact, and a rate that this machine cannot keep."""
        times, episodes, period = [], self._episode(goal), 1.0 / self.rate
        for _ in range(REHEARSED):
            if episodes.status[0] != RUNNING:
                episodes = self._episode(goal)
            began = perf_counter()
            self._step(episodes, self._told)
            times.append(perf_counter() - began)
        if (needed := float(np.median(times))) > period:
            raise InvalidInputError(
                f"a cycle takes {1e3 * needed:.2g} ms here, and a rate of {self.rate:g} Hz leaves "
                f"{1e3 * period:.2g} ms"
            )

    def _episode(self, goal: Array) -> Episodes:
        return self.simulator.reset(self._told[None], goal[None], record=True)

    def _step(self, episodes: Episodes, reading: Array) -> Array:
        """Let the policy act; where the step leads, shape (n_joints,) [rad or m]."""
        seen = episodes.observation
        if self.measured:
            seen = self.simulator.world.observe(reading[None], episodes.goal)
            for place in self._told_of:
                seen[:, place] = episodes.observation[:, place]
        self.simulator.step(episodes, self.policy(seen))
        return np.array(episodes.q[0])

    def _reach(self, goal: Array) -> None:
        """Follow the policy until its episode ends, rest there, and record what joints did."""
        episodes, states, aims, stopped = self._episode(goal), list[Array](), list[Array](), ""
        try:
            self._follow(episodes, states, aims)
            states.append(self._settled())
        except RunStoppedError as error:
            self.arm.stop()
            stopped = str(error)
            raise
        except KeyboardInterrupt:
            stopped = "interrupted"
            states.append(self._settled())
            raise
        finally:
            path = np.array(states or [self._told])
            aims = [*aims, episodes.goal[0].copy()][: len(path)]
            self.recordings.append(self._recording(goal, episodes, path, np.array(aims), stopped))

    def _follow(self, episodes: Episodes, states: list[Array], aims: list[Array]) -> None:
        """Read, observe, act, shield, and command, a cycle after the other."""
        arm, model, period, late = self.arm, self.simulator.arm, 1.0 / self.rate, 0.0
        fastest = self.speed * model.velocity_limits
        watchdog = Watchdog(self._limits, model.joint_names, fastest, period)
        due, target = arm.now(), self._told
        while episodes.status[0] == RUNNING:
            origin = self._told
            for part in range(1, self.parts + 1):
                began, due = perf_counter(), due + period
                reading = arm.read()
                watchdog.check(reading, self._told, late)
                if part == 1:
                    states.append(reading)
                    aims.append(episodes.goal[0].copy())
                    target = self._step(episodes, reading)
                share = part / self.parts
                self._told = target if share == 1.0 else origin + share * (target - origin)
                arm.command(self._told)
                self.latencies.append(perf_counter() - began)
                late = arm.now() - due
                arm.wait(due)
                due = max(due, arm.now())

    def _settled(self) -> Array:
        """Hold the last command until the joints rest; where they do."""
        hold = np.tile(self._told, (max(2, round(SETTLED * self.rate)), 1))
        for _ in range(round(LONGEST_REST / SETTLED)):
            seen = self.arm.followed(hold)
            if np.abs(seen[-1] - seen[0]).max() < REST:
                break
        return np.array(seen[-1])

    def _recording(
        self, goal: Array, episodes: Episodes, path: Array, aims: Array, stopped: str
    ) -> Recording:
        """What the joints did for a goal; ``ended`` of its provenance says how it ended."""
        world, task, contact = self.simulator.world, self.simulator.task, None
        there = world.at_goals(world.reached(path[-1:])[0], aims[-1])
        outcome: Outcome = "truncated"
        ended = stopped or f"not reached in {len(path) - 1} steps"
        if episodes.status[0] == COLLISION and not stopped:
            contact = world.contact(episodes.q[0], episodes.target[0])
            outcome = "collision"
            ended = f"stopped before {' touches '.join(contact.pair if contact else ('it', '?'))}"
        elif episodes.status[0] == SUCCESS and not stopped:
            outcome = "success" if there else "truncated"
            ended = "reached" if there else "commanded to the goal, where the joints are not"
        return Recording(
            policy=self.name,
            problem=self.simulator.problem.pinned,
            trial=len(self.recordings),
            states=path,
            distances=world.distances(path, aims),
            goal=goal,
            goals=None if task.goal.plain else aims,
            outcome=outcome,
            contact=contact.pair if contact else None,
            contact_point=contact.point if contact else None,
            refused=contact.configuration if contact else None,
            replaced=replaced_steps(world, episodes.replaced),
            provenance={
                "ended": ended,
                "interventions": int(episodes.interventions.sum()),
                "speed": self.speed,
                "rate": self.rate,
            },
        )
