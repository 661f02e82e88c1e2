"""The best of the shipped policies, chosen by ``python docs/ranking.py``.

Run it after policies have been shipped, in the clone that holds them. It writes the file in which
`kinarm.policies.library.best_policy` looks the best one up. The trials have their own seed, so that
no policy is chosen by the trials that later judge it.

The seed that reaches most goals of all is partly the luckiest, and more seeds have more luck. So
recipes are compared first, by what all their seeds reach; then the seeds of the best recipe. Both
times the order is the same. The first is the one that reaches most goals. As good is what lies
within its 95 % interval: the first itself might reach no more with other trials, and as a recipe
with other seeds. A wide interval of another one does not count in its favour. Of those that are as
good, the one with the smallest step ratio is best.
"""

import json
from collections.abc import Iterable, Mapping
from importlib import resources
from typing import Any

import numpy as np

from kinarm._files import write_text
from kinarm.episodes import Rollouts
from kinarm.evaluation.bounds import MOST_BOUNDED, oracle_bounds
from kinarm.evaluation.finding import find_contestants
from kinarm.evaluation.metrics import METRICS
from kinarm.evaluation.outcomes import Outcomes
from kinarm.evaluation.statistics import share_over_seeds
from kinarm.evaluation.trials import trial_set
from kinarm.policies.library import RANKING, group_of, policy_names
from kinarm.policies.oracle import OracleSolutions
from kinarm.problem import PROBLEMS

TRIALS, SEED = 10_000, 20_161


def ranking(names: Iterable[str], trials: int = TRIALS) -> dict[str, Any]:
    """What policies reach on the problems that they are for, and which of them is best.

    Returns
    -------
    dict
        ``trials``, ``seed``; ``success`` and ``step_ratio`` of each policy by its name, by
        problem; ``best``: name of the best policy, by problem.
    """
    contestants = [each.bare() for name in names for each in find_contestants(name)]
    made: dict[str, Any] = {"success": {}, "step_ratio": {}, "best": {}}
    for name, problem in PROBLEMS.items():
        faced = trial_set(problem, trials, SEED)
        found = {each.name: each.run(faced) for each in contestants if each.serves(problem)}
        if found:
            bounds = oracle_bounds(faced.first(MOST_BOUNDED))
            made["success"][name] = {who: float(did.success.mean()) for who, did in found.items()}
            made["step_ratio"][name] = {who: step_ratio([found[who]], bounds) for who in found}
            made["best"][name] = best_of(found, bounds)
    return {"trials": trials, "seed": SEED, **made}


def best_of(found: Mapping[str, Rollouts], bounds: OracleSolutions) -> str:
    """Name of the best of some policies: of the best recipe, the best seed.

    Parameters
    ----------
    found : mapping of str to Rollouts
        What each did in the same trials, by its name.
    bounds : OracleSolutions
        Of the first trials.
    """
    recipes: dict[str, dict[str, Rollouts]] = {}
    for name, did in found.items():
        recipes.setdefault(group_of(name), {})[name] = did
    recipe = _leader({name: list(seeds.values()) for name, seeds in recipes.items()}, bounds)
    return _leader({name: [did] for name, did in recipes[recipe].items()}, bounds)


def step_ratio(seeds: list[Rollouts], bounds: OracleSolutions) -> float | None:
    """Median of steps divided by the bound, over the successes of all seeds; None without any."""
    ratio: float | None = METRICS["step_ratio"].formula(Outcomes(tuple(seeds), bounds))
    return ratio


def _leader(candidates: Mapping[str, list[Rollouts]], bounds: OracleSolutions) -> str:
    """The best candidate, of each of which there are one or several training seeds."""
    names = sorted(candidates)
    hits = {name: np.array([did.success for did in candidates[name]]) for name in names}
    shares = {name: float(hits[name].mean()) for name in names}
    first = max(names, key=lambda name: shares[name])
    low, _ = share_over_seeds(hits[first]).ci95 or (shares[first], shares[first])
    as_good = [name for name in names if shares[name] >= low]
    ratios = {name: step_ratio(candidates[name], bounds) or np.inf for name in as_good}
    return min(as_good, key=lambda name: (ratios[name], -shares[name]))


def main() -> None:
    """Measure all shipped policies, and write the file beside them."""
    with resources.as_file(resources.files("kinarm.data") / "policies") as folder:
        write_text(folder / RANKING, json.dumps(ranking(policy_names()), indent=1) + "\n")


if __name__ == "__main__":
    main()
