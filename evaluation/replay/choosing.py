"""Trials to replay: new ones, those of an evaluation, or the recordings of a file."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import (
    ORACLE,
    UNTRAINED,
    Contestant,
    is_import_path,
)
from kinarm.evaluation.document import EvaluationDocument, check_same
from kinarm.evaluation.replay.runs import Run, faced_problem, first_contestant, stated_problem
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.library import BEST, group_of, policy_names
from kinarm.recording import Recording, load_recordings

if TYPE_CHECKING:
    from kinarm.evaluation.replay.request import ReplayRequest

PLAYED, SEARCHED, FAILING = 5, 200, 10_000
"""Trials that are played by default, among which some, and among which failures are looked for."""

MOST_FAILURES = 500
"""Failures that a page holds at most."""

LowerBounds = Callable[[Sequence[int]], Sequence[int | None]]
"""Gives the numbers of steps proven necessary in some trials, by their positions."""


@dataclass(frozen=True)
class Candidates:
    """Runs of one policy, or of two in the same trials, and how many trials are played by default.

    Without `LowerBounds`, what the recordings say of them is kept. Without `TrialSet`, nothing
    else can face them.
    """

    runs: Sequence[Run]
    lower_bounds: LowerBounds | None
    played: int
    trials: TrialSet | None = None


@dataclass(frozen=True)
class Chosen:
    """Recordings that are played.

    Attributes
    ----------
    runs : list
        Recordings of one policy, or of two in the same trials.
    groups : list of str
        What each trial is listed under, if they are in groups.
    heading : str
        What the list is of.
    """

    runs: list[list[Recording]]
    groups: list[str] = field(default_factory=list)
    heading: str = ""


def find_candidates(request: "ReplayRequest") -> Candidates:
    """Make or read the recordings to choose from."""
    default = BEST if request.failures and request.source is None else None
    names = request.compare or (request.policy or default,)
    if request.source is None:
        return _fresh_candidates(request, names)
    if request.source.suffix == ".json":
        return _evaluated_candidates(request.source, names, request.problem)
    return _recorded_candidates(request.source, names, request.problem, request.arm)


def _fresh_candidates(request: "ReplayRequest", names: Sequence[str | None]) -> Candidates:
    """Run policies on trials that are drawn now."""
    stated = stated_problem(request, names)
    contestants = [first_contestant(name, stated) for name in names]
    searched = request.trial or request.worst or request.collisions
    count = request.trials or (FAILING if request.failures else SEARCHED if searched else PLAYED)
    trials = TrialSet.draw(faced_problem(contestants, request, stated), count, request.seed or 0)
    options = {"allow_other_arm": request.allow_other_arm}
    runs = [Run.faced(contestant, trials, **options) for contestant in contestants]
    return Candidates(runs, _solved_bounds(trials), count, trials)


def _evaluated_candidates(
    path: Path, names: Sequence[str | None], problem: str | None
) -> Candidates:
    """Run policies on the trials of an evaluation again."""
    document = EvaluationDocument.load(path)
    chosen = []
    for name in names:
        contestant = None
        if name is not None and (Path(name).suffix in (".npz", ".zip") or is_import_path(name)):
            faced = problem or next(iter(document.protocol.problems))
            contestant = first_contestant(name, document.problem(faced))
        row = document.result(_name_in(document, contestant) if contestant else name, problem)
        problem = row.problem
        chosen.append((row, contestant or _known_contestant(row.policy, path)))
    count = min(len(row.outcomes.steps) for row, _ in chosen)
    trials = document.trials(str(problem)).first(count)
    runs = []
    for row, contestant in chosen:
        run = Run.faced(contestant, trials, allow_other_arm=True)
        check_same(row, run.ends)
        runs.append(run)
    bounds = document.lower_bounds(trials.problem.name)
    if bounds is None:
        return Candidates(runs, _solved_bounds(trials), PLAYED, trials)
    known = dict(enumerate(bounds))
    return Candidates(runs, lambda numbers: list(map(known.get, numbers)), PLAYED, trials)


def _known_contestant(name: str, path: Path) -> Contestant:
    """The contestant of a name, as long as that does not stand for a file of the user's."""
    if name in (*UNTRAINED, *policy_names()) or is_import_path(name):
        return first_contestant(name)
    raise InvalidInputError(f"policy {name!r} of {str(path)!r} is a file: name it with --policy")


def _name_in(document: EvaluationDocument, contestant: Contestant) -> str:
    """Name of a contestant in an evaluation: that of its file alone, or with its folder."""
    names = {row.policy for row in document.results}
    whole = f"{contestant.source.parent.name}/{contestant.name}" if contestant.source else ""
    return whole if whole in names and contestant.name not in names else contestant.name


def _solved_bounds(trials: TrialSet) -> LowerBounds:
    """Let the oracle solve no more trials than are played."""

    def lower_bounds(numbers: Sequence[int]) -> Sequence[int]:
        bounds: list[int] = oracle_bounds(trials.chosen(numbers)).steps_lower_bound.tolist()
        return bounds

    return lower_bounds


def _recorded_candidates(
    path: Path, names: Sequence[str | None], problem: str | None, arm: str | None
) -> Candidates:
    """Take recordings from a file; ``arm`` says where the URDF of their arm lies now."""
    found = [each for each in load_recordings(path) if problem in (None, each.problem.name)]
    if arm is not None:
        moved = (each.problem.replace(arm=replace(each.problem.arm, source=arm)) for each in found)
        found = [replace(each, problem=new) for each, new in zip(found, moved, strict=True)]
    runs = []
    for name in names:
        run = [each for each in found if name in (None, each.policy, group_of(each.policy))]
        if name is not None and not run:
            raise UnknownNameError("policy", name, dict.fromkeys(each.policy for each in found))
        runs.append(Run.of(run))
    if not runs[0].numbers:
        raise InvalidInputError(f"{str(path)!r} holds no recording that fits")
    return Candidates(runs, None, len(runs[0].numbers))


def chosen_recordings(request: "ReplayRequest") -> Chosen:
    """The recordings that a request asks for, with their bounds; the first run decides.

    Raises
    ------
    KinarmError
        If a file, name or number cannot be used, or there are too few trials.
    """
    candidates = find_candidates(request)
    first = candidates.runs[0]
    if request.failures:
        return _failures(candidates, oracle=request.oracle)
    if request.trial:
        positions = _positions_of(request.trial, first)
    elif request.collisions:
        positions = _positions_of_collisions(first)
    elif request.worst is not None:
        positions = _positions_of_worst(request.worst, first)
    else:
        positions = list(range(len(first.numbers)))[: candidates.played]
    return Chosen(_recorded(candidates, positions, oracle=request.oracle))


def _recorded(
    candidates: Candidates, positions: Sequence[int], *, oracle: bool
) -> list[list[Recording]]:
    """Recordings of some trials, with their lower bounds if the oracle is asked."""
    runs = [run.recorded(positions) for run in candidates.runs]
    if candidates.lower_bounds is None or not oracle:
        return runs
    bounds = candidates.lower_bounds(positions)
    return [
        [replace(each, steps_lower_bound=bound) for each, bound in zip(run, bounds, strict=True)]
        for run in runs
    ]


def _failures(candidates: Candidates, *, oracle: bool) -> Chosen:
    """All trials that failed, in groups by their cause, beside what the oracle does in them."""
    first = candidates.runs[0]
    causes, total = first.causes, len(first.numbers)
    if not causes:
        raise InvalidInputError(f"none of the {total} trials failed")
    if len(causes) > MOST_FAILURES:
        raise InvalidInputError(
            f"{len(causes)} of {total} trials failed, a page holds {MOST_FAILURES} at most: ask "
            "for fewer --trials"
        )
    frequency = Counter(causes.values())
    rank = sorted(frequency, key=lambda cause: (-frequency[cause], str(cause)))
    positions = sorted(causes, key=lambda position: (rank.index(causes[position]), position))
    runs = _recorded(candidates, positions, oracle=oracle)
    if oracle and len(runs) == 1 and candidates.trials is not None:
        runs.append(_oracle_ghosts(candidates.trials, positions))
    recording = runs[0][0]
    heading = (
        f"{recording.policy}: {len(causes)} of {total} trials of {recording.problem.name} failed"
    )
    return Chosen(runs, [str(causes[position]) for position in positions], heading)


def _oracle_ghosts(trials: TrialSet, numbers: Sequence[int]) -> list[Recording]:
    """Recordings of the oracle in some trials, under their numbers."""
    run = Run.faced(ORACLE, trials.chosen(numbers), allow_other_arm=True)
    recordings = run.recorded(range(len(numbers)))
    return [replace(each, trial=number) for each, number in zip(recordings, numbers, strict=True)]


def _positions_of(trials: Sequence[int], run: Run) -> list[int]:
    numbers = list(run.numbers)
    for trial in trials:
        if trial not in numbers:
            raise InvalidInputError(
                f"there is no trial {trial}: they go from {min(numbers)} to {max(numbers)}"
            )
    return [k for trial in trials for k, number in enumerate(numbers) if number == trial]


def _positions_of_collisions(run: Run) -> list[int]:
    collided = [k for k, (outcome, *_) in enumerate(run.ends) if outcome == "collision"]
    if not collided:
        raise InvalidInputError(f"none of the {len(run.numbers)} trials ended in contact")
    return collided


def _positions_of_worst(count: int, run: Run) -> list[int]:
    ends, positions = run.ends, dict[int, int]()
    for position in sorted(range(len(ends)), key=lambda k: -ends[k][2]):
        positions.setdefault(run.numbers[position], position)
    if count > len(positions):
        raise InvalidInputError(
            f"--worst {count} asks for more trials than there are: {len(positions)}"
        )
    return list(positions.values())[:count]
