"""Follow a policy through endless fresh trials on a live page."""

import itertools
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.replay.runs import record
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle import Oracle
from kinarm.recording import Recording, record_rollouts
from kinarm.simulator import Simulator
from kinarm.viewer.live_server import LiveServer
from kinarm.viewer.live_stage import LiveStage

SLOWDOWN = 2.5
"""How much slower than the arm the page shows its motion."""

REST = 1.2
"""Pause between trials [s]."""


def fresh_recordings(
    contestant: Contestant, simulator: Simulator, seed: int
) -> Iterator[Recording]:
    """Record one trial after the other, without end.

    Parameters
    ----------
    contestant : Contestant
        Who faces them.
    simulator : Simulator
        Where.
    seed : int
        That of the first trial; the next ones count up.
    """
    oracle = Oracle(simulator.problem)
    for number in itertools.count():  # pragma: no branch - it counts without end
        trials = TrialSet.draw_in(simulator, 1, seed + number)
        if contestant is ORACLE:  # solved here, so that no bounds are kept of every trial
            actions = oracle.solve_batch(trials.starts, trials.goals).actions
            rollouts = simulator.rollout_actions(actions, trials.starts, trials.goals, record=True)
            (recording,) = record_rollouts(simulator, rollouts, contestant.name)
        else:
            (recording,) = record(contestant, trials, allow_other_arm=True)
        yield replace(recording, trial=number)


def follow(
    server: LiveServer, simulator: Simulator, recordings: Iterable[Recording]
) -> Iterator[Recording]:
    """Show one recording after the other, and hand it out when it is over.

    Parameters
    ----------
    server : LiveServer
        The live page.
    simulator : Simulator
        Where the recordings were made.
    recordings : iterable of Recording
        They may have no end.
    """
    stage = LiveStage(server, simulator.problem, simulator.arm)
    for recording in recordings:
        stage.begin(recording.states[0], recording.goal)
        for state in recording.states:
            stage.show(state)
            time.sleep(SLOWDOWN * simulator.problem.stepping.time_step)
        points = [simulator.arm.tool_position(state) for state in recording.states]
        stage.draw_trace(points, recording.outcome)
        yield recording
        time.sleep(REST)
