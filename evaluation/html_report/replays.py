"""The replay of the worst trials, as a page within the page."""

from collections.abc import Sequence

from kinarm.evaluation.html_report.markup import Markup, tag
from kinarm.evaluation.html_report.worst import WorstTrial
from kinarm.evaluation.replays.recorder import record
from kinarm.recording import Recording
from kinarm.viewer import replay_page


def replay_frame(chosen: Sequence[WorstTrial]) -> Markup:
    """Replay trials in a frame that holds all it needs.

    Parameters
    ----------
    chosen : sequence of WorstTrial
        The trials, in the order in which the frame numbers them.
    """
    arm = chosen[0].evaluation.trials.simulator.arm
    return tag(
        "iframe",
        title="Replay of the worst trials",
        # The script of the page makes it the content when a reader comes near.
        data_page=replay_page(record_trials(chosen), arm=arm).html,
    )


def record_trials(chosen: Sequence[WorstTrial]) -> list[Recording]:
    """Let policies face the trials again and keep what they do, state by state.

    Parameters
    ----------
    chosen : sequence of WorstTrial
        The trials.

    Returns
    -------
    list of Recording
        One for each, in the same order.
    """
    numbers: dict[tuple[str, str], list[int]] = {}
    evaluations = {}
    for _, evaluation, trial in chosen:
        key = (evaluation.entrant.name, evaluation.task)
        evaluations[key] = evaluation
        numbers.setdefault(key, []).append(trial)
    recordings = {
        (key, recording.trial): recording
        for key, evaluation in evaluations.items()
        for recording in record(
            evaluation.entrant,
            evaluation.trials,
            numbers[key],
            bounds=evaluation.bounds,
            allow_other_arm=True,  # it was checked when the evaluation was made
        )
    }
    return [
        recordings[(evaluation.entrant.name, evaluation.task), trial]
        for _, evaluation, trial in chosen
    ]
