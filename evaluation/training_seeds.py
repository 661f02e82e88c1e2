"""Which policies are training seeds of one recipe, by the provenance that they record."""

import json
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

from kinarm.evaluation.contestants import Contestant
from kinarm.policies.library import group_of, is_shipped

VARYING = ("seed", "vec_normalize")
"""Settings that differ between the training seeds of a recipe."""


def group_names(contestants: Iterable[Contestant]) -> dict[str, str]:
    """Name of what each contestant shares with other training seeds, by its own name.

    Seeds belong together that have the same learner, settings and problem. Where a seed occurs
    twice, shipped policies, and those of each folder, are apart from others.

    Parameters
    ----------
    contestants : iterable of Contestant
        Contestants with names of their own; one may occur several times.
    """
    alike: dict[Hashable, list[Contestant]] = {}
    for contestant in {each.name: each for each in contestants}.values():
        alike.setdefault(_training(contestant), []).append(contestant)
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


def _training(contestant: Contestant) -> Hashable:
    """A key that all seeds of a recipe share; the name if the contestant is no such seed."""
    if contestant.policy is None or contestant.seed is None:
        return contestant.name
    made = contestant.policy.provenance
    settings = {name: value for name, value in made.config.items() if name not in VARYING}
    shared = json.dumps(settings, sort_keys=True)
    return made.algorithm, made.recipe, shared, made.problem.digest


def _is_shipped(contestant: Contestant) -> bool:
    return contestant.source is not None and is_shipped(contestant.source)


def _folder(contestant: Contestant) -> Path | None:
    """Folder of a policy's file."""
    return contestant.source and contestant.source.parent


SPLIT_BY: tuple[Callable[[Contestant], Hashable], ...] = (_is_shipped, _folder, attrgetter("name"))


def _with_distinct_seeds(members: list[Contestant], depth: int = 0) -> list[list[Contestant]]:
    """Split what holds a seed twice: by being shipped, by folder, and one by one."""
    if len({member.seed for member in members}) == len(members):
        return [members]
    parts: dict[Hashable, list[Contestant]] = {}
    for member in members:
        parts.setdefault(SPLIT_BY[depth](member), []).append(member)
    return [group for part in parts.values() for group in _with_distinct_seeds(part, depth + 1)]


def _shared_name(group: Sequence[Contestant]) -> str:
    """The name without the seed if all have the same, else algorithm, recipe and problem."""
    names = {group_of(member.name) for member in group}
    first = group[0]
    if len(names) == 1 or first.problem is None:
        return names.pop()
    return f"{first.algorithm}-{first.recipe}-{first.problem.name}"


def named_apart(contestants: Sequence[Contestant]) -> list[Contestant]:
    """Put the folder before the names of files that are called alike, but for shipped policies."""
    count = Counter(contestant.name for contestant in contestants)
    named = []
    for each in contestants:
        if count[each.name] > 1 and not _is_shipped(each) and (folder := _folder(each)):
            each = replace(each, name=f"{folder.name}/{each.name}")
        named.append(each)
    return named
