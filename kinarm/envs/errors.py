"""Errors of environments: kinarm's, and at the same time those that users of Gymnasium catch."""

import gymnasium.error

from kinarm.errors import InvalidInputError


class ResetNeededError(InvalidInputError, gymnasium.error.ResetNeeded):
    """An environment was stepped or rendered before its first reset."""


class ClosedEnvironmentError(InvalidInputError, gymnasium.error.ClosedEnvironmentError):
    """An environment was used after it was closed."""


class UnexpectedArgumentError(InvalidInputError, TypeError):
    """An environment cannot be made with an argument of this name.

    As everywhere in Python it is a TypeError, by which libraries that try arguments go.
    """
