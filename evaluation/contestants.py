"""Who takes part in an evaluation: trained policies and baselines."""

import inspect
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._files import first_line
from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError, UnknownNameError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.trials import TrialSet, trial_generator
from kinarm.networks import Networks
from kinarm.observation import observation_size
from kinarm.policies.conversion.sb3_inputs import find_vec_normalize
from kinarm.policies.library import policy_files
from kinarm.policies.policy import Policy
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.rollouts import Rollouts
from kinarm.simulator import PolicyFunction

IMPORT_PATH = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


class Predictor(Protocol):
    """Something that chooses actions as models of Stable-Baselines3 do."""

    @property
    def predict(self) -> Callable[..., Any]:
        """From observations, shape (n, n_observations), to actions, or to actions and a state."""


class Run(Protocol):
    """Runs all trials of a set, and keeps the configurations visited if that is asked for."""

    def __call__(self, trials: TrialSet, *, record: bool = False) -> Rollouts:
        """Return what happened."""


@dataclass(frozen=True, eq=False)
class Contestant:
    """Something that can be put to the trials.

    Attributes
    ----------
    name : str
        Name in tables.
    run : callable
        Runs all trials of a set.
    algorithm, recipe : str
        How it was made.
    seed : int or None
        Training seed.
    policy : Policy or None
        The trained policy, if it is one.
    source : Path or None
        The file that it was read from, if it was.
    """

    name: str
    run: Run
    algorithm: str
    recipe: str
    seed: int | None = None
    policy: Policy | None = None
    source: Path | None = None

    @property
    def note(self) -> str:
        """A remark in one line, such as the statistics in use; empty if there is none."""
        statistics = self.policy and self.policy.provenance.config.get("vec_normalize")
        return f"{self.name}: observations normalised by {statistics}" if statistics else ""

    @property
    def problem(self) -> ReachProblem | None:
        """The problem that it was trained for, if it was."""
        return self.policy.problem if self.policy else None

    def serves(
        self,
        problem: ReachProblem,
        change: Callable[[ReachProblem], ReachProblem] = lambda trained_for: trained_for,
    ) -> bool:
        """Whether it was made for a problem.

        What was not trained is for every problem. A policy with a mirror learnt the goals of one
        side, so it is for each side alone, too.

        Parameters
        ----------
        problem : ReachProblem
            What it is to face.
        change : callable
            Makes the changes to the problem that it was trained for which make no difference.
        """
        if self.policy is None:
            return True
        trained_for = change(self.policy.problem)
        if self.policy.mirror is not None:
            return trained_for.covers(problem)
        return trained_for.digest == problem.digest

    def check(self, arm: Arm, *, allow_other_arm: bool = False) -> None:
        """See that the policy, if there is one, can drive an arm.

        Parameters
        ----------
        arm : Arm
            The arm.
        allow_other_arm : bool
            Whether it may face an arm that it was not trained for.

        Raises
        ------
        PolicyFileError
            If it was trained for another one, or does not fit it.
        """
        if self.policy is None:
            return
        if not allow_other_arm:
            self.policy.check_arm(arm)
        widths = (self.policy.n_observations, self.policy.n_actions)
        expected = (observation_size(arm.n_joints), arm.n_actuated)
        if widths != expected:
            raise PolicyFileError(
                "policy {!r} maps {} observations to {} actions; arm {!r} has {} and {}".format(
                    self.name, *widths, arm.name, *expected
                )
            )

    def __repr__(self) -> str:
        trained = f" for {self.problem.name}" if self.problem else ""
        source = f", {str(self.source)!r}" if self.source else ""
        return f"Contestant({self.name!r}: {self.algorithm} {self.recipe}{trained}{source})"

    @classmethod
    def from_policy(cls, name: str, policy: Policy, source: Path | None = None) -> "Contestant":
        """Enter a trained policy.

        Parameters
        ----------
        name : str
            Name in tables.
        policy : Policy
            The policy.
        source : Path, optional
            The file that it was read from.
        """
        made = policy.provenance
        return cls(
            name=name,
            run=_running(policy),
            algorithm=made.algorithm,
            recipe=made.recipe,
            seed=made.seed,
            policy=policy,
            source=source,
        )

    @classmethod
    def from_function(cls, name: str, function: PolicyFunction) -> "Contestant":
        """Enter a function from observations (n, n_observations) to actions (n, n_actions)."""
        return cls(name, _running(function), algorithm="function", recipe="")


def _running(policy: Policy | PolicyFunction) -> Run:
    """Run something that chooses actions."""

    def run(trials: TrialSet, *, record: bool = False) -> Rollouts:
        return trials.simulator.rollout(policy, trials.starts, trials.goals, record=record)

    return run


def _run_zero(trials: TrialSet, *, record: bool = False) -> Rollouts:
    simulator = trials.simulator
    still = Networks.linear(
        np.zeros((1, simulator.n_actions, simulator.n_observations)),
        np.zeros((1, simulator.n_actions)),
    )
    return simulator.rollout(still, trials.starts, trials.goals, record=record)


def _run_random(trials: TrialSet, *, record: bool = False) -> Rollouts:
    simulator = trials.simulator
    shape = (simulator.task.horizon, simulator.n_actions)
    generators = [trial_generator(trials.seed, trial, stream=1) for trial in range(len(trials))]
    actions = np.array([generator.uniform(-1, 1, shape) for generator in generators])
    return simulator.rollout_actions(actions, trials.starts, trials.goals, record=record)


def _run_oracle(trials: TrialSet, *, record: bool = False) -> Rollouts:
    actions = oracle_bounds(trials).actions
    return trials.simulator.rollout_actions(actions, trials.starts, trials.goals, record=record)


BASELINES = {
    "random": Contestant("random", _run_random, "baseline", "random"),
    "zero": Contestant("zero", _run_zero, "baseline", "zero"),
}
"""Uniformly random actions, and no motion at all."""

ORACLE = Contestant("oracle", _run_oracle, "oracle", "oracle")
"""The motions that the oracle found, replayed."""

UNTRAINED = {**BASELINES, ORACLE.name: ORACLE}


def find_contestants(
    name_or_file: str | Path, problem: ProblemLike | None = None
) -> tuple[Contestant, ...]:
    """Find what a name stands for.

    Parameters
    ----------
    name_or_file : str or Path
        A baseline, ``"oracle"``, a shipped policy, a group of them (all training seeds),
        ``"best"``, a policy file, a folder of them, a model of Stable-Baselines3 (.zip) or
        ``"module:function"``. A model and a module run code: open only those that you trust.
    problem : ReachProblem, str or Path, optional
        What a model is for, as its file does not say, or the best shipped policy; others say it
        themselves.

    Raises
    ------
    UnknownNameError
        If it is none of these.
    PolicyFileError
        If a file cannot be used.
    InvalidInputError
        If a model cannot be converted or its problem is not given, a module cannot be imported,
        or no policy ships for the problem.
    """
    text = str(name_or_file)
    if text in UNTRAINED:
        return (UNTRAINED[text],)
    if text.endswith(".zip"):
        return (_model_contestant(Path(text), problem),)
    if is_import_path(text):
        return (_imported_contestant(text),)
    try:
        paths = policy_files(name_or_file, problem)
    except UnknownNameError as error:
        available = (*UNTRAINED, *error.available, "path/to/model.zip", "module:function")
        raise UnknownNameError(error.kind, error.given, available) from None
    return tuple(
        Contestant.from_policy(path.stem, Policy.load(path), path.resolve()) for path in paths
    )


def _model_contestant(path: Path, problem: ProblemLike | None) -> Contestant:
    """A model of Stable-Baselines3, with the statistics that lie beside it."""
    try:
        policy = Policy.from_sb3(path, problem, find_vec_normalize(path))
    except InvalidInputError as error:
        raise InvalidInputError(f"{str(path)!r}: {error}") from error
    return Contestant.from_policy(path.stem, policy, path.resolve())


def _imported_contestant(name: str) -> Contestant:
    """A policy, or a function, of a module."""
    found = imported_policy(name)
    if isinstance(found, Policy):
        return Contestant.from_policy(name, found)
    return Contestant.from_function(name, found)


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
    """A policy as a function of observations, shape (n, n_observations).

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
