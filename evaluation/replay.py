"""What is replayed: trials that are run now, or of a file; and policies that run in a page."""

import base64
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from kinarm._fields import to_plain
from kinarm.errors import InvalidInputError, KinarmError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import ORACLE, Contestant
from kinarm.evaluation.finding import check_normalizing, find_contestants
from kinarm.evaluation.outcomes import failure_causes
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.export import contract_of
from kinarm.policies.oracle import OracleSolutions
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import package_versions, source_commit
from kinarm.problem import ReachProblem
from kinarm.problem_options import say_choices
from kinarm.recording import Recording, load_recordings, record_rollouts
from kinarm.viewer.html_page import HtmlPage
from kinarm.viewer.pages import play_page
from kinarm.world import World

if TYPE_CHECKING:
    from kinarm.evaluation.commands.replay import ReplayRequest

SHOWN, SEARCHED, FAILING = 5, 200, 10_000
"""Default numbers of trials: to play, to choose from, to look for failures in."""

MOST_FAILURES = 500
"""Most failures that a page holds."""

PLAYED = ("ppo-best-both", "ppo-best-hard-paper", "ars-linear-both", "ars-paper-both")
"""Policies that a playground has by default."""

OFFERED = 20
"""Trials that a page offers by default."""

Trial = tuple[Recording, ...]
"""One trial as run by one policy, or by two."""


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
    contestant.check(trials.problem, trials.simulator.arm, allow_other_arm=allow_other_arm)
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


class Chosen(NamedTuple):
    """Recordings that are played.

    Attributes
    ----------
    runs : list
        Recordings of one policy, or of two in the same trials.
    groups : sequence of str
        The group of each trial, if any.
    heading : str
        Heading of the list.
    """

    runs: list[list[Recording]]
    groups: Sequence[str] = ()
    heading: str = ""


def chosen_recordings(request: "ReplayRequest") -> Chosen:
    """The recordings of a request, with bounds; the first policy decides."""
    file = request.source
    trials, bounded = _run_trials(request) if file is None else (_read(file, request.arm), None)
    if request.failures:
        return _failures(trials, bounded)
    if request.trial:
        trials = _numbered(trials, request.trial)
    elif request.worst is not None:
        trials = _worst(trials, request.worst)
    return Chosen(_with_bounds(trials, bounded))


def _read(file: Path, arm: str | None) -> list[Trial]:
    """Read the recordings to choose from."""
    found = load_recordings(file)
    if not found:
        raise InvalidInputError(f"{str(file)!r} holds no recording")
    if arm is not None:  # where their URDF lies now
        moved = (each.problem.replace(arm=replace(each.problem.arm, source=arm)) for each in found)
        found = [replace(each, problem=new) for each, new in zip(found, moved, strict=True)]
    return [(each,) for each in found]


def _run_trials(request: "ReplayRequest") -> tuple[list[Trial], TrialSet | None]:
    """Run policies on trials that are drawn now; these as well if the oracle is to be asked."""
    names = request.compare or ((request.policy,) if request.policy else ())
    if not names:
        raise InvalidInputError("name a --policy, or a file of recordings")
    contestants, problem = named_contestants(request, names)
    searched = request.trial or request.worst
    count = request.trials or (FAILING if request.failures else SEARCHED if searched else SHOWN)
    trials = TrialSet.draw(problem, count, request.seed or 0)
    other = request.allow_other_arm
    runs = [record(contestant, trials, allow_other_arm=other) for contestant in contestants]
    return list(zip(*runs, strict=True)), trials if request.oracle else None


def named_contestants(
    request: "ReplayRequest", names: Sequence[str]
) -> tuple[list[Contestant], ReachProblem]:
    """The contestants of names, of groups the first seeds, and the problem that they face.

    The request names it, or changes that of the first trained contestant.
    """
    named = request.problem is not None or request.task is not None
    stated = request.resolve() if named else None
    contestants = [
        find_contestants(name, stated, request.vec_normalize, request.wrapper)[0] for name in names
    ]
    check_normalizing(contestants, request.vec_normalize)
    if request.shield:
        contestants = [each.shielded() for each in contestants]
    if stated is not None:
        return contestants, stated
    trained = [contestant.problem for contestant in contestants if contestant.problem is not None]
    if not trained:
        raise InvalidInputError(f"{contestants[0].name!r} was not trained: name a --problem")
    return contestants, request.resolve(trained[0])


def _with_bounds(trials: Sequence[Trial], bounded: TrialSet | None) -> list[list[Recording]]:
    """Recordings by policy, with lower bounds if the oracle is asked."""
    runs = [list(run) for run in zip(*trials, strict=True)]
    if bounded is None:
        return runs
    numbers = [recording.trial for recording in runs[0]]
    bounds = oracle_bounds(bounded.chosen(numbers)).steps_lower_bound.tolist()
    return [
        [replace(each, steps_lower_bound=n) for each, n in zip(run, bounds, strict=True)]
        for run in runs
    ]


def _failures(trials: Sequence[Trial], bounded: TrialSet | None) -> Chosen:
    """All trials that failed, in groups by cause, beside the oracle."""
    first, total = [trial[0] for trial in trials], len(trials)
    ends = zip(*((each.outcome, each.steps, each.contact) for each in first), strict=True)
    found = failure_causes(*ends)
    if not found:
        raise InvalidInputError(f"none of the {total} trials failed")
    if len(found) > MOST_FAILURES:
        raise InvalidInputError(
            f"{len(found)} of {total} trials failed, a page holds {MOST_FAILURES} at most: ask for "
            "fewer --trials"
        )
    causes = {number: str(cause) for number, cause in found.items()}
    frequency = Counter(causes.values())
    order = sorted(causes, key=lambda number: (-frequency[causes[number]], causes[number]))
    runs = _with_bounds([trials[number] for number in order], bounded)
    if len(runs) == 1 and bounded is not None:
        numbers = [recording.trial for recording in runs[0]]
        ghosts = record(ORACLE, bounded.chosen(numbers), allow_other_arm=True)
        runs.append([replace(each, trial=numbers[each.trial]) for each in ghosts])
    policy, problem = first[0].policy, first[0].problem.name
    heading = f"{policy}: {len(causes)} of {total} trials of {problem} failed"
    return Chosen(runs, [causes[number] for number in order], heading)


def _numbered(trials: Sequence[Trial], wanted: Collection[int]) -> list[Trial]:
    """Trials of the wanted numbers, in that order."""
    numbers = [first.trial for first, *_ in trials]
    for number in wanted:
        if number not in numbers:
            raise InvalidInputError(
                f"there is no trial {number}: they go from {min(numbers)} to {max(numbers)}"
            )
    return [trial for number in wanted for trial in trials if trial[0].trial == number]


def _worst(trials: Sequence[Trial], count: int) -> list[Trial]:
    """The trials that ended farthest from their goals, each number once."""
    found: dict[int, Trial] = {}
    for trial in sorted(trials, key=lambda trial: -trial[0].final_distance):
        found.setdefault(trial[0].trial, trial)
    if count > len(found):
        raise InvalidInputError(
            f"--worst {count} asks for more trials than there are: {len(found)}"
        )
    return list(found.values())[:count]


def playground(request: "ReplayRequest") -> HtmlPage:
    """Make the page of a request's policies; its trials are those of an evaluation.

    Raises
    ------
    KinarmError
        If a policy is of another arm or observation, or does not run in a page.
    """
    contestants, problem = named_contestants(request, request.play or PLAYED)
    throughout = problem.replace(tested_configurations=0)
    trials = TrialSet.draw(throughout, request.trials or OFFERED, request.seed or 0)
    say_choices([trials.problem])
    world, other = trials.simulator.world, request.allow_other_arm
    players = [_player(each, world, allow_other_arm=other) for each in contestants]
    shield = problem.stepping.shield or any(each.has_shield for each in contestants)
    return play_page(world, players, trials.starts, trials.goals, shield=shield)


def _player(contestant: Contestant, world: World, *, allow_other_arm: bool) -> dict[str, Any]:
    """A contestant for a page, or one line that says why not."""
    policy, name = contestant.policy, contestant.name
    if policy is None:
        raise InvalidInputError(
            f"{name!r} does not run in a page: it is no dense network of kinarm's, or needs more "
            "than its observation"
        )
    try:
        contestant.check(world.problem, world.arm, allow_other_arm=allow_other_arm)
        return page_policy(name, policy, world)
    except KinarmError as refused:
        raise InvalidInputError(f"{name!r} does not run here: {refused}") from refused


def page_policy(name: str, policy: Policy, world: World) -> dict[str, Any]:
    """A policy for a page: its contract, and its network with the normaliser folded in."""
    networks, contract = policy.networks(), contract_of(policy, world)
    parameters = networks.parameters[0].astype("<f8").tobytes()
    return {
        "name": name,
        "contract": contract,
        "widths": networks.widths,
        "parameters": base64.b64encode(parameters).decode(),
        "signs": networks.mirror and networks.mirror._asdict(),
        "rates": networks.rates,
    }
