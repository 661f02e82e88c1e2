"""What ``kinarm-replay`` plays: recordings from a file or made now, and which of them."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from kinarm.arm import DEFAULT_ARM, Arm
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.entrants import Entrant, find_entrants
from kinarm.evaluation.replays.recorder import record
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.library import group_of
from kinarm.recording import Recording, load_recordings
from kinarm.simulator import Simulator

PLAYED, SEARCHED = 5, 200
"""Trials that are played by default, and trials among which some are looked for."""

Runs = list[list[Recording]]
"""Recordings of one policy, or of two in the same trials."""

Floors = Callable[[Sequence[int]], Sequence[int]]
"""Gives the proven numbers of steps of some trials, by their positions."""


@dataclass(frozen=True)
class Found:
    """What there is to choose from.

    Attributes
    ----------
    arm : Arm
        The arm in all of it.
    runs : list of list of Recording
        One list, or two in the same order.
    floors : callable or None
        See `Floors`; None keeps what the recordings say.
    played : int
        How many are played where nothing says which.
    """

    arm: Arm
    runs: Runs
    floors: Floors | None
    played: int


def find_recordings(options: argparse.Namespace) -> Found:
    """Read or make what the options of the command ask for.

    Raises
    ------
    KinarmError
        If a file, name or number cannot be used.
    """
    names = options.compare or [options.policy]
    if options.source is None:
        return _fresh(options, names)
    for option in ("seed", "trials"):
        if getattr(options, option) is not None:
            raise InvalidInputError(f"--{option} does not apply to trials from a file")
    if options.source.suffix == ".json":
        return _from_evaluation(options, names)
    return _from_recordings(options, names)


def chosen_entrant(name: str | None) -> Entrant:
    """The entrant of a name; of a group, its first seed.

    Raises
    ------
    InvalidInputError
        If none is named, or it does not exist.
    """
    if name is None:
        raise InvalidInputError("name a --policy, or a file of recordings or of an evaluation")
    return find_entrants(name)[0]


def chosen_task(entrants: Sequence[Entrant], task: str | None) -> str:
    """The named task, or else the one that the first of some entrants was trained on.

    Raises
    ------
    InvalidInputError
        If there is neither.
    """
    trained = [entrant.trained_on for entrant in entrants if entrant.trained_on]
    if task is None and not trained:
        raise InvalidInputError(f"{entrants[0].name!r} was not trained on a task: name a --task")
    return task or trained[0]


def _fresh(options: argparse.Namespace, names: Sequence[str | None]) -> Found:
    """Let policies face trials that are drawn now."""
    arm = Arm.load(options.arm or DEFAULT_ARM)
    entrants = [chosen_entrant(name) for name in names]
    task = chosen_task(entrants, options.task)
    searched = options.trial or options.worst or options.collisions
    count = options.trials or (SEARCHED if searched else PLAYED)
    trials = TrialSet.draw(Simulator(arm, task), count, options.seed or 0)
    runs = [record(e, trials, allow_other_arm=options.allow_other_arm) for e in entrants]
    return Found(arm, runs, _solver(trials) if options.oracle else None, count)


def _from_evaluation(options: argparse.Namespace, names: Sequence[str | None]) -> Found:
    """Let policies face the trials of an evaluation again."""
    document = EvaluationDocument.load(options.source)
    arm = Arm.load(options.arm or document.protocol["arm"])
    runs: Runs = []
    task = options.task
    for name in names:
        entrant = None
        if name is not None and Path(name).suffix == ".npz":
            entrant = chosen_entrant(name)
        row = document.result(entrant.name if entrant else name, task)
        task = row["task"]
        trials = document.trials(task, arm)
        recordings = record(entrant or chosen_entrant(row["policy"]), trials, allow_other_arm=True)
        document.check_same(row, recordings)
        runs.append(recordings)
    floors = _lookup(document.floors(task)) or _solver(trials)
    return Found(arm, runs, floors if options.oracle else None, PLAYED)


def _lookup(known: Sequence[int] | None) -> Floors | None:
    """Read proven numbers of steps off a list, if there is one."""
    return None if known is None else lambda numbers: [known[number] for number in numbers]


def _solver(trials: TrialSet) -> Floors:
    """Let the oracle solve no more trials than are played."""

    def floors(numbers: Sequence[int]) -> Sequence[int]:
        rows = list(numbers)
        part = TrialSet(trials.simulator, trials.seed, trials.starts[rows], trials.goals[rows])
        return [int(steps) for steps in oracle_bounds(part).steps_lower_bound]

    return floors


def _from_recordings(options: argparse.Namespace, names: Sequence[str | None]) -> Found:
    """Take recordings from a file."""
    found = load_recordings(options.source)
    if options.task is not None:
        found = [recording for recording in found if recording.task == options.task]
    runs: Runs = []
    for name in names:
        run = [each for each in found if name in (None, each.policy, group_of(each.policy))]
        if name is not None and not run:
            raise UnknownNameError("policy", name, dict.fromkeys(each.policy for each in found))
        runs.append(run)
    if not runs[0]:
        raise InvalidInputError(f"{str(options.source)!r} holds no recording that fits")
    return Found(Arm.load(options.arm or runs[0][0].arm), runs, None, len(runs[0]))


def choose(found: Found, options: argparse.Namespace) -> Runs:
    """Pick the trials that are to be played, and add what is proven of them.

    Raises
    ------
    InvalidInputError
        If there is no such trial, or there are too few.
    """
    positions = _positions(found.runs[0], options, found.played)
    runs = [[run[position] for position in positions] for run in found.runs]
    if found.floors is None:
        return runs
    floors = found.floors(positions)
    return [
        [replace(each, steps_lower_bound=floor) for each, floor in zip(run, floors, strict=True)]
        for run in runs
    ]


def _positions(
    recordings: Sequence[Recording], options: argparse.Namespace, played: int
) -> list[int]:
    """Positions of the chosen trials, in the order in which they are to be played."""
    everything = range(len(recordings))
    if options.trial is not None:
        numbers = [recording.trial for recording in recordings]
        for number in options.trial:
            if number not in numbers:
                raise InvalidInputError(
                    f"there is no trial {number}: they go from {min(numbers)} to {max(numbers)}"
                )
        return [k for number in options.trial for k in everything if numbers[k] == number]
    if options.collisions:
        collided = [k for k in everything if recordings[k].outcome == "collision"]
        if not collided:
            raise InvalidInputError(f"none of the {len(recordings)} trials ended in contact")
        return collided
    if options.worst is not None:
        if options.worst > len(recordings):
            raise InvalidInputError(
                f"--worst {options.worst} asks for more trials than there are: {len(recordings)}"
            )
        farthest = sorted(everything, key=lambda k: -recordings[k].final_distance)
        return farthest[: options.worst]
    return list(everything)[:played]
