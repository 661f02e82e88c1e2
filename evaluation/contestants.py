"""Contestants of an evaluation: trained policies and baselines."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from kinarm.arm import Arm
from kinarm.episodes import Rollouts
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.outcomes import Holding
from kinarm.evaluation.predictors import Actor, Wrapper, run_remembering, run_wrapped
from kinarm.evaluation.trials import TrialSet, trial_generator
from kinarm.networks import PolicyFunction
from kinarm.observation_layout import ObservationLayout, observation_layout
from kinarm.plant import Plant
from kinarm.policies.library import group_of
from kinarm.policies.policy import Policy
from kinarm.policies.provenance import normalization_remark
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.task import NEVER

SHIELDED = "+shield"
"""What the name of a shielded contestant has more."""


def bare_name(name: str) -> str:
    """The name of a contestant without its shield."""
    return name.replace(SHIELDED, "", 1)


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
    rollout : callable
        Runs a set of trials, without a shield of its own; with ``record``, it
        keeps the configurations visited.
    algorithm, recipe, seed : str, str, int or None
        How it was made, and its training seed.
    policy, source : Policy or None, Path or None
        The trained policy, if it is one, and its file.
    actor : Actor, optional
        What chooses its actions in Python, to run in a wrapper.
    remarks : tuple of str
        What its figures assume: a wrapper, statistics of observations.
    has_shield, wrapped : bool
        Whether steps that would touch are replaced, and whether it runs in a
        wrapper.
    """

    name: str
    rollout: Callable[..., Rollouts]
    algorithm: str
    recipe: str
    seed: int | None = None
    policy: Policy | None = None
    source: Path | None = None
    actor: Actor | None = None
    remarks: tuple[str, ...] = ()
    has_shield: bool = False
    wrapped: bool = False

    def run(self, trials: TrialSet, *, record: bool = False) -> Rollouts:
        """Run trials, behind its shield if it has one; ``record`` keeps the paths."""
        if self.has_shield:
            trials = replace(trials, simulator=trials.simulator.shielded())
        return self.rollout(trials, record=record)

    def shielded(self) -> "Contestant":
        """The same behind a shield (``kinarm.kernels.shield``), under a name of its own.

        The oracle stays as it is: its motions touch nothing.
        """
        if self.has_shield or self is ORACLE:
            return self
        group = group_of(self.name)
        name = f"{group}{SHIELDED}{self.name.removeprefix(group)}"
        return replace(self, name=name, has_shield=True)

    def bare(self) -> "Contestant":
        """A policy that learnt behind a shield without it; what others are called stays."""
        if self.policy is None or not self.policy.shield:
            return self
        return replace(self, name=bare_name(self.name), has_shield=False)

    @property
    def note(self) -> str:
        """A remark in one line, such as the statistics in use; empty if there is none."""
        config = self.policy.provenance.config if self.policy else {}
        remarks = [*filter(None, [normalization_remark(config), *self.remarks])]
        return f"{self.name}: {'; '.join(remarks)}" if remarks else ""

    def note_on(self, problem: ReachProblem) -> str:
        """The note, and how training tested steps for contact if it was not as in a problem."""
        faced = problem.stepping.tested_configurations
        trained = self.policy.problem.stepping.tested_configurations if self.policy else faced
        where = f"at {trained} configurations" if trained else "throughout"
        assumed = "" if trained == faced else f"training tested steps for contact {where}"
        return "; ".join(filter(None, [self.note, assumed]))

    @property
    def problem(self) -> ReachProblem | None:
        """The problem that it was trained for, if any; of the paper's, as steps are tested now."""
        if self.policy is None:
            return None
        trained_for = self.policy.problem
        now = PROBLEMS.get(trained_for.name, trained_for)
        return now if trained_for.faced_as(now).digest == now.digest else trained_for

    def serves(
        self,
        problem: ReachProblem,
        change: Callable[[ReachProblem], ReachProblem] = lambda trained_for: trained_for,
    ) -> bool:
        """Whether it was made for a problem.

        What was not trained is for every problem. A policy with a mirror learnt one side, so it is
        for each side alone, too. ``change`` is made to the problem that it was trained for. How
        steps are tested for contact does not matter.
        """
        if self.policy is None:
            return True
        trained_for = change(self.policy.problem).faced_as(problem)
        if self.policy.mirror is not None:
            return trained_for.covers(problem)
        return trained_for.digest == problem.digest

    def check(self, problem: ReachProblem, arm: Arm, *, allow_other_arm: bool = False) -> None:
        """Check that the policy, if any, fits a problem's observation and arm, which it knows."""
        if self.policy is None:
            return
        if not allow_other_arm:
            self.policy.check_arm(arm)
        if self.wrapped:
            return
        seen = problem.replace(observation=self.policy.observation)
        own, shown = map(observation_layout, (self.policy.problem, seen))
        if own != shown:
            raise PolicyFileError(
                f"policy {self.name!r} sees other observations, {own!r}, than problem "
                f"{problem.name!r} shows, {shown!r}"
            )
        widths = (self.policy.n_observations, self.policy.n_actions)
        expected = (ObservationLayout.of(seen, arm).size, arm.n_actuated)
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
        made, bare = policy.provenance, replace(policy, shield=False)
        entered = cls(
            name,
            partial(_run, bare),
            made.algorithm,
            made.recipe,
            made.seed,
            policy,
            source,
            actor=Actor(bare),
        )
        if policy.shield and SHIELDED in name:  # as its file is called
            return replace(entered, has_shield=True)
        return entered.shielded() if policy.shield else entered

    @classmethod
    def from_function(cls, name: str, function: "PolicyFunction | Predictor") -> "Contestant":
        """Enter a function from observations (n, n_observations) to actions (n, n_actions)."""
        if inspect.isclass(function) or not (callable(function) or hasattr(function, "predict")):
            raise InvalidInputError(
                f"{name!r} is neither a function of observations nor has a method predict: "
                f"it is {function!r}"
            )
        statistics = getattr(function, "get_vec_normalize_env", lambda: None)()
        origin = "VecNormalize of its environment" if statistics is not None else None
        remark = normalization_remark({"vec_normalize": origin})
        actor = Actor(function, statistics)
        return cls.from_actor(name, actor, algorithm="function", remarks=(remark,))

    @classmethod
    def from_actor(cls, name: str, actor: Actor, **about: Any) -> "Contestant":
        """Enter what chooses actions in Python; ``about`` are further attributes."""
        plain = actor.statistics is None and not hasattr(actor.policy, "predict")
        run = partial(_run, actor.policy) if plain else partial(run_remembering, actor)
        return cls(name, run, **{"recipe": "", "actor": actor, **about})

    def in_wrapper(self, wrapper: Wrapper, name: str) -> "Contestant":
        """The same policy in a wrapper, with its name; baselines need none."""
        if self.actor is None:
            return self
        remarks = (*self.remarks, f"in wrapper {name}")
        rollout = partial(run_wrapped, self.actor, wrapper)
        return replace(self, rollout=rollout, remarks=remarks, wrapped=True)


def _run(actor: Policy | PolicyFunction, trials: TrialSet, *, record: bool = False) -> Rollouts:
    return trials.simulator.rollout(actor, trials.starts, trials.goals, record=record)


def _run_zero(trials: TrialSet, *, record: bool = False) -> Rollouts:
    still = np.zeros((len(trials), trials.simulator.task.horizon, trials.simulator.n_actions))
    return trials.simulator.rollout_actions(still, trials.starts, trials.goals, record=record)


def _run_random(trials: TrialSet, *, record: bool = False) -> Rollouts:
    simulator = trials.simulator
    shape = (simulator.task.horizon, simulator.n_actions)
    generators = [trial_generator(trials.seed, trial, stream=1) for trial in range(len(trials))]
    actions = np.array([generator.uniform(-1, 1, shape) for generator in generators])
    return simulator.rollout_actions(actions, trials.starts, trials.goals, record=record)


def _run_oracle(
    trials: TrialSet, *, record: bool = False, aimed: TrialSet | None = None
) -> Rollouts:
    """The oracle's motions, perhaps those that it found for nearer goals."""
    actions, ideal = oracle_bounds(aimed or trials).actions, trials.simulator.with_plant(Plant())
    return ideal.rollout_actions(actions, trials.starts, trials.goals, record=record)


BASELINES = {
    "random": Contestant("random", _run_random, "baseline", "random"),
    "zero": Contestant("zero", _run_zero, "baseline", "zero"),
}
"""Uniformly random actions, and no motion at all."""

ORACLE = Contestant("oracle", _run_oracle, "oracle", "oracle")
"""The motions that the oracle found, replayed with joints that obey at once."""

UNTRAINED = {**BASELINES, ORACLE.name: ORACLE}


def measure_holding(contestant: Contestant, trials: TrialSet) -> Holding:
    """Run trials that success does not end, at first goals; the oracle aims at `AIM` there."""
    endless = replace(trials, simulator=trials.simulator.changed(tolerance=NEVER))
    if contestant is ORACLE:
        nearer = min(AIM, trials.problem.task.tolerance)
        aim = trials.simulator.changed(tolerance=nearer, goal={"sequence": 1})
        aimed = replace(trials, simulator=aim)
        rollouts = _run_oracle(endless, record=True, aimed=aimed)
    else:
        rollouts = contestant.run(endless, record=True)
    return Holding.of(rollouts, trials)
