"""Which policies are training seeds of one recipe, by the provenance that they record."""

import json
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from kinarm.evaluation.entrants import Entrant
from kinarm.policies.library import group_of, is_shipped

VARYING = ("seed", "vec_normalize")
"""Settings that differ between the training seeds of a recipe."""


def group_names(entrants: Iterable[Entrant]) -> dict[str, str]:
    """Name of what each entrant shares with other training seeds, by its own name.

    Seeds belong together that have the same learner, settings and problem. Where a seed occurs
    twice, shipped policies, and those of each folder, are apart from others.

    Parameters
    ----------
    entrants : iterable of Entrant
        Entrants with names of their own; one may occur several times.
    """
    alike: dict[Hashable, list[Entrant]] = {}
    for entrant in {each.name: each for each in entrants}.values():
        alike.setdefault(_training(entrant), []).append(entrant)
    groups = [group for members in alike.values() for group in _with_distinct_seeds(members)]
    names = [_shared_name(group) for group in groups]
    several = Counter(names)
    return {
        member.name: name if several[name] == 1 else _own_name(name, group)
        for name, group in zip(names, groups, strict=True)
        for member in group
    }


def _training(entrant: Entrant) -> Hashable:
    """A key that all seeds of a recipe share; the name if the entrant is no such seed."""
    if entrant.policy is None or entrant.seed is None:
        return entrant.name
    made = entrant.policy.provenance
    settings = {name: value for name, value in made.config.items() if name not in VARYING}
    shared = json.dumps(settings, sort_keys=True)
    return made.algorithm, made.recipe, shared, made.problem.digest


def _with_distinct_seeds(members: list[Entrant]) -> list[list[Entrant]]:
    """Split what holds a seed twice: by being shipped, by folder, and one by one."""
    groups = [members]
    for key in SPLITS:
        groups = [part for group in groups for part in _split(group, key)]
    return groups


def _split(members: list[Entrant], key: Callable[[Entrant], Hashable]) -> list[list[Entrant]]:
    if len({member.seed for member in members}) == len(members):
        return [members]
    parts: dict[Hashable, list[Entrant]] = {}
    for member in members:
        parts.setdefault(key(member), []).append(member)
    return list(parts.values())


def _is_shipped(entrant: Entrant) -> bool:
    return entrant.source is not None and is_shipped(entrant.source)


SPLITS: tuple[Callable[[Entrant], Hashable], ...] = (
    _is_shipped,
    lambda entrant: entrant.source and entrant.source.parent,
    lambda entrant: entrant.name,
)


def _shared_name(group: Sequence[Entrant]) -> str:
    """The name without the seed if all have the same, else algorithm, recipe and problem."""
    names = {group_of(member.name) for member in group}
    first = group[0]
    if len(names) == 1 or first.problem is None:
        return names.pop()
    return f"{first.algorithm}-{first.recipe}-{first.problem.name}"


def _own_name(name: str, group: Sequence[Entrant]) -> str:
    """A name that no other group has."""
    first = group[0].name
    return first if len(group) == 1 else f"{name} ({first}, ...)"


def named_apart(entrants: Sequence[Entrant]) -> list[Entrant]:
    """Put the folder before the names of files that are called alike, but for shipped policies."""
    count = Counter(entrant.name for entrant in entrants)
    return [
        replace(entrant, name=f"{folder.name}/{entrant.name}")
        if count[entrant.name] > 1 and (folder := _folder(entrant))
        else entrant
        for entrant in entrants
    ]


def _folder(entrant: Entrant) -> Path | None:
    """Folder of a policy's file, if that is the user's."""
    if entrant.source is None or is_shipped(entrant.source):
        return None
    return entrant.source.parent
