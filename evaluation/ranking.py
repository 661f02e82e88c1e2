"""The success of all shipped policies, measured by ``python -m kinarm.evaluation.ranking``.

Run it after policies have been shipped, in the clone that holds them. It writes the file from
which `kinarm.policies.library.best_policy` names the best one. The trials have their own seed, so
that no policy is chosen by the trials that later judge it.
"""

import json
from collections.abc import Iterable
from importlib import resources
from typing import Any

from kinarm._files import write_text
from kinarm.evaluation.entrants import find_entrants
from kinarm.evaluation.trials import trial_set
from kinarm.policies.library import RANKING, policy_names
from kinarm.problem import PROBLEMS

TRIALS, SEED = 10_000, 20_161


def ranking(names: Iterable[str], trials: int = TRIALS) -> dict[str, Any]:
    """Share of trials in which policies succeed on the problems that they are for.

    Returns
    -------
    dict
        ``trials``, ``seed``, and ``success``: of each policy by its name, by problem.
    """
    entrants = [entrant for name in names for entrant in find_entrants(name)]
    success: dict[str, dict[str, float]] = {}
    for name, problem in PROBLEMS.items():
        faced = trial_set(problem, trials, SEED)
        for entrant in entrants:
            if entrant.serves(problem):
                share = float(entrant.run(faced).success.mean())
                success.setdefault(name, {})[entrant.name] = share
    return {"trials": trials, "seed": SEED, "success": success}


def main() -> None:
    """Measure all shipped policies, and write the file beside them."""
    with resources.as_file(resources.files("kinarm.data") / "policies") as folder:
        write_text(folder / RANKING, json.dumps(ranking(policy_names()), indent=1) + "\n")


if __name__ == "__main__":
    main()
