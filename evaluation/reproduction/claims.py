"""The paper's claims, and whether they hold here."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.runs import TrainedRun
from kinarm.evaluation.reproduction.study import (
    LITERAL,
    NEAR,
    SWEEP_PERTURBATIONS,
    SWEEP_RATES,
    Purpose,
    Reading,
)
from kinarm.evaluation.statistics import Estimate, Term, contrast, mean_share, superiority

Verdict = Literal["holds", "does not hold", "undecided", "not judged"]

LEARNING_LEVELS = (
    (0.2, 0.25),
    (0.2, 0.5),
    (0.2, 0.75),
    (0.1, 0.25),
    (0.1, 0.5),
    (0.05, 0.25),
    (0.05, 0.5),
)
"""Distances [m] and shares of trials by which the speed of learning is measured."""


@dataclass(frozen=True)
class ClaimPart:
    """A statistic that a claim puts on one side of a threshold.

    Attributes
    ----------
    measure : str
        What the statistic is.
    estimate : Estimate
        The statistic and its interval.
    claimed : {"above", "below"}
        On which side of the threshold the claim puts it.
    threshold : float
        The threshold.
    """

    measure: str
    estimate: Estimate
    claimed: Literal["above", "below"]
    threshold: float

    @property
    def verdict(self) -> Verdict:
        """Where the interval lies: on the claimed side, on the other one, or on both."""
        if self.estimate.ci95 is None:
            return "undecided"
        low, high = self.estimate.ci95
        if low > self.threshold:
            return "holds" if self.claimed == "above" else "does not hold"
        if high < self.threshold:
            return "holds" if self.claimed == "below" else "does not hold"
        return "undecided"


@dataclass(frozen=True)
class Claim:
    """Something that the paper found.

    Attributes
    ----------
    name : str
        Short and unique.
    statement : str
        The finding.
    parts : tuple of ClaimPart
        What it means in numbers; all have to be so.
    judged : bool
        Whether the trainings are such that it can be judged.
    """

    name: str
    statement: str
    parts: tuple[ClaimPart, ...]
    judged: bool = True

    @property
    def verdict(self) -> Verdict:
        """It holds if all parts do, and does not if one does not."""
        if not self.judged:
            return "not judged"
        verdicts = {part.verdict for part in self.parts}
        if "does not hold" in verdicts:
            return "does not hold"
        return "holds" if verdicts == {"holds"} else "undecided"

    def to_json(self) -> dict[str, Any]:
        """As a dictionary that JSON can hold."""
        return {
            "name": self.name,
            "statement": self.statement,
            "verdict": self.verdict,
            "parts": [
                {
                    "measure": part.measure,
                    "statistic": part.estimate.value,
                    "ci95": part.estimate.ci95 and list(part.estimate.ci95),
                    "claimed": part.claimed,
                    "threshold": part.threshold,
                    "verdict": part.verdict if self.judged else self.verdict,
                }
                for part in self.parts
            ],
        }


def assess(results: Results, reading: Reading = LITERAL) -> tuple[Claim, ...]:
    """All claims that can be judged under a reading; the sweep follows the literal one."""
    claims = [
        mostly_near(results, reading, "left"),
        mostly_near(results, reading, "right"),
        both_is_worse(results, reading),
        one_bench_is_poor(results, reading),
    ]
    if results.select("ppo", reading=reading):
        claims += [
            # Section 4: densities of PPO's final distances are shifted to the left of ARS's.
            Claim(
                "ppo-nearer",
                "PPO ends nearer than ARS on left and right",
                (ars_less_ppo(results, reading, "left", "right"),),
            ),
            # Section 4: PPO delivers more on task 3.
            Claim(
                "ppo-both",
                "PPO does better than ARS on both",
                (ars_less_ppo(results, reading, "both"),),
            ),
            ars_needs_fewer_steps(results, reading),
        ]
    if reading == LITERAL:
        claims += [low_rate_is_worse(results), *many_perturbations_are_worse(results)]
    return tuple(replace(claim, judged=results.study.is_judged) for claim in claims)


def mostly_near(results: Results, reading: Reading, task: str) -> Claim:
    """Section 4: on tasks 1 and 2, most trials end within 0.2."""
    near = results.distances("ars", task, reading) <= NEAR
    estimate = mean_share(near.mean(axis=1), near.shape[1])
    part = ClaimPart(f"share of trials within {NEAR} m", estimate, "above", 0.5)
    return Claim(f"ars-{task}", f"ARS mostly ends within {NEAR} m on {task}", (part,))


def both_is_worse(results: Results, reading: Reading) -> Claim:
    """Section 4: task 3 is learnt less well than tasks 1 and 2."""
    terms = [
        Term(weight, results.distances("ars", task, reading))
        for task, weight in (("both", 1.0), ("left", -0.5), ("right", -0.5))
    ]
    part = _difference("mean final distance on both, less that on left and right [m]", terms)
    return Claim("ars-both", "ARS does worse on both benches than on one", (part,))


def one_bench_is_poor(results: Results, reading: Reading) -> Claim:
    """Section 4: on task 3, a policy does well on one bench and poorly on the other."""
    near = results.distances("ars", "both", reading) <= NEAR
    better, worse = bench_shares(near, results.trial_set("both", reading).goals[:, 1] > 0)
    label = f"share of trials within {NEAR} m on a policy's {{}} bench"
    parts = (
        ClaimPart(label.format("better"), better, "above", 0.5),
        ClaimPart(label.format("worse"), worse, "below", 0.5),
    )
    statement = "On both, ARS does well on one bench and poorly on the other"
    return Claim("ars-one-bench", statement, parts)


def bench_shares(near: NDArray[np.bool_], left: NDArray[np.bool_]) -> tuple[Estimate, Estimate]:
    """Share of hits on the better and on the worse bench of every seed's policy.

    Which bench is the better one is told by one half of the trials and measured on the other, and
    the other way round: picking the larger of two noisy shares would flatter it. Where a bench has
    no trials in one of the halves, there is nothing to tell.

    Parameters
    ----------
    near : ndarray of bool, shape (n_seeds, n_trials)
        Whether a trial hit.
    left : ndarray of bool, shape (n_trials,)
        Whether its goal lies on the left bench.
    """
    half = np.arange(near.shape[1]) % 2 == 0
    groups = [[part & bench for bench in (left, ~left)] for part in (half, ~half)]
    if not all(group.any() for part in groups for group in part):
        return Estimate(None), Estimate(None)
    shares = np.array([[[seed[g].mean() for g in part] for part in groups] for seed in near])
    order = np.argsort(-shares, axis=2, kind="stable")[:, ::-1]
    better, worse = np.moveaxis(np.take_along_axis(shares, order, axis=2).mean(axis=1), 1, 0)
    per_bench = int(min(left.sum(), (~left).sum()))
    return mean_share(better, per_bench), mean_share(worse, per_bench)


def ars_less_ppo(results: Results, reading: Reading, *tasks: str) -> ClaimPart:
    """Mean final distance of ARS, less that of PPO on the same trials."""
    weights: dict[Purpose, float] = {"ars": 1.0 / len(tasks), "ppo": -1.0 / len(tasks)}
    terms = [
        Term(weight, results.distances(learner, task, reading))
        for task in tasks
        for learner, weight in weights.items()
    ]
    return _difference("mean final distance of ARS, less that of PPO [m]", terms)


def ars_needs_fewer_steps(results: Results, reading: Reading) -> Claim:
    """Section 4: ARS is much more sample-efficient."""
    pairs = []
    for task in ("left", "right", "both"):
        ars = steps_to_levels(results.select("ars", task, reading))
        ppo = steps_to_levels(results.select("ppo", task, reading))
        reached = np.isfinite(ars).any(axis=1) | np.isfinite(ppo).any(axis=1)
        if reached.any():
            pairs.append((ars[reached], ppo[reached]))
    estimate = superiority(pairs) if pairs else Estimate(None)
    measure = "probability that ARS reaches a level of success in fewer environment steps than PPO"
    part = ClaimPart(measure, estimate, "above", 0.5)
    return Claim("ars-samples", "ARS needs fewer environment steps than PPO", (part,))


def steps_to_levels(runs: Iterable[TrainedRun]) -> NDArray[np.float64]:
    """Environment steps to `LEARNING_LEVELS`, shape (n_levels, n_runs); infinity for never."""
    return np.array([[run.steps_to_level(*level) for level in LEARNING_LEVELS] for run in runs]).T


def low_rate_is_worse(results: Results) -> Claim:
    """Section 3.3: too low a learning rate may not be desirable."""
    lowest, *higher = sorted(SWEEP_RATES)
    parts = [
        _sweep_difference(
            f"mean final distance with rate {lowest}, less that with rate {other} [m]",
            {key: runs for key, runs in results.sweep().items() if key[0] in (lowest, other)},
            lambda rate, _: rate == lowest,
        )
        for other in higher
    ]
    return Claim("sweep-rate", "Too low a learning rate is undesirable", tuple(parts))


def many_perturbations_are_worse(results: Results) -> tuple[Claim, Claim]:
    """Section 3.3: too many perturbations may not be desirable.

    Judged twice: after as many iterations, and after as many environment steps, of which more
    perturbations take more.
    """
    most = max(SWEEP_PERTURBATIONS)
    budget = min(run.environment_steps[-1] for run in results.select("sweep"))
    measure = f"mean final distance with {most} perturbations, less that with fewer"
    after_iterations = _sweep_difference(f"{measure} [m]", results.sweep(), lambda _, n: n == most)
    after_steps = _sweep_difference(
        f"{measure}, after {budget / 1e3:.0f} thousand environment steps [m]",
        results.sweep(),
        lambda _, n: n == most,
        lambda run: run.distance_after(budget),
    )
    statement = "Too many perturbations are undesirable, after as many"
    return (
        Claim("sweep-perturbations", f"{statement} iterations", (after_iterations,)),
        Claim("sweep-perturbations-steps", f"{statement} environment steps", (after_steps,)),
    )


def _sweep_difference(
    measure: str,
    settings: Mapping[tuple[float, int], Sequence[TrainedRun]],
    chosen: Callable[[float, int], bool],
    distance: Callable[[TrainedRun], NDArray[Any]] = attrgetter("distance"),
) -> ClaimPart:
    """Mean of the chosen settings, less the mean of all others."""
    n = sum(chosen(*setting) for setting in settings)
    terms = [
        Term(
            1.0 / n if chosen(*setting) else -1.0 / (len(settings) - n),
            np.array([distance(run) for run in runs]),
        )
        for setting, runs in settings.items()
    ]
    return _difference(measure, terms)


def _difference(measure: str, terms: Sequence[Term]) -> ClaimPart:
    """A difference that the claim puts above zero."""
    return ClaimPart(measure, contrast(terms), "above", 0.0)
