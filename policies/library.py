"""The policies that ship with kinarm, and loading by name, group or file."""

import json
import re
from functools import cache
from importlib import resources
from pathlib import Path

from kinarm._files import absolute, is_file, is_folder
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies.policy import Policy
from kinarm.policies.training import CHECKPOINT
from kinarm.problem import ProblemLike, ReachProblem

BEST = "best"
"""Stands for the best shipped policy for a problem."""

RANKING = "ranking.json"
"""Which shipped policies are best, beside them: see docs/ranking.py."""

_SEED_SUFFIX = re.compile(r"-seed\d+$")


@cache
def policy_names() -> tuple[str, ...]:
    """Names of the shipped policies, such as ``ars-tuned-both-seed0``."""
    folder = resources.files("kinarm.data") / "policies"
    return tuple(
        sorted(Path(file.name).stem for file in folder.iterdir() if file.name.endswith(".npz"))
    )


def is_shipped(path: Path) -> bool:
    """Whether a file holds a shipped policy."""
    with resources.as_file(resources.files("kinarm.data") / "policies") as folder:
        return absolute(path).parent == absolute(folder)


def group_of(name: str) -> str:
    """Name without the training seed: what several seeds of one recipe and task share."""
    return _SEED_SUFFIX.sub("", name)


def best_policy(problem: ProblemLike | None) -> str:
    """Name of the best shipped policy for a problem.

    It was chosen when they were shipped, from what they reach of the problem as it ships; another
    tolerance, horizon, reward or spread of the starts does not change the choice.

    Parameters
    ----------
    problem : ReachProblem, str or Path
        The problem, its name or its file.

    Raises
    ------
    InvalidInputError
        If no problem is given, or no policy ships for its arm, scene and goals.
    """
    if problem is None:
        raise InvalidInputError(f"{BEST!r} is the best policy for a problem: name a --problem")
    wanted, best = ReachProblem.load(problem), _best_policies()
    for trained_for, name in best.items():
        if _differ_in_nothing_else(ReachProblem.load(trained_for), wanted):
            return name
    raise InvalidInputError(
        f"no shipped policy is for the arm, scene and goals of problem {wanted.name!r}: "
        f"they are for {', '.join(best)}"
    )


def _differ_in_nothing_else(one: ReachProblem, other: ReachProblem) -> bool:
    """Whether two problems have the same arm, scene and goals."""
    same_goals = set(one.task.goal_regions) == set(other.task.goal_regions)
    return same_goals and one.same_place(other)


@cache
def _best_policies() -> dict[str, str]:
    """Names of the best shipped policies, by problem."""
    text = (resources.files("kinarm.data") / "policies" / RANKING).read_text(encoding="utf-8")
    best: dict[str, str] = json.loads(text)["best"]
    return best


def load_policy(name_or_file: str | Path, problem: ProblemLike | None = None) -> Policy:
    """Load a shipped policy by name, or any policy from a file.

    Parameters
    ----------
    name_or_file : str or Path
        Name of a shipped policy; name of a group, for its first seed; ``"best"``; or path of a
        file, or of a folder, for the first policy in it.
    problem : ReachProblem, str or Path, optional
        What the best one is for.

    Raises
    ------
    UnknownNameError
        If it is neither a name nor a file.
    InvalidInputError
        If it is ``"best"`` and no policy ships for the problem.
    PolicyFileError
        If the file cannot be used.
    """
    return Policy.load(policy_files(name_or_file, problem)[0])


def policy_files(name_or_file: str | Path, problem: ProblemLike | None = None) -> tuple[Path, ...]:
    """Files behind a policy's name, a group's name, ``"best"`` or a path; see `load_policy`.

    Those of a folder are in the order of the numbers in their names.

    Raises
    ------
    UnknownNameError
        If it is none of these.
    InvalidInputError
        If it is ``"best"`` and no policy ships for the problem, or a folder without policies.
    """
    text, path = str(name_or_file), Path(name_or_file)
    if text == BEST:
        text = best_policy(problem)
    names = [name for name in policy_names() if text in (name, group_of(name))]
    if names:
        with resources.as_file(resources.files("kinarm.data") / "policies") as folder:
            return tuple(folder / f"{name}.npz" for name in names)
    if is_folder(path):
        return _files_in(path)
    if is_file(path) or path.suffix == ".npz" or path.parent != Path():
        return (path,)
    groups = dict.fromkeys(group_of(name) for name in policy_names())
    raise UnknownNameError("policy", text, (BEST, *groups, "path/to/policy.npz", "folder/"))


def _files_in(folder: Path) -> tuple[Path, ...]:
    """Policies in a folder, but not the checkpoints of trainings."""
    found = [path for path in folder.glob("*.npz") if not path.name.endswith(CHECKPOINT)]
    if not found:
        raise InvalidInputError(f"there is no policy (.npz) in the folder {str(folder)!r}")
    return tuple(sorted(found, key=lambda path: re.sub(r"\d+", _padded, path.name)))


def _padded(number: re.Match[str]) -> str:
    return number[0].rjust(20, "0")
