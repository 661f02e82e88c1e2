"""MuJoCo's rollouts in C (``mujoco.rollout``) of the same arm, scene and ways."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from mujoco.rollout import Rollout
from numpy.typing import NDArray

from kinarm.evaluation.measurements.peers.comparing import Comparison, compared
from kinarm.evaluation.measurements.peers.mjcf import mjcf
from kinarm.evaluation.measurements.robots import novice
from kinarm.policies.policy import Policy
from kinarm.simulator import Simulator

EPISODES = 512
TERMS = (
    "{episodes} episodes on {threads} threads; same starts, shapes, pairs of bodies and joint "
    "targets, which position servos follow, {time_step:g} s a step; for more tests of contact "
    "MuJoCo takes smaller steps. It solves the dynamics and resolves contact; kinarm also "
    "observes and runs the policy"
)


def compare(policy: Policy, repetitions: int) -> Iterator[Comparison]:
    """Rollouts of a policy's arm, and of UR5 with the convex hulls of its meshes.

    Raises
    ------
    MissingExtraError
        If the package with UR5 is missing.
    """
    yield from _compare_rollouts(f"arm `{policy.problem.arm.name}`", policy, repetitions)
    yield from _compare_rollouts("UR5 with hulls", novice("ur5"), repetitions)


def _compare_rollouts(arm: str, policy: Policy, repetitions: int) -> Iterator[Comparison]:
    """Time rollouts of a policy beside MuJoCo on their ways, which tests as often, and once."""
    simulator = Simulator(policy.problem)
    stepping, threads = policy.problem.stepping, simulator.threads
    scenarios = simulator.sample(np.random.default_rng(EPISODES), EPISODES)
    targets = joint_targets(simulator, policy, *scenarios)
    terms = TERMS.format(episodes=EPISODES, threads=threads, time_step=stepping.time_step)

    def ours() -> int:
        return int(simulator.rollout(policy, *scenarios).steps.sum())

    for tests in dict.fromkeys((stepping.tested_configurations, 1)):
        both = tests == stepping.tested_configurations
        how = f"both test {tests}" if both else f"{tests} tested by MuJoCo"
        what = f"rollouts, {arm}, {how} a step"
        with driven(simulator, scenarios[0], targets, tests) as theirs:
            yield compared(theirs, ours, repetitions, what=what, unit="steps/s", terms=terms)


@contextmanager
def driven(
    simulator: Simulator, starts: NDArray[np.float64], targets: NDArray[np.float64], tests: int
) -> Iterator[Callable[[], int]]:
    """MuJoCo's rollouts to joint targets, in ``tests`` of its steps for each of kinarm's.

    What it gives runs them once and returns how many of kinarm's steps that were.
    """
    threads, time_step = simulator.threads, simulator.problem.stepping.time_step
    model = mujoco.MjModel.from_xml_string(mjcf(simulator.world, time_step / tests))
    workers = [mujoco.MjData(model) for _ in range(threads)]
    states, controls = initial_states(model, starts), np.repeat(targets, tests, axis=1)
    with Rollout(nthread=threads if threads > 1 else 0) as rollout:

        def run() -> int:
            rollout.rollout(model, workers, states, controls)
            return int(np.prod(targets.shape[:2]))

        yield run


def joint_targets(
    simulator: Simulator,
    policy: Policy,
    starts: NDArray[np.float64],
    goals: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Targets of the actuated joints after each step: the paths of a policy's episodes.

    An episode that is over goes back on its way, and forth again, so that no arm rests.

    Returns
    -------
    ndarray, shape (n, horizon, n_actuated)
        [rad or m].
    """
    rollouts = simulator.rollout(policy, starts, goals, record=True)
    horizon, last = simulator.task.horizon, rollouts.steps[:, None]
    places = np.arange(1, horizon + 1) % (2 * last)
    places = np.where(places <= last, places, 2 * last - places)
    rows = np.arange(len(starts))[:, None]
    targets: NDArray[np.float64] = rollouts.paths[rows, places, : simulator.n_actions]
    return targets


def initial_states(model: Any, starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """MuJoCo's full state of arms at rest, shape (n, n_states)."""
    n_states = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states = np.zeros((len(starts), n_states))
    states[:, 1 : 1 + model.nq] = starts[:, : model.nq]  # after the time
    return states
