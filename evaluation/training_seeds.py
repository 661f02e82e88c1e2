"""Which policies are training seeds of one recipe, by the provenance that they record."""

import json
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
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
    return {
        member.name: name if several[name] == 1 else _own_name(name, group)
        for name, group in zip(names, groups, strict=True)
        for member in group
    }


def _training(contestant: Contestant) -> Hashable:
    """A key that all seeds of a recipe share; the name if the contestant is no such seed."""
    if contestant.policy is None or contestant.seed is None:
        return contestant.name
    made = contestant.policy.provenance
    settings = {name: value for name, value in made.config.items() if name not in VARYING}
    shared = json.dumps(settings, sort_keys=True)
    return made.algorithm, made.recipe, shared, made.problem.digest


def _with_distinct_seeds(members: list[Contestant]) -> list[list[Contestant]]:
    """Split what holds a seed twice: by being shipped, by folder, and one by one."""
    groups = [members]
    for key in SPLITS:
        groups = [part for group in groups for part in _split(group, key)]
    return groups


def _split(
    members: list[Contestant], key: Callable[[Contestant], Hashable]
) -> list[list[Contestant]]:
    if len({member.seed for member in members}) == len(members):
        return [members]
    parts: dict[Hashable, list[Contestant]] = {}
    for member in members:
        parts.setdefault(key(member), []).append(member)
    return list(parts.values())


def _is_shipped(contestant: Contestant) -> bool:
    return contestant.source is not None and is_shipped(contestant.source)


SPLITS: tuple[Callable[[Contestant], Hashable], ...] = (
    _is_shipped,
    lambda contestant: contestant.source and contestant.source.parent,
    lambda contestant: contestant.name,
)


def _shared_name(group: Sequence[Contestant]) -> str:
    """The name without the seed if all have the same, else algorithm, recipe and problem."""
    names = {group_of(member.name) for member in group}
    first = group[0]
    if len(names) == 1 or first.problem is None:
        return names.pop()
    return f"{first.algorithm}-{first.recipe}-{first.problem.name}"


def _own_name(name: str, group: Sequence[Contestant]) -> str:
    """A name that no other group has."""
    first = group[0].name
    return first if len(group) == 1 else f"{name} ({first}, ...)"


def named_apart(contestants: Sequence[Contestant]) -> list[Contestant]:
    """Put the folder before the names of files that are called alike, but for shipped policies."""
    count = Counter(contestant.name for contestant in contestants)
    return [
        replace(contestant, name=f"{folder.name}/{contestant.name}")
        if count[contestant.name] > 1 and (folder := _folder(contestant))
        else contestant
        for contestant in contestants
    ]


def _folder(contestant: Contestant) -> Path | None:
    """Folder of a policy's file, if that is the user's."""
    if contestant.source is None or is_shipped(contestant.source):
        return None
    return contestant.source.parent
