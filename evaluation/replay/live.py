"""Follow a policy through endless fresh trials on a live page."""

import itertools
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.replay.runs import record
from kinarm.evaluation.trials import TrialSet
from kinarm.recording import Recording
from kinarm.simulator import Simulator
from kinarm.viewer.live_server import LiveServer, LiveStage

SLOWDOWN, REST = 2.5, 1.2
"""How much slower than the arm the page shows its motion, and the pause between trials [s]."""


def fresh_recordings(
    contestant: Contestant, simulator: Simulator, seed: int
) -> Iterator[Recording]:
    """Record one trial after the other, without end.

    Parameters
    ----------
    contestant, simulator
        Who faces them, and where.
    seed : int
        That of the first trial; the next ones count up.
    """
    for number in itertools.count():  # pragma: no branch - it counts without end
        trials = TrialSet.draw(simulator, 1, seed + number)
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
    simulator, recordings
        Where and what was recorded; there may be no end of it.
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
