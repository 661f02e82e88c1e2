"""Contestants of an evaluation: trained policies and baselines."""

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
from kinarm.episodes import Rollouts
from kinarm.errors import InvalidInputError, PolicyFileError, UnknownNameError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.outcomes import Holding
from kinarm.evaluation.trials import TrialSet, trial_generator
from kinarm.networks import Networks
from kinarm.observation import observation_size
from kinarm.policies.library import models_in, policy_files
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import normalization_note
from kinarm.problem import ProblemLike, ReachProblem
from kinarm.simulator import PolicyFunction

NEVER = sys.float_info.min
"""A tolerance that nothing meets [m]."""

AIM = 0.005
"""How close the oracle aims where success does not end trials [m]."""


class Predictor(Protocol):
    """What chooses actions as models of Stable-Baselines3 do."""

    @property
    def predict(self) -> Callable[..., Any]:
        """From observations, (n, n_observations), to actions, perhaps with a state."""


@dataclass(frozen=True, eq=False)
class Contestant:
    """Something that can face trials.

    Attributes
    ----------
    name : str
        Name in tables.
    run : callable
        Runs a set of trials; with ``record``, it keeps the configurations
        visited.
    algorithm, recipe, seed : str, str, int or None
        How it was made, and its training seed.
    policy, source : Policy or None, Path or None
        The trained policy, if it is one, and its file.
    best_for : tuple of ReachProblem
        What it was chosen for as the best shipped policy.
    """

    name: str
    run: Callable[..., Rollouts]
    algorithm: str
    recipe: str
    seed: int | None = None
    policy: Policy | None = None
    source: Path | None = None
    best_for: tuple[ReachProblem, ...] = ()

    @property
    def note(self) -> str:
        """A remark in one line, such as the statistics in use; empty if there is none."""
        return normalization_note(self.name, self.policy.provenance.config) if self.policy else ""

    @property
    def problem(self) -> ReachProblem | None:
        """The problem that it was trained for, if any."""
        return self.policy.problem if self.policy else None

    def serves(
        self,
        problem: ReachProblem,
        change: Callable[[ReachProblem], ReachProblem] = lambda trained_for: trained_for,
    ) -> bool:
        """Whether it was made for a problem.

        What was not trained is for every problem. A policy with a mirror learnt one side, so it is
        for each side alone, too. ``change`` is made to the problem that it was trained for.
        """
        if self.policy is None:
            return True
        trained_for = change(self.policy.problem)
        if self.policy.mirror is not None:
            return trained_for.covers(problem)
        return trained_for.digest == problem.digest

    def check(self, arm: Arm, *, allow_other_arm: bool = False) -> None:
        """Check that the policy, if any, fits an arm and was trained for it."""
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
        name, policy : str, Policy
            Name in tables, and the policy.
        source : Path, optional
            The file that it was read from.
        """
        made = policy.provenance
        return cls(
            name, partial(_run, policy), made.algorithm, made.recipe, made.seed, policy, source
        )

    @classmethod
    def from_function(cls, name: str, function: PolicyFunction) -> "Contestant":
        """Enter a function from observations (n, n_observations) to actions (n, n_actions)."""
        return cls(name, partial(_run, function), algorithm="function", recipe="")


def _run(actor: Policy | PolicyFunction, trials: TrialSet, *, record: bool = False) -> Rollouts:
    return trials.simulator.rollout(actor, trials.starts, trials.goals, record=record)


def _run_zero(trials: TrialSet, *, record: bool = False) -> Rollouts:
    still = np.zeros((1, trials.simulator.n_actions, trials.simulator.n_observations))
    network = Networks.linear(still, np.zeros(still.shape[:2]))
    return trials.simulator.rollout(network, trials.starts, trials.goals, record=record)


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


def measure_holding(contestant: Contestant, trials: TrialSet) -> Holding:
    """Run trials that success does not end; the oracle aims at `AIM` there."""
    endless = trials.with_tolerance(NEVER)
    if contestant is ORACLE:
        aimed = trials.with_tolerance(min(AIM, trials.problem.task.tolerance))
        actions = oracle_bounds(aimed).actions
        scenarios = (endless.starts, endless.goals)
        rollouts = endless.simulator.rollout_actions(actions, *scenarios, record=True)
    else:
        rollouts = contestant.run(endless, record=True)
    return Holding.of(rollouts, trials)


def find_contestants(
    name_or_file: str | Path,
    problem: ProblemLike | None = None,
    vec_normalize: str | Path | None = None,
) -> tuple[Contestant, ...]:
    """Find what a name stands for.

    Parameters
    ----------
    name_or_file : str or Path
        A baseline, ``"oracle"``, a shipped policy, a group of them (all
        training seeds), ``"best"``, a policy file, a model of Stable-Baselines3
        (.zip), a folder of either, or ``"module:function"``. A model and a
        module run code: open only those that you trust.
    problem : ReachProblem, str or Path, optional
        What a model is for, as its file does not say, or the best shipped
        policy; others say it themselves.
    vec_normalize : str or Path, optional
        Statistics of a model's observations; see `Policy.from_sb3`.
    """
    text = str(name_or_file)
    if text in UNTRAINED:
        return (UNTRAINED[text],)
    models = [Path(text)] if text.endswith(".zip") else models_in(Path(text))
    if models:
        return tuple(_model_contestant(path, problem, vec_normalize) for path in models)
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


def contestant_of(
    policy: str | Path | Policy | Contestant | PolicyFunction | Predictor,
    problem: ProblemLike | None,
) -> Contestant:
    """Enter a policy, the first of a name or file, or a function."""
    if isinstance(policy, Contestant):
        return policy
    if isinstance(policy, Policy):
        made = policy.provenance
        return Contestant.from_policy(
            f"{made.algorithm}-{made.recipe}-{policy.problem.name}", policy
        )
    if isinstance(policy, str | Path):
        return find_contestants(policy, problem)[0]
    name = getattr(policy, "__name__", None) or type(policy).__name__
    return Contestant.from_function(name, policy_function(policy, name))


def _model_contestant(
    path: Path, problem: ProblemLike | None, vec_normalize: str | Path | None
) -> Contestant:
    """A model of Stable-Baselines3."""
    try:
        policy = Policy.from_sb3(path, problem, vec_normalize)
    except InvalidInputError as error:
        raise InvalidInputError(f"{str(path)!r}: {error}") from error
    return Contestant.from_policy(path.stem, policy, path.resolve())


def is_import_path(text: str) -> bool:
    """Whether a text has the form ``module:function``."""
    return re.fullmatch(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*", text) is not None


def _imported_contestant(name: str) -> Contestant:
    """A policy or function of a module, perhaps in the current directory."""
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
        offered = (
            key
            for key, each in vars(module).items()
            if key[0] != "_" and (hasattr(each, "predict") or inspect.isfunction(each))
        )
        raise UnknownNameError(f"name in module {module_name}:", attribute, offered)
    found = getattr(module, attribute)
    if isinstance(found, Policy):
        return Contestant.from_policy(name, found)
    return Contestant.from_function(name, policy_function(found, name))


def policy_function(policy: Any, name: str) -> PolicyFunction:
    """The function of observations, (n, n_observations), itself or as ``predict``."""
    if inspect.isclass(policy) or not (callable(policy) or hasattr(policy, "predict")):
        raise InvalidInputError(
            f"{name!r} is neither a function of observations nor has a method predict: "
            f"it is {policy!r}"
        )
    predict = getattr(policy, "predict", None)
    if predict is None:
        function: PolicyFunction = policy
        return function
    known = inspect.signature(predict).parameters
    options = {"deterministic": True} if "deterministic" in known else {}

    def actions(observations: NDArray[np.float64]) -> ArrayLike:
        answer = predict(observations, **options)
        chosen: ArrayLike = answer[0] if isinstance(answer, tuple) else answer
        return chosen

    return actions
