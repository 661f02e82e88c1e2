"""How often 95 % intervals cover the truth: ``python -m docs.measurements.intervals``, ten minutes.

The tables of *Statistics*. A trial succeeds with the probability 1 / (1 + exp(-(m + a + b))): a
differs from training to training and b from trial to trial, both normal. All seeds face the same
trials. The truth is the mean over all trainings and trials.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import expit, roots_hermitenorm

from kinarm.evaluation.estimates import estimate_metrics
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.report.templating import markdown_table
from kinarm.evaluation.statistics import Estimate, share_difference, share_over_seeds

TRIALS = (50, 200, 1000, 4000)
TRUTHS = (0.5, 0.9, 0.97, 0.994, 0.999)
PAIRS = ((0.5, 0.45), (0.97, 0.9), (0.97, 0.97), (0.994, 0.97), (0.999, 0.994))
SPREADS = {"alike": 0.0, "some": 0.5, "much": 1.0}
"""Standard deviations of a: most trainings have 97 %, or 92 to 99 %, or 81 to 99.6 %."""
TRIAL_SPREADS = (0.0, 1.0, 3.0)
"""Standard deviations of b: with the last one, most trials nearly always end alike."""
FAILING = 0.03
"""Share of trials that end far away."""

Hits = NDArray[np.bool_]
Draw = Callable[[np.random.Generator], Estimate]


def level_of(truth: float, *spreads: float) -> float:
    """The m with which the mean success is the truth."""
    places, weights = roots_hermitenorm(80)
    each, shares = np.linalg.norm(spreads) * places, weights / weights.sum()
    return float(brentq(lambda m: shares @ expit(m + each) - truth, -5, 60))


def faced(
    rng: np.random.Generator, seeds: int, level: float, spread: float, ease: NDArray[np.float32]
) -> Hits:
    """Which trials succeed, shape (seeds, trials), given how easy each of them is."""
    levels = level + spread * rng.standard_normal((seeds, 1), dtype=np.float32)
    chances = expit((levels + ease).astype(np.float32))
    return np.asarray(rng.random(chances.shape, dtype=np.float32) < chances)


def success(
    rng: np.random.Generator, seeds: int, trials: int, level: float, spread: float, easy: float
) -> Estimate:
    """The share of one recipe."""
    ease = easy * rng.standard_normal(trials, dtype=np.float32)
    return share_over_seeds(faced(rng, seeds, level, spread, ease))


def difference(
    rng: np.random.Generator, seeds: int, trials: int, levels: Sequence[float], spread: float
) -> Estimate:
    """One recipe less another; a part of what makes a trial easy is their own."""
    shared, *own = rng.standard_normal((3, trials), dtype=np.float32)
    sides = zip(levels, own, strict=True)
    hits = [faced(rng, seeds, level, spread, 2 * shared + each) for level, each in sides]
    return share_difference(*hits)


def one_bad(rng: np.random.Generator, seeds: int, trials: int) -> Estimate:
    """A recipe of which one training in ten comes to 10 % instead of 97 %."""
    shares = np.where(rng.random((seeds, 1)) < 0.1, 0.1, 0.97)
    return share_over_seeds(rng.random((seeds, trials)) < shares)


def mean_distance(rng: np.random.Generator, trials: int) -> Estimate:
    """Mean distance of one seed: few trials end far away."""
    near, far = rng.uniform(0.02, 0.05, trials), rng.uniform(0.1, 0.6, trials)
    distance = np.where(rng.random(trials) < FAILING, far, near)
    none, unknown = np.zeros(trials, bool), np.zeros(0)
    ended = {"success": distance <= 0.05, "collision": none, "steps": none, "returns": none}
    more = dict.fromkeys(("turn", "goals_reached", "interventions"), unknown)
    did = SimpleNamespace(distance=distance, **ended, **more)
    return estimate_metrics(Outcomes((did,)))["mean_distance"]


def coverage(draw: Draw, truth: float, times: int) -> tuple[float, float]:
    """Share of intervals that hold the truth [%], and their mean width."""
    rng = np.random.default_rng(0)
    ends = np.array([draw(rng).ci95 for _ in range(times)])
    held = (ends[:, 0] <= truth) & (truth <= ends[:, 1])
    return 100 * float(held.mean()), float(np.diff(ends).mean())


def cell(found: Sequence[tuple[float, float]]) -> str:
    """The lowest and the highest coverage, and the mean width."""
    shares, widths = zip(*found, strict=True)
    ends = dict.fromkeys(f"{end(shares):.0f}" for end in (min, max))
    return f"{'..'.join(ends)} ({np.mean(widths):.2g})"


def recipes(times: int) -> Iterator[tuple[str, ...]]:
    """Coverage of a share's interval by truth; a row for seeds, spread and trials."""
    for seeds, (name, spread), trials in product((1, 2, 4, 10), SPREADS.items(), TRIALS):
        if seeds > 1 or not spread:
            cells = []
            for truth in TRUTHS:
                draws = [
                    partial(
                        success,
                        seeds=seeds,
                        trials=trials,
                        level=level_of(truth, spread, easy),
                        spread=spread,
                        easy=easy,
                    )
                    for easy in TRIAL_SPREADS
                ]
                cells.append(cell([coverage(draw, truth, times) for draw in draws]))
            yield f"{seeds}", name if seeds > 1 else "", f"{trials}", *cells


def pairs(times: int) -> Iterator[tuple[str, ...]]:
    """Coverage of a difference's interval by truths; a row for seeds and trials."""
    for seeds, trials in product((1, 4, 10), TRIALS[:3]):
        cells = []
        for truths in PAIRS:
            found = []
            for spread in SPREADS.values() if seeds > 1 else (0.0,):
                levels = [level_of(truth, spread, 2, 1) for truth in truths]
                draw = partial(difference, seeds=seeds, trials=trials, levels=levels, spread=spread)
                found.append(coverage(draw, truths[0] - truths[1], times))
            cells.append(cell(found))
        yield f"{seeds}", f"{trials}", *cells


def others(times: int) -> Iterator[tuple[str, ...]]:
    """Coverage where much hangs on what is rare."""
    mean, bad = (1 - FAILING) * 0.035 + FAILING * 0.35, 0.9 * 0.97 + 0.1 * 0.1
    yield (
        "mean distance, 3 % of trials fail",
        *(
            cell([coverage(partial(mean_distance, trials=trials), mean, times // 2)])
            for trials in TRIALS[:3]
        ),
    )
    for seeds in (4, 10):
        draws = [partial(one_bad, seeds=seeds, trials=trials) for trials in TRIALS[:3]]
        cells = [cell([coverage(draw, bad, times)]) for draw in draws]
        yield f"success, one training in ten is bad, {seeds} seeds", *cells


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--times", type=int, default=1000, help="experiments for a figure (1000)")
    times = parser.parse_args().times
    truths = [f"{truth:g}" for truth in TRUTHS]
    print(markdown_table(["seeds", "trainings", "trials", *truths], recipes(times)))
    less = [f"{first:g} less {second:g}" for first, second in PAIRS]
    print(markdown_table(["seeds", "trials", *less], pairs(times)))
    counts = [f"{trials} trials" for trials in TRIALS[:3]]
    print(markdown_table(["", *counts], others(times)))


if __name__ == "__main__":
    main()
