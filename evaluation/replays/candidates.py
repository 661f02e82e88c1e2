"""What can be replayed: trials faced now, those of an evaluation again, or recordings of a file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.document import EvaluationDocument
from kinarm.evaluation.entrants import Entrant, find_entrants
from kinarm.evaluation.imported import is_import_path
from kinarm.evaluation.replays.recorder import record
from kinarm.evaluation.replays.request import ReplayRequest
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.library import group_of
from kinarm.problem import ReachProblem
from kinarm.problem_options import ProblemOptions
from kinarm.recording import Recording, load_recordings

PLAYED, SEARCHED = 5, 200
"""Trials that are played by default, and trials among which some are looked for."""

Runs = list[list[Recording]]
"""Recordings of one policy, or of two in the same trials."""

LowerBounds = Callable[[Sequence[int]], Sequence[int]]
"""Gives the numbers of steps proven necessary in some trials, by their positions."""


@dataclass(frozen=True)
class Candidates:
    """Recordings to choose from, and how many are played where nothing says which.

    Without `LowerBounds`, what the recordings say of them is kept.
    """

    runs: Runs
    lower_bounds: LowerBounds | None
    played: int


def first_entrant(name: str | None, problem: ReachProblem | None = None) -> Entrant:
    """The entrant of a name; of a group, its first seed.

    Where the entrant does not say which problem it is for, it is this one.

    Raises
    ------
    InvalidInputError
        If none is named, or it does not exist.
    """
    if name is None:
        raise InvalidInputError("name a --policy, or a file of recordings or of an evaluation")
    return find_entrants(name, problem)[0]


def faced_problem(entrants: Sequence[Entrant], options: ProblemOptions) -> ReachProblem:
    """The problem that options make of the one that the first trained entrant is for.

    Raises
    ------
    InvalidInputError
        If no entrant was trained and no option names a problem.
    """
    trained = [entrant.problem for entrant in entrants if entrant.problem is not None]
    if not trained and options.problem is None and options.task is None:
        raise InvalidInputError(f"{entrants[0].name!r} was not trained: name a --problem")
    return options.resolve(trained[0] if trained else "right")


def stated_problem(options: ProblemOptions) -> ReachProblem | None:
    """The problem that options name, if they name one."""
    named = options.problem is not None or options.task is not None
    return options.resolve() if named else None


def find_candidates(request: ReplayRequest) -> Candidates:
    """Make or read the recordings to choose from."""
    names = request.compare or (request.policy,)
    if request.source is None:
        return _fresh_candidates(request, names)
    if request.source.suffix == ".json":
        return _evaluated_candidates(request.source, names, request.problem)
    return _recorded_candidates(request.source, names, request.problem, request.arm)


def _fresh_candidates(request: ReplayRequest, names: Sequence[str | None]) -> Candidates:
    """Let policies face trials that are drawn now."""
    entrants = [first_entrant(name, stated_problem(request)) for name in names]
    searched = request.trial or request.worst or request.collisions
    count = request.trials or (SEARCHED if searched else PLAYED)
    trials = TrialSet.draw(faced_problem(entrants, request), count, request.seed or 0)
    runs = [record(each, trials, allow_other_arm=request.allow_other_arm) for each in entrants]
    return Candidates(runs, _solved_bounds(trials), count)


def _evaluated_candidates(
    path: Path, names: Sequence[str | None], problem: str | None
) -> Candidates:
    """Let policies face the trials of an evaluation again."""
    document = EvaluationDocument.load(path)
    runs: Runs = []
    for name in names:
        entrant = None
        if name is not None and (Path(name).suffix in (".npz", ".zip") or is_import_path(name)):
            faced = problem or next(iter(document.protocol["problems"]))
            entrant = first_entrant(name, document.problem(faced))
        row = document.result(entrant.name if entrant else name, problem)
        problem, trials = row["problem"], document.trials(row["problem"])
        recordings = record(entrant or first_entrant(row["policy"]), trials, allow_other_arm=True)
        document.check_same(row, recordings)
        runs.append(recordings)
    known = document.floors(trials.problem.name)
    if known is None:
        return Candidates(runs, _solved_bounds(trials), PLAYED)
    return Candidates(runs, lambda numbers: [known[number] for number in numbers], PLAYED)


def _solved_bounds(trials: TrialSet) -> LowerBounds:
    """Let the oracle solve no more trials than are played."""

    def lower_bounds(numbers: Sequence[int]) -> Sequence[int]:
        rows = list(numbers)
        part = replace(trials, starts=trials.starts[rows], goals=trials.goals[rows])
        return [int(steps) for steps in oracle_bounds(part).steps_lower_bound]

    return lower_bounds


def _recorded_candidates(
    path: Path, names: Sequence[str | None], problem: str | None, arm: str | None
) -> Candidates:
    """Take recordings from a file; ``arm`` says where the URDF of their arm lies now."""
    found = [each for each in load_recordings(path) if problem in (None, each.problem.name)]
    if arm is not None:
        moved = (each.problem.replace(arm=replace(each.problem.arm, source=arm)) for each in found)
        found = [replace(each, problem=new) for each, new in zip(found, moved, strict=True)]
    runs: Runs = []
    for name in names:
        run = [each for each in found if name in (None, each.policy, group_of(each.policy))]
        if name is not None and not run:
            raise UnknownNameError("policy", name, dict.fromkeys(each.policy for each in found))
        runs.append(run)
    if not runs[0]:
        raise InvalidInputError(f"{str(path)!r} holds no recording that fits")
    return Candidates(runs, None, len(runs[0]))


def chosen_recordings(request: ReplayRequest) -> Runs:
    """What a request asks for, with what is proven of it; the first run decides.

    Raises
    ------
    KinarmError
        If a file, name or number cannot be used, or there are too few trials.
    """
    candidates = find_candidates(request)
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
