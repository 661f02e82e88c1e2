"""The shipped policies, and loading by name, group or file."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kinarm._files import absolute, is_file, is_folder, shipped_files
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.observation_layout import ObservationLayout, observation_layout
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.policy import Policy
from kinarm.problem import ReachProblem

SEEN = 10_000
"""Weight of an initial policy's statistics, in observations; new ones soon outweigh it."""


def policy_names() -> tuple[str, ...]:
    """Names of the shipped policies, such as ``ars-tuned-both-seed0``."""
    return tuple(shipped_files("policies", ".npz"))


def is_shipped(path: Path) -> bool:
    """Whether a file holds a shipped policy."""
    return absolute(path) in map(absolute, shipped_files("policies", ".npz").values())


def group_of(name: str) -> str:
    """Name without the training seed."""
    return re.sub(r"-seed\d+$", "", name)


def load_policy(name_or_file: str | Path) -> Policy:
    """Load a shipped policy by name, or any policy from a file.

    Parameters
    ----------
    name_or_file : str or Path
        Name of a shipped policy, or of a group for its first seed; or path of a
        file, or of a folder for the first policy in it.

    Raises
    ------
    KinarmError
        If it is neither name nor file, or the file cannot be used.
    """
    return Policy.load(policy_files(name_or_file)[0])


def policy_files(name_or_file: str | Path) -> tuple[Path, ...]:
    """Files behind a policy's name, a group's name or a path; see `load_policy`.

    In a folder, numbers in their names order them.
    """
    text, path = str(name_or_file), Path(name_or_file)
    shipped = shipped_files("policies", ".npz").items()
    files = tuple(file for name, file in shipped if text in (name, group_of(name)))
    if files:
        return files
    if text and is_folder(path):
        if not (found := _in_order(path.glob("*.npz"))):
            raise InvalidInputError(f"there is no policy (.npz) in the folder {str(path)!r}")
        return tuple(found)
    if is_file(path) or path.suffix == ".npz" or path.parent != Path():
        return (path,)
    groups = dict.fromkeys(group_of(name) for name in policy_names())
    raise UnknownNameError("policy", text, (*groups, "path/to/policy.npz", "folder/"))


def models_in(path: Path) -> list[Path]:
    """Models of Stable-Baselines3 (.zip) in a folder without policies, in the same order."""
    if not is_folder(path) or any(path.glob("*.npz")):
        return []
    return _in_order(path.glob("*.zip"))


def _in_order(paths: Iterable[Path]) -> list[Path]:
    """Paths in the order of the numbers in their names."""
    return sorted(paths, key=lambda path: re.sub(r"\d+", lambda n: n[0].rjust(20, "0"), path.name))


def layer_widths(problem: ReachProblem, hidden: Sequence[int] = ()) -> tuple[int, ...]:
    """Widths of a policy's layers, from the observation to the action."""
    arm = problem.load_arm()
    return (ObservationLayout.of(problem, arm).size, *hidden, arm.n_actuated)


def starting_policy(config: Any) -> Policy:
    """Load the ``initial_policy`` of a training with ARS or PPO, of any arm and problem.

    Its layers must have the training's widths, from observation to action, and functions; it must
    see the same; and either both are residual, or neither.
    """
    name, residual = config.initial_policy, getattr(config, "residual", False)
    policy, widths = load_policy(name), layer_widths(config.problem, config.net_arch)
    own = policy.n_observations, *(len(layer.bias) for layer in policy.layers)
    usual = (*("tanh",) * (len(widths) - 2), "linear")
    sides = (own, policy.activations, policy.residual), (widths, usual, residual)
    if sides[0] != sides[1]:
        found, wanted = (
            f"{'-'.join(map(str, sizes))} ({', '.join(functions)}{'; residual' * adds})"
            for sizes, functions, adds in sides
        )
        raise InvalidInputError(
            f"initial_policy {name!r} has layers {found}, the training {wanted}"
        )
    seen, shown = map(observation_layout, (policy.problem, config.problem))
    if seen != shown:
        raise InvalidInputError(f"initial_policy {name!r} sees {seen}, the training {shown}")
    return policy


def statistics(policy: Policy) -> Normalizer:
    """A policy's statistics, as if of few observations."""
    return Normalizer(SEEN, np.array(policy.mean), SEEN * policy.std**2)
