"""Contestants by name: of files, models and modules; and in a wrapper."""

import inspect
import re
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from kinarm._files import first_line
from kinarm.errors import InvalidInputError, UnknownNameError
from kinarm.evaluation.contestants import SHIELDED, UNTRAINED, Contestant, Predictor, bare_name
from kinarm.evaluation.predictors import Actor, Wrapper
from kinarm.networks import PolicyFunction
from kinarm.policies.conversion.models import saved_model
from kinarm.policies.conversion.sb3 import native_statistics
from kinarm.policies.learners import look_here
from kinarm.policies.library import group_of, models_in, policy_files
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import normalization_remark
from kinarm.problem import ProblemLike

IMPORT_PATH = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")
"""The form ``module:function``."""


def find_contestants(
    name_or_file: str | Path,
    problem: ProblemLike | None = None,
    vec_normalize: str | Path | None = None,
    wrapper: str | Wrapper | None = None,
) -> tuple[Contestant, ...]:
    """Find what a name stands for.

    Parameters
    ----------
    name_or_file : str or Path
        A baseline, ``"oracle"``, a shipped policy, a group of them (all
        training seeds), a policy file, a model of Stable-Baselines3
        (.zip), a folder of either, or ``"module:function"``. A model and a
        module run code: open only those that you trust. ``+shield`` in a name
        means the same policies behind a shield.
    problem : ReachProblem, str or Path, optional
        What a model is for, as its file does not say; others say it themselves.
    vec_normalize : str or Path, optional
        Statistics of a model's observations; see
        `kinarm.policies.Policy.from_sb3`.
    wrapper : str or callable, optional
        Function from an environment to a wrapped one, or its
        ``"module:function"``: policies face the trials in it. It gets a
        `kinarm.ReachEnv`; or, if its argument is called ``venv``, a ``VecEnv``
        of Stable-Baselines3.

    Raises
    ------
    KinarmError
        If there is none, or its file or module cannot be read.
    """
    text = str(name_or_file)
    if SHIELDED in text and not Path(text).exists():
        bare = find_contestants(bare_name(text), problem, vec_normalize, wrapper)
        return tuple(each.shielded() for each in bare)
    models = [Path(text)] if text.endswith(".zip") else models_in(Path(text))
    if text in UNTRAINED:
        found: tuple[Contestant, ...] = (UNTRAINED[text],)
    elif models:
        settings, wrapped = (problem, vec_normalize), wrapper is not None
        found = tuple(_model_contestant(path, *settings, wrapped=wrapped) for path in models)
    elif IMPORT_PATH.fullmatch(text):
        found = (_entered(text, _imported(text, "policy")),)
    else:
        try:
            files = [(file.stem, Policy.load(file), file.resolve()) for file in policy_files(text)]
        except UnknownNameError as error:
            available = (*UNTRAINED, *error.available, "path/to/model.zip", "module:function")
            raise UnknownNameError(error.kind, error.given, available) from None
        found = tuple(Contestant.from_policy(*each) for each in files)
    return found if wrapper is None else tuple(_in_wrapper(each, wrapper) for each in found)


def _in_wrapper(contestant: Contestant, wrapper: str | Wrapper) -> Contestant:
    """A contestant in a wrapper: a function, or its ``module:function``."""
    function = _imported(wrapper, "wrapper") if isinstance(wrapper, str) else wrapper
    name = wrapper if isinstance(wrapper, str) else _name_of(wrapper)
    if not callable(function):
        raise InvalidInputError(f"wrapper {name!r} is no function: it is {function!r}")
    return contestant.in_wrapper(function, name)


def is_called(contestant: Contestant, text: str) -> bool:
    """Whether a name, or a file or folder, stands for a contestant, as in `find_contestants`."""
    if text in (contestant.name, group_of(contestant.name)):
        return True
    if SHIELDED in text and not Path(text).exists():
        return contestant.has_shield and is_called(contestant, bare_name(text))
    path, source = Path(text).resolve(), contestant.source
    return source is not None and path in (source, source.parent)


def _entered(name: str, policy: Policy | PolicyFunction | Predictor) -> Contestant:
    """Enter a policy, or a function, under a name."""
    if isinstance(policy, Policy):
        return Contestant.from_policy(name, policy)
    return Contestant.from_function(name, policy)


def _name_of(function: Any) -> str:
    """What a policy, a function, or an object that is used as one, is called."""
    if isinstance(function, Policy):
        made = function.provenance
        return f"{made.algorithm}-{made.recipe}-{function.problem.name}"
    return getattr(function, "__name__", None) or type(function).__name__


def check_normalizing(contestants: Iterable[Contestant], vec_normalize: str | Path | None) -> None:
    """Refuse statistics for models if no contestant is a model of Stable-Baselines3."""
    models = (each for each in contestants if each.source and each.source.suffix == ".zip")
    if vec_normalize is not None and not any(models):
        raise InvalidInputError(
            "--vec-normalize is for models of Stable-Baselines3 (.zip), and none is named"
        )


def contestant_of(
    policy: str | Path | Policy | Contestant | PolicyFunction | Predictor,
    problem: ProblemLike | None,
    wrapper: str | Wrapper | None = None,
) -> Contestant:
    """Enter a policy, the first of a name or file, or a function."""
    if isinstance(policy, str | Path):
        return find_contestants(policy, problem, wrapper=wrapper)[0]
    known = policy if isinstance(policy, Contestant) else _entered(_name_of(policy), policy)
    return known if wrapper is None else _in_wrapper(known, wrapper)


def _model_contestant(
    path: Path, problem: ProblemLike | None, vec_normalize: str | Path | None, *, wrapped: bool
) -> Contestant:
    """A model of Stable-Baselines3: converted, or as it is if it needs more."""
    try:
        model = saved_model(path)
        if not wrapped and not model.remembers:
            policy = Policy.from_sb3(model, problem, vec_normalize)
            return Contestant.from_policy(path.stem, policy, path.resolve())
        statistics, origin = native_statistics(model, problem, vec_normalize, wrapped=wrapped)
    except InvalidInputError as error:
        raise InvalidInputError(f"{str(path)!r}: {error}") from error
    return Contestant.from_actor(
        path.stem,
        Actor(model.policy, statistics),
        algorithm=model.algorithm,
        recipe="sb3",
        seed=model.attributes.get("seed"),
        source=path.resolve(),
        remarks=(normalization_remark({"vec_normalize": origin}),),
    )


def _imported(name: str, kind: str) -> Any:
    """What ``module:name`` is, perhaps of the current directory; ``kind`` is for messages."""
    if not IMPORT_PATH.fullmatch(name):
        raise InvalidInputError(f"{kind} must be module:function, got {name!r}")
    module_name, _, attribute = name.partition(":")
    look_here()
    import_module("kinarm.envs")  # the module may make one by its id
    try:
        module = import_module(module_name)
    except Exception as error:  # a module can raise anything
        raise InvalidInputError(
            f"cannot import {module_name!r} of {kind} {name!r}: {first_line(error)}"
        ) from error
    if not hasattr(module, attribute):
        offered = (
            key
            for key, each in vars(module).items()
            if key[0] != "_" and (hasattr(each, "predict") or inspect.isfunction(each))
        )
        raise UnknownNameError(f"name in module {module_name}:", attribute, offered)
    return getattr(module, attribute)
