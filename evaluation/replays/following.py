"""Follow a policy through endless fresh trials on a live page."""

import itertools
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import pinocchio as pin

from kinarm.arm import Arm
from kinarm.evaluation.entrants import ORACLE, Entrant
from kinarm.evaluation.replays.recorder import record
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import Oracle
from kinarm.recording import Recording, record_rollouts
from kinarm.simulator import Simulator
from kinarm.viewer.drawing import aim_camera, draw_arm, draw_goal, draw_surroundings, draw_trace
from kinarm.viewer.live_server import LiveServer

SLOWDOWN = 2.5
"""How much slower than the arm the page shows its motion."""

REST = 1.2
"""Pause between trials [s]."""


def fresh_recordings(entrant: Entrant, simulator: Simulator, seed: int) -> Iterator[Recording]:
    """Record one trial after the other, without end.

    The seed is that of the first trial; the next ones count up.
    """
    oracle = Oracle(simulator.problem)
    for number in itertools.count():
        trials = TrialSet.draw(simulator.problem, 1, seed + number)
        if entrant is ORACLE:  # solved here, so that no bounds are kept of every trial
            actions = oracle.solve_batch(trials.starts, trials.goals).actions
            rollouts = simulator.rollout_actions(actions, trials.starts, trials.goals, record=True)
            (recording,) = record_rollouts(simulator, rollouts, entrant.name)
        else:
            (recording,) = record(entrant, trials, allow_other_arm=True)
        yield replace(recording, trial=number)


def follow(
    server: LiveServer, simulator: Simulator, recordings: Iterable[Recording]
) -> Iterator[Recording]:
    """Show one recording after the other, and hand it out when it is over."""
    window, arm = server.window, simulator.arm
    draw_surroundings(window, simulator.scene)
    aim_camera(window)
    draw_goal(window["goal"], simulator.problem)
    frames = draw_arm(window["arm"], arm)
    for recording in recordings:
        goal = np.eye(4)
        goal[:3, 3] = recording.goal
        window["goal"].set_transform(goal)
        window["trace"].delete()
        for state in recording.states:
            for frame, placement in zip(frames[1:], joint_placements(arm, state), strict=True):
                frame.set_transform(placement)
            time.sleep(SLOWDOWN * simulator.problem.stepping.time_step)
        draw_trace(window["trace"], arm, recording)
        yield recording
        time.sleep(REST)


def joint_placements(arm: Arm, configuration: np.ndarray) -> list[np.ndarray]:
    """Pose of every joint in its parent, as homogeneous matrices, shape (4, 4)."""
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, configuration)
    return [data.liMi[joint].homogeneous for joint in range(1, arm.model.njoints)]
