"""What the oracle leaves undecided: ``python -m docs.measurements.undecided``, some minutes.

Each shipped arm faces the paper's third task between benches that it can reach.
``data/results/plans/undecided.json`` keeps shares and step ratios, of which `docs.tables` makes a
table of *Oracle*. It needs the extra ``robots``.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from kinarm import PROBLEMS, ReachProblem, World, arm_names
from kinarm._files import write_text
from kinarm.evaluation import oracle_bounds
from kinarm.evaluation.problem_check import check_problem
from kinarm.evaluation.trials import TrialSet

RECORD = Path(__file__).resolve().parents[2] / "data/results/plans/undecided.json"

TRIALS = 1000

NEARER = {
    **dict.fromkeys(("kinova", "paper_flange", "xarm7"), (0.85, 1.0)),
    "ur3": (0.7, 0.7),
    **dict.fromkeys(("so100", "so101"), (0.4, 0.4)),
}
"""Distances and heights of benches as shares of the paper's, for arms that are too short."""

PACE = {"time_step": 0.04, "start_spread": 0.25}
"""Steps and starts of `benches-ur5` and the like; the paper's own arms keep the paper's."""


def task_of(arm: str) -> ReachProblem:
    """The third task between benches that an arm can reach."""
    across, upwards = NEARER.get(arm, (1.0, 1.0))
    scale, scene = np.array([across, across, upwards]), PROBLEMS["both"].scene
    scaled = {
        name: tuple(
            replace(each, lower=tuple(scale * each.lower), upper=tuple(scale * each.upper))
            for each in getattr(scene, name)
        )
        for name in ("obstacles", "goal_regions")
    }
    pace = {} if arm in ("lrmate200ic_5l", "paper", "paper_flange") else PACE
    return PROBLEMS["both"].replace(arm=arm, scene=replace(scene, **scaled), **pace)


def row_of(arm: str) -> dict[str, Any]:
    """Shares of trials, and steps divided by their bounds."""
    problem = task_of(arm)
    shares = check_problem(World(problem), TRIALS)
    found = oracle_bounds(TrialSet.draw(problem, TRIALS, 0))  # which the check has solved
    ratios = (found.steps / found.steps_lower_bound)[found.reachable]
    return {
        "arm": arm,
        "nearer": NEARER.get(arm, (1.0, 1.0)),
        "reached": shares.reached.value,
        "out of reach": shares.out_of_reach.value,
        "undecided": shares.undecided.value,
        "step ratio": [float(ratios.mean()), float(np.quantile(ratios, 0.95))],
    }


def main() -> None:
    """Record all arms."""
    rows = []
    for arm in arm_names():
        rows.append(row_of(arm))
        print(rows[-1], flush=True)
    write_text(RECORD, json.dumps({"trials": TRIALS, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
