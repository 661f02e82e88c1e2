"""The paper's claims, and whether they hold here."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.paper.results import (
    LEARNERS,
    LITERAL,
    NEAR,
    PaperResults,
    PaperRun,
    Reading,
    final_distances,
)
from kinarm.evaluation.statistics import (
    Estimate,
    contrast,
    mean_share,
    share_over_seeds,
    superiority,
)
from kinarm.problem import PROBLEMS

Verdict = Literal["holds", "does not hold", "undecided", "not judged"]

LEARNING_LEVELS = (
    *((0.2, 0.25), (0.2, 0.5), (0.2, 0.75)),
    *((0.1, 0.25), (0.1, 0.5)),
    *((0.05, 0.25), (0.05, 0.5)),
)
"""Distances [m] and shares of trials that measure the speed of learning."""


@dataclass(frozen=True)
class ClaimPart:
    """A statistic that a claim puts on one side of a threshold."""

    measure: str
    estimate: Estimate
    claimed: Literal["above", "below"]
    threshold: float

    @property
    def verdict(self) -> Verdict:
        """Whether the interval lies on the claimed side, the other one, or both."""
        low, high = self.estimate.ci95 or (self.threshold, self.threshold)
        if low <= self.threshold <= high:
            return "undecided"
        side = "above" if low > self.threshold else "below"
        return "holds" if side == self.claimed else "does not hold"


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
        Its meaning in numbers; all parts have to hold.
    judged : bool
        Whether the trainings are long enough to judge it.
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


def assess(results: PaperResults, reading: Reading = LITERAL) -> tuple[Claim, ...]:
    """All claims that can be judged under a reading; the sweep is in the literal one."""
    claims = [
        *(_mostly_near(results, reading, task) for task in ("left", "right")),
        _both_is_worse(results, reading),
        _one_bench_is_poor(results, reading),
    ]
    if results.select("ppo", reading=reading):
        # Section 4: densities of PPO's final distances are shifted to the left of ARS's, and PPO
        # delivers more on task 3.
        nearer = _ars_less_ppo(results, reading, "left", "right")
        better = _ars_less_ppo(results, reading, "both")
        claims += [
            Claim("ppo-nearer", "PPO ends nearer than ARS on left and right", (nearer,)),
            Claim("ppo-both", "PPO does better than ARS on both", (better,)),
            _ars_needs_fewer_steps(results, reading),
        ]
    if reading == LITERAL:
        claims += [_low_rate_is_worse(results), *_many_perturbations_are_worse(results)]
    return tuple(replace(claim, judged=results.is_judged) for claim in claims)


def _mostly_near(results: PaperResults, reading: Reading, task: str) -> Claim:
    """Section 4: on tasks 1 and 2, most trials end within 0.2."""
    near = final_distances(results.select("ars", task, reading)) <= NEAR
    estimate = Estimate(float(near.mean(axis=1).mean()), share_over_seeds(near).ci95)
    part = ClaimPart(f"share of trials within {NEAR} m", estimate, "above", 0.5)
    return Claim(f"ars-{task}", f"ARS mostly ends within {NEAR} m on {task}", (part,))


def _both_is_worse(results: PaperResults, reading: Reading) -> Claim:
    """Section 4: task 3 is learnt less well than tasks 1 and 2."""
    part = _difference(
        "mean final distance on both, less that on left and right [m]",
        [
            (task == "both", final_distances(results.select("ars", task, reading)))
            for task in ("both", "left", "right")
        ],
    )
    return Claim("ars-both", "ARS does worse on both benches than on one", (part,))


def _one_bench_is_poor(results: PaperResults, reading: Reading) -> Claim:
    """Section 4: on task 3, a policy does well on one bench and poorly on the other."""
    near = final_distances(results.select("ars", "both", reading)) <= NEAR
    better, worse = bench_shares(near, results.trial_set("both", reading).goals[:, 1] > 0)
    label = f"share of trials within {NEAR} m on a policy's {{}} bench"
    parts = (
        ClaimPart(label.format("better"), better, "above", 0.5),
        ClaimPart(label.format("worse"), worse, "below", 0.5),
    )
    statement = "On both, ARS does well on one bench and poorly on the other"
    return Claim("ars-one-bench", statement, parts)


def bench_shares(near: NDArray[np.bool_], left: NDArray[np.bool_]) -> tuple[Estimate, Estimate]:
    """Share of hits on each policy's better and worse bench.

    Whether a trial hit, shape (n_seeds, n_trials), and its goal lies on the left, (n_trials,).
    Each half of the trials tells which bench is better, and the other measures it: picking the
    larger of two noisy shares would flatter it. Unknown where a bench has no trials in a half.
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


def _ars_less_ppo(results: PaperResults, reading: Reading, *tasks: str) -> ClaimPart:
    return _difference(
        "mean final distance of ARS, less that of PPO [m]",
        [
            (learner == "ars", final_distances(results.select(learner, task, reading)))
            for task in tasks
            for learner in LEARNERS
        ],
    )


def _ars_needs_fewer_steps(results: PaperResults, reading: Reading) -> Claim:
    """Section 4: ARS is much more sample-efficient."""
    pairs = []
    for task in PROBLEMS:
        ars = steps_to_levels(results.select("ars", task, reading))
        ppo = steps_to_levels(results.select("ppo", task, reading))
        reached = np.isfinite(ars).any(axis=1) | np.isfinite(ppo).any(axis=1)
        if reached.any():
            pairs.append((ars[reached], ppo[reached]))
    estimate = superiority(pairs) if pairs else Estimate(None)
    measure = "probability that ARS reaches a level of success in fewer environment steps than PPO"
    part = ClaimPart(measure, estimate, "above", 0.5)
    return Claim("ars-samples", "ARS needs fewer environment steps than PPO", (part,))


def steps_to_levels(runs: Iterable[PaperRun]) -> NDArray[np.float64]:
    """Steps to `LEARNING_LEVELS`, shape (n_levels, n_runs); infinity for never."""
    return np.array([[run.steps_to_level(*level) for level in LEARNING_LEVELS] for run in runs]).T


def _low_rate_is_worse(results: PaperResults) -> Claim:
    """Section 3.3: too low a learning rate may not be desirable."""
    sweep = results.sweep()
    distances = [(rate, final_distances(runs)) for (rate, _), runs in sweep.items()]
    lowest, *higher = sorted({rate for rate, _ in sweep})
    parts = tuple(
        _difference(
            f"mean final distance with rate {lowest}, less that with rate {other} [m]",
            [(rate == lowest, d) for rate, d in distances if rate in (lowest, other)],
        )
        for other in higher
    )
    return Claim("sweep-rate", "Too low a learning rate is undesirable", parts)


def _many_perturbations_are_worse(results: PaperResults) -> tuple[Claim, Claim]:
    """Section 3.3: too many perturbations may not be desirable.

    Judged after as many iterations, and after as many environment steps.
    """
    sweep = results.sweep()
    most = max(perturbations for _, perturbations in sweep)
    budget = min(run.environment_steps for runs in sweep.values() for run in runs)
    within = f", after {budget / 1e3:.0f} thousand environment steps"
    ends = [(n == most, final_distances(runs)) for (_, n), runs in sweep.items()]
    stops = [
        (n == most, np.array([run.distance_after(budget) for run in runs]))
        for (_, n), runs in sweep.items()
    ]
    measure = f"mean final distance with {most} perturbations, less that with fewer"
    after_iterations = _difference(f"{measure} [m]", ends)
    after_steps = _difference(f"{measure}{within} [m]", stops)
    statement = "Too many perturbations are undesirable, after as many"
    return (
        Claim("sweep-perturbations", f"{statement} iterations", (after_iterations,)),
        Claim("sweep-perturbations-steps", f"{statement} environment steps", (after_steps,)),
    )


def _difference(measure: str, groups: Sequence[tuple[bool, NDArray[Any]]]) -> ClaimPart:
    """Mean of the chosen groups less that of the others, claimed above zero."""
    n = sum(chosen for chosen, _ in groups)
    terms = [(1.0 / n if chosen else -1.0 / (len(groups) - n), values) for chosen, values in groups]
    return ClaimPart(measure, contrast(terms), "above", 0.0)
