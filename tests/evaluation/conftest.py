"""Trained policies, evaluations of them, and bounds of trials."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from trial_bounds import draw

from kinarm.evaluation.bounds import oracle_bounds
from kinarm.evaluation.contestants import BASELINES, Contestant
from kinarm.evaluation.evaluation import Evaluation, run_trials
from kinarm.evaluation.trials import TrialSet
from kinarm.policies import Policy, recipe, train_policy
from kinarm.policies.oracle import Oracle, OracleSolutions


@pytest.fixture(scope="session")
def skilled() -> Policy:
    """A policy for ``right`` that succeeds, collides and times out, each in some trials."""
    return train_policy(
        recipe("ars", "tuned", problem="right", seed=1, iterations=800, episodes=1)
    ).policy


@pytest.fixture(scope="session")
def train_novice() -> Callable[..., Policy]:
    """Train a policy for a few iterations only."""

    @cache
    def train(problem: str = "right", seed: int = 0) -> Policy:
        return train_policy(recipe("ars", "tuned", problem=problem, seed=seed, iterations=4)).policy

    return train


@pytest.fixture(scope="session")
def trials() -> TrialSet:
    return TrialSet.draw("right", 60, seed=5)


@pytest.fixture(scope="session")
def skilled_evaluation(skilled: Policy, trials: TrialSet) -> Evaluation:
    return run_trials(Contestant.from_policy("skilled", skilled), trials)


@pytest.fixture(scope="session")
def evaluations(
    skilled: Policy, train_novice: Callable[..., Policy], trials: TrialSet
) -> list[Evaluation]:
    """Three training seeds of a recipe and a baseline on ``right``; one policy on ``left``."""
    left = TrialSet.draw("left", 40, seed=5)
    made = {"made-right-seed0": train_novice("right", 0), "made-right-seed1": skilled}
    made["made-right-seed2"] = train_novice("right", 2)
    settings = {**made["made-right-seed0"].provenance.config, "seed": 1}
    provenance = replace(skilled.provenance, config=settings)
    made["made-right-seed1"] = replace(skilled, provenance=provenance)
    return [
        *(
            run_trials(Contestant.from_policy(name, policy), trials)
            for name, policy in made.items()
        ),
        run_trials(BASELINES["zero"], trials),
        run_trials(Contestant.from_policy("made-left-seed0", train_novice("left")), left),
    ]


@pytest.fixture(scope="session")
def bounded(skilled_evaluation: Evaluation) -> Evaluation:
    """The skilled policy beside the oracle."""
    return replace(skilled_evaluation, bounds=oracle_bounds(skilled_evaluation.trials))


@pytest.fixture(scope="session")
def bounded_evaluations(evaluations: list[Evaluation]) -> list[Evaluation]:
    """All of them beside the oracle."""
    return [replace(each, bounds=oracle_bounds(each.trials)) for each in evaluations]


@pytest.fixture(scope="session")
def made_up(skilled_evaluation: Evaluation) -> Callable[[Sequence[float]], Evaluation]:
    """Make an evaluation with final distances of one's own choice."""

    def make(distances: Sequence[float]) -> Evaluation:
        chosen = np.resize(np.asarray(distances, dtype=float), len(skilled_evaluation.trials))
        rollouts = replace(skilled_evaluation.rollouts, distance=chosen)
        return Evaluation(skilled_evaluation.contestant, skilled_evaluation.trials, rollouts)

    return make


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty cache folder, yet to be made."""
    monkeypatch.setenv("KINARM_CACHE", str(tmp_path / "deep" / "cache"))
    return tmp_path / "deep" / "cache"


@pytest.fixture(scope="module")
def solutions() -> OracleSolutions:
    """What the oracle says of the trials that ``draw`` draws."""
    trials = draw()
    return Oracle("right").solve_batch(trials.starts, trials.goals)
