"""MuJoCo's rollouts in C (``mujoco.rollout``) of the same arm, scene and ways."""

from collections.abc import Iterator
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
    "targets, which position servos follow; {time_step:g} s a step, tested for contact {theirs} "
    "(kinarm: {ours} configurations a step). MuJoCo solves the dynamics and resolves contact; "
    "kinarm also observes and runs the policy"
)


def compare(policy: Policy, repetitions: int) -> Iterator[Comparison]:
    """Rollouts of a policy's arm, and of UR5 with the convex hulls of its meshes.

    Raises
    ------
    MissingExtraError
        If the package with UR5 is missing.
    """
    tested = policy.problem.stepping.tested_configurations
    yield _compare_rollouts("rollouts of the same arm", policy, repetitions, 1)
    yield _compare_rollouts("as often tested for contact", policy, repetitions, tested)
    yield _compare_rollouts("rollouts of UR5 with hulls", novice("ur5"), repetitions, 1)


def _compare_rollouts(what: str, policy: Policy, repetitions: int, substeps: int) -> Comparison:
    """Time rollouts of a policy, and MuJoCo on the ways that they take.

    MuJoCo takes ``substeps`` steps for each of kinarm's, and tests for contact in each.
    """
    simulator = Simulator(policy.problem)
    stepping, threads = policy.problem.stepping, simulator.threads
    starts, goals = simulator.sample(np.random.default_rng(EPISODES), EPISODES)
    targets = joint_targets(simulator, policy, starts, goals)
    model = mujoco.MjModel.from_xml_string(mjcf(simulator.world, stepping.time_step / substeps))
    controls = np.repeat(targets, substeps, axis=1)
    states = initial_states(model, starts)
    workers = [mujoco.MjData(model) for _ in range(threads)]
    with Rollout(nthread=threads if threads > 1 else 0) as rollout:

        def theirs() -> int:
            rollout.rollout(model, workers, states, controls)
            return int(controls.shape[0] * controls.shape[1]) // substeps

        def ours() -> int:
            return int(simulator.rollout(policy, starts, goals).steps.sum())

        terms = TERMS.format(
            episodes=EPISODES,
            threads=threads,
            time_step=stepping.time_step,
            theirs="once" if substeps == 1 else f"{substeps} times, in as many steps of MuJoCo's",
            ours=stepping.tested_configurations,
        )
        what, unit = f"{what}, {policy.problem.arm.name}", "steps/s"
        return compared(theirs, ours, repetitions, what=what, unit=unit, terms=terms)


def joint_targets(
    simulator: Simulator,
    policy: Policy,
    starts: NDArray[np.float64],
    goals: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Where the actuated joints are after each step, and stay after the last one.

    Returns
    -------
    ndarray, shape (n, horizon, n_actuated)
        [rad or m].
    """
    paths = simulator.rollout(policy, starts, goals, record=True).paths
    targets = np.array(paths[:, 1:, : simulator.n_actions])
    for step in range(targets.shape[1]):
        before = targets[:, step - 1] if step else starts[:, : simulator.n_actions]
        ended = np.isnan(targets[:, step])
        targets[:, step][ended] = before[ended]
    return targets


def initial_states(model: Any, starts: NDArray[np.float64]) -> NDArray[np.float64]:
    """MuJoCo's full state of arms at rest, shape (n, n_states)."""
    n_states = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states = np.zeros((len(starts), n_states))
    states[:, 1 : 1 + model.nq] = starts[:, : model.nq]  # after the time
    return states
