"""Recordings of contestants, to keep or to follow live."""

import itertools
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from kinarm._fields import to_plain
from kinarm.evaluation.contestants import Contestant
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.oracle.solutions import OracleSolutions
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.recording import Recording, record_rollouts
from kinarm.simulator import Simulator

if TYPE_CHECKING:
    from kinarm.viewer.live_server import LiveServer

SLOWDOWN, REST = 2.5, 1.2
"""Slow motion of the page, and its pause between trials [s]."""


def record(
    contestant: Contestant,
    trials: TrialSet,
    numbers: Sequence[int] | None = None,
    *,
    bounds: OracleSolutions | None = None,
    allow_other_arm: bool = False,
) -> list[Recording]:
    """Run a contestant on trials and record its motions.

    Parameters
    ----------
    contestant : Contestant
        The policy, baseline or oracle.
    trials : TrialSet
        The trials that it faces.
    numbers : sequence of int, optional
        Trials to keep, in this order; all by default.
    bounds : OracleSolutions, optional
        The oracle's bounds of the trials, or of the first ones.
    allow_other_arm : bool
        Whether a policy may face an arm that it was not trained for.

    Raises
    ------
    InvalidInputError
        If there is no trial of such a number.
    PolicyFileError
        If the policy was trained for another arm, which is not allowed.
    """
    simulator = trials.simulator
    contestant.check(simulator.problem, simulator.arm, allow_other_arm=allow_other_arm)
    rollouts = contestant.run(trials, record=True)
    made = to_plain(contestant.policy.provenance) if contestant.policy else None
    known = [] if bounds is None else bounds.steps_lower_bound.tolist()
    return record_rollouts(
        trials.simulator,
        rollouts,
        contestant.name,
        numbers,
        steps_lower_bound=dict(enumerate(known)).get,
        provenance={
            "trial_seed": trials.seed,
            "policy": made,
            "versions": package_versions(),
            "commit": source_commit(),
            **({"note": note} if (note := contestant.note_on(trials.problem)) else {}),
        },
    )


def fresh_recordings(
    contestant: Contestant, simulator: Simulator, seed: int
) -> Iterator[Recording]:
    """Record one trial after the other, without end.

    Parameters
    ----------
    contestant, simulator
        Who faces them, and where.
    seed : int
        Seed of the first trial; the next ones count up.
    """
    for number in itertools.count():  # pragma: no branch - it counts without end
        trials = TrialSet.draw(simulator, 1, seed + number)
        (recording,) = record(contestant, trials, allow_other_arm=True)
        yield replace(recording, trial=number)


def follow(
    server: "LiveServer", simulator: Simulator, recordings: Iterable[Recording]
) -> Iterator[Recording]:
    """Show one recording after the other, and yield it when it is over.

    Parameters
    ----------
    server : LiveServer
        The live page.
    simulator, recordings
        Where and what was recorded, perhaps without end.
    """
    from kinarm.viewer.live_server import LiveStage

    stage = LiveStage(server, simulator.problem, simulator.arm)
    for recording in recordings:
        stage.begin(recording.states[0], recording.goal)
        for step, state in enumerate(recording.states):
            stage.show(state, step)
            time.sleep(SLOWDOWN * simulator.problem.stepping.time_step)
        points = [simulator.arm.tool_position(state) for state in recording.states]
        stage.draw_trace(points, recording.outcome)
        yield recording
        time.sleep(REST)
