"""Who faces which problem, and which policies are training seeds of one recipe."""

import json
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from kinarm.errors import InvalidInputError
from kinarm.evaluation.contestants import BASELINES, ORACLE, UNTRAINED, Contestant
from kinarm.evaluation.finding import check_normalizing, find_contestants
from kinarm.policies.library import group_of, is_shipped, policy_names
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import problem_names

if TYPE_CHECKING:
    from kinarm.evaluation.request import EvaluationRequest

Pair = tuple[Contestant, ReachProblem]
"""Who faces what."""

SHOWN_SHIELDED = "best"
"""Recipe whose shipped policies are shown behind a shield, too."""

VARYING = ("seed", "vec_normalize")
"""Settings that differ between training seeds."""


def select_pairs(request: "EvaluationRequest") -> list[Pair]:
    """Decide who faces which problem; the oracle joins on every one.

    Behind a shield come those that are asked to or learnt so; unasked, `SHOWN_SHIELDED`, too.
    """
    named = _named_problems(request)
    chosen = _named_contestants(request, named) if request.policies else _shipped(request, named)
    check_normalizing(chosen, request.vec_normalize)
    bare = [each.bare() for each in chosen]
    behind = [
        each.shielded()
        for each, without in zip(chosen, bare, strict=True)
        if (request.shield and each not in UNTRAINED.values())
        or each is not without
        or (each.recipe == SHOWN_SHIELDED and not request.policies)
    ]
    known = {(each.name, each.source) for each in bare}
    chosen = [*bare, *(each for each in behind if (each.name, each.source) not in known)]
    stated = request.matrix or (request.policies and named)
    pairs = [
        (contestant, problem)
        for problem, contestant in product(named or _problems(request, chosen), chosen)
        if stated or contestant.serves(problem, partial(_changed, request))
    ]
    if request.oracle and ORACLE not in chosen:
        faced = {problem.digest: problem for _, problem in pairs}
        pairs += [(ORACLE, problem) for problem in faced.values()]
    check_names(pairs)
    return pairs


def _named_problems(request: "EvaluationRequest") -> list[ReachProblem]:
    names = request.problems if request.problem is None else (request.problem, *request.problems)
    if not names and request.task is not None:
        return [request.resolve()]
    problems = (replace(request, problem=name).resolve() for name in names)
    return list({problem.digest: problem for problem in problems}.values())


def _changed(request: "EvaluationRequest", problem: ReachProblem) -> ReachProblem:
    """A problem with the changes that the options make."""
    return replace(request, problem=None, task=None).resolve(problem)


def _shipped(request: "EvaluationRequest", named: list[ReachProblem]) -> list[Contestant]:
    """Shipped policies for the arm and the named problems; then the baselines.

    Names say what policies were trained for: others are not opened.
    """
    others = {each.name for each in named}.intersection(problem_names())
    known = PROBLEMS | {name: ReachProblem.load(name) for name in others}
    serving = tuple(
        f"-{name}"
        for name, problem in known.items()
        if (changed := _changed(request, problem)).arm_digest == problem.arm_digest
        and (not named or any(changed.faced_as(each).covers(each) for each in named))
    )
    shipped = [
        contestant
        for name in policy_names()
        if group_of(name).endswith(serving)
        for contestant in find_contestants(name, wrapper=request.wrapper)
    ]
    return [*shipped, *BASELINES.values()]


def _named_contestants(request: "EvaluationRequest", named: list[ReachProblem]) -> list[Contestant]:
    """Contestants that are named, without repetition."""
    only = named[0] if len(named) == 1 else None
    found: dict[tuple[str, Path | None], Contestant] = {}
    for name in dict.fromkeys(request.policies):
        chosen = find_contestants(name, only, request.vec_normalize, request.wrapper)
        found |= {(each.name, each.source): each for each in chosen}
    return named_apart(list(found.values()))


def _problems(request: "EvaluationRequest", chosen: list[Contestant]) -> list[ReachProblem]:
    """Problems of the contestants, or all; the paper's come first.

    Of those that differ in what they show alone, the first is faced: all see what they learnt to.
    """
    own: dict[str, ReachProblem] = {}
    for problem in (_changed(request, each.problem) for each in chosen if each.problem):
        own.setdefault(problem.unseen.digest, problem)
    changed = (_changed(request, problem) for problem in PROBLEMS.values())
    shipped = {problem.digest: problem for problem in changed}
    if request.matrix or not own:
        return list((shipped | own).values())
    return [own.pop(digest) for digest in shipped if digest in own] + list(own.values())


def check_names(pairs: Iterable[Pair]) -> None:
    """Refuse two contestants, or two problems that they face, of one name."""
    contestants: dict[str, Contestant] = {}
    problems: dict[str, ReachProblem] = {}
    faced = set()
    for contestant, problem in pairs:
        difference = problems.setdefault(problem.name, problem).first_difference(problem)
        if difference is not None:
            raise InvalidInputError(
                f"two problems are called {problem.name!r}: in the second, {difference}"
            )
        first = contestants.setdefault(contestant.name, contestant)
        if first.source != contestant.source or (contestant.name, problem.name) in faced:
            sources = (each.source or "the one that needs no file" for each in (first, contestant))
            raise InvalidInputError(
                f"two policies are called {contestant.name!r}: {' and '.join(map(str, sources))}; "
                "rename a file"
            )
        faced.add((contestant.name, problem.name))


def group_names(contestants: Iterable[Contestant]) -> dict[str, str]:
    """Name of each contestant's group of training seeds, by its own name.

    Seeds of a group share learner, settings and problem. If a seed occurs
    twice, shipped policies, and those of each folder, are apart.

    Parameters
    ----------
    contestants : iterable of Contestant
        Contestants with distinct names; one may occur several times.
    """
    alike: dict[Hashable, list[Contestant]] = {}
    for contestant in {each.name: each for each in contestants}.values():
        alike.setdefault(training_of(contestant), []).append(contestant)
    groups = [group for members in alike.values() for group in _with_distinct_seeds(members)]
    names = [_shared_name(group) for group in groups]
    several = Counter(names)
    found: dict[str, str] = {}
    for name, group in zip(names, groups, strict=True):
        if several[name] > 1:  # a name that no other group has
            first = group[0].name
            name = first if len(group) == 1 else f"{name} ({first}, ...)"
        found |= {member.name: name for member in group}
    return found


def training_of(contestant: Contestant) -> Hashable:
    """A key that all seeds of a recipe share, or the name."""
    if contestant.policy is None or contestant.seed is None:
        return contestant.name
    made = contestant.policy.provenance
    settings = {name: value for name, value in made.config.items() if name not in VARYING}
    shared = json.dumps(settings, sort_keys=True)
    return made.algorithm, made.recipe, shared, made.problem.digest, contestant.has_shield


def _is_shipped(contestant: Contestant) -> bool:
    return contestant.source is not None and is_shipped(contestant.source)


SPLIT_BY: tuple[Callable[[Contestant], Hashable], ...] = (
    _is_shipped,
    lambda contestant: contestant.source and contestant.source.parent,
    lambda contestant: contestant.name,
)


def _with_distinct_seeds(members: list[Contestant], depth: int = 0) -> list[list[Contestant]]:
    """Split a group with a seed twice: by being shipped, by folder, one by one."""
    if len({member.seed for member in members}) == len(members):
        return [members]
    parts: dict[Hashable, list[Contestant]] = {}
    for member in members:
        parts.setdefault(SPLIT_BY[depth](member), []).append(member)
    return [group for part in parts.values() for group in _with_distinct_seeds(part, depth + 1)]


def _shared_name(group: Sequence[Contestant]) -> str:
    """The common name without the seed, else algorithm, recipe and problem."""
    names = {group_of(member.name) for member in group}
    first = group[0]
    if len(names) == 1 or first.problem is None:
        return names.pop()
    return f"{first.algorithm}-{first.recipe}-{first.problem.name}"


def named_apart(contestants: Sequence[Contestant]) -> list[Contestant]:
    """Put the folder before equal names of files, but for shipped policies."""
    count = Counter(contestant.name for contestant in contestants)
    named = []
    for each in contestants:
        if count[each.name] > 1 and each.source and not _is_shipped(each):
            each = replace(each, name=f"{each.source.parent.name}/{each.name}")
        named.append(each)
    return named
