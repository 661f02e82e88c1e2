"""Which of the candidates are replayed."""

from collections.abc import Sequence
from dataclasses import replace

from kinarm.errors import InvalidInputError
from kinarm.evaluation.replays.candidates import Candidates, Runs
from kinarm.evaluation.replays.request import ReplayRequest
from kinarm.recording import Recording


def choose(candidates: Candidates, request: ReplayRequest) -> Runs:
    """Pick what is to be played, and add what is proven of it; the first run decides.

    Raises
    ------
    InvalidInputError
        If there is no such trial, or there are too few.
    """
    first = candidates.runs[0]
    if request.trial:
        positions = _positions_of(request.trial, first)
    elif request.collisions:
        positions = _positions_of_collisions(first)
    elif request.worst is not None:
        positions = _positions_of_worst(request.worst, first)
    else:
        positions = list(range(len(first)))[: candidates.played]
    runs = [[run[position] for position in positions] for run in candidates.runs]
    if candidates.lower_bounds is None or not request.oracle:
        return runs
    bounds = candidates.lower_bounds(positions)
    return [
        [replace(each, steps_lower_bound=bound) for each, bound in zip(run, bounds, strict=True)]
        for run in runs
    ]


def _positions_of(trials: Sequence[int], recordings: Sequence[Recording]) -> list[int]:
    numbers = [recording.trial for recording in recordings]
    for trial in trials:
        if trial not in numbers:
            raise InvalidInputError(
                f"there is no trial {trial}: they go from {min(numbers)} to {max(numbers)}"
            )
    return [k for trial in trials for k, number in enumerate(numbers) if number == trial]


def _positions_of_collisions(recordings: Sequence[Recording]) -> list[int]:
    collided = [k for k, each in enumerate(recordings) if each.outcome == "collision"]
    if not collided:
        raise InvalidInputError(f"none of the {len(recordings)} trials ended in contact")
    return collided


def _positions_of_worst(count: int, recordings: Sequence[Recording]) -> list[int]:
    if count > len(recordings):
        raise InvalidInputError(
            f"--worst {count} asks for more trials than there are: {len(recordings)}"
        )
    farthest = sorted(range(len(recordings)), key=lambda k: -recordings[k].final_distance)
    return farthest[:count]
