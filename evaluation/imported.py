"""Policies of a user's own modules, by ``module:function``."""

import inspect
import re
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._files import first_line
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.policies.policy import Policy
from kinarm.simulator import PolicyFunction

IMPORT_PATH = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


class Predictor(Protocol):
    """Something that chooses actions as models of Stable-Baselines3 do."""

    @property
    def predict(self) -> Callable[..., Any]:
        """From observations, shape (n, n_observations), to actions, or to actions and a state."""


def is_import_path(text: str) -> bool:
    """Whether a text has the form ``module:function``."""
    return IMPORT_PATH.fullmatch(text) is not None


def imported_policy(name: str) -> Policy | PolicyFunction:
    """Import a policy, a function, or something with a method ``predict``.

    Modules in the current directory are found, too.

    Raises
    ------
    InvalidInputError
        If the module cannot be imported, or what it holds under this name is none of these.
    UnknownNameError
        If it holds nothing under this name.
    """
    module_name, _, attribute = name.partition(":")
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    import_module("kinarm.envs")  # the module may make one by its id
    try:
        module = import_module(module_name)
    except Exception as error:  # a module can raise anything
        raise InvalidInputError(
            f"cannot import {module_name!r} of policy {name!r}: {first_line(error)}"
        ) from error
    if not hasattr(module, attribute):
        offered = (key for key, each in vars(module).items() if _chooses(each) and key[0] != "_")
        raise UnknownNameError(f"name in module {module_name}:", attribute, offered)
    found = getattr(module, attribute)
    return found if isinstance(found, Policy) else policy_function(found, name)


def policy_function(policy: Any, name: str) -> PolicyFunction:
    """What chooses actions as a function of observations, shape (n, n_observations).

    Raises
    ------
    InvalidInputError
        If it is neither a function nor has a method ``predict``.
    """
    predict = getattr(policy, "predict", None)
    if callable(predict) and not inspect.isclass(policy):
        settings = {"deterministic": True} if _takes(predict, "deterministic") else {}
        return partial(_predicted_actions, partial(predict, **settings))
    if not callable(policy) or inspect.isclass(policy):
        raise InvalidInputError(
            f"{name!r} is neither a function of observations nor has a method predict: "
            f"it is {policy!r}"
        )
    function: PolicyFunction = policy
    return function


def _predicted_actions(predict: Callable[..., Any], observations: NDArray[np.float64]) -> ArrayLike:
    """Actions alone, if there is a state beside them."""
    answer = predict(observations)
    actions: ArrayLike = answer[0] if isinstance(answer, tuple) else answer
    return actions


def _takes(function: Callable[..., Any], option: str) -> bool:
    """Whether a function has an option."""
    try:
        return option in inspect.signature(function).parameters
    except (TypeError, ValueError):
        return False


def _chooses(value: object) -> bool:
    """Whether something could be a policy."""
    return callable(getattr(value, "predict", None)) or inspect.isfunction(value)
