"""Trainings that begin with a policy instead of with nothing."""

from collections.abc import Sequence

import numpy as np

from kinarm.errors import InvalidInputError
from kinarm.policies.library import load_policy
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.policy import Policy

SEEN = 10_000
"""Observations that the statistics of such a policy count for: new ones soon outweigh them."""


def starting_policy(name_or_file: str, widths: Sequence[int]) -> Policy:
    """Load a policy with which a training can begin, of any arm and problem.

    Parameters
    ----------
    name_or_file : str
        As for `kinarm.policies.load_policy`.
    widths : sequence of int
        Of its layers, from the observation to the action.

    Raises
    ------
    UnknownNameError, PolicyFileError
        If there is no such policy.
    InvalidInputError
        If its layers have other widths or functions than those of the training.
    """
    policy = load_policy(name_or_file)
    found = (policy.n_observations, *(len(layer.bias) for layer in policy.layers))
    if found != tuple(widths):
        raise InvalidInputError(
            f"initial_policy {name_or_file!r} has layers {_shown(found)}, "
            f"the training {_shown(widths)}"
        )
    usual = (*("tanh",) * (len(policy.layers) - 1), "linear")
    if policy.activations != usual:
        raise InvalidInputError(
            f"initial_policy {name_or_file!r} has the functions {', '.join(policy.activations)}; "
            f"those of the training are {', '.join(usual)}"
        )
    return policy


def statistics(policy: Policy) -> Normalizer:
    """What a policy knows of observations, as the statistics of a few of them."""
    return Normalizer(SEEN, np.array(policy.mean), SEEN * policy.std**2)


def _shown(widths: Sequence[int]) -> str:
    return "-".join(map(str, widths))
