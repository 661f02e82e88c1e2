"""Policies for joints that lag, in MuJoCo: ``python -m docs.measurements.hard POLICY``.

Each trial has servos, a delay, limits of acceleration and noise, drawn as those of ``hard-paper``.
The exported policy sees measured joint positions and remembers the rest, as on an arm.
``data/results/skills/mujoco.json`` keeps what the training seeds reach, bare and behind a shield of
their commands; `docs.tables` makes a table of it.
"""

import argparse
import json
from typing import Any

import numpy as np

from docs.measurements.servo_arms import Manner, ServoArms, draw_lags, run
from docs.measurements.skills import RECORD, SEED
from kinarm import Plant, Simulator
from kinarm._files import write_text
from kinarm.evaluation import find_contestants
from kinarm.policies import Policy

PROBLEM = "hard-paper"


def drive(policy: Policy, trials: int, manner: Manner) -> dict[str, float]:
    """Shares of trials that succeed and touch, each on an arm of its own."""
    simulator, rng = Simulator(PROBLEM, threads=1), np.random.default_rng(SEED)
    starts, goals = simulator.with_plant(Plant()).sample(rng, trials)
    arms = ServoArms(simulator, draw_lags(simulator.problem.plant, trials, rng))
    ended = run(arms, policy, starts, goals, manner, rng)
    return {name: float(ended[name].mean()) for name in ("success", "contact")}


def main() -> None:
    """Drive every training seed of a policy, and keep the record."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("policy", nargs="?", default=f"ppo-best-{PROBLEM}")
    parser.add_argument("--trials", type=int, default=1000)
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for each in find_contestants(given.policy):
        for manner in (Manner(), Manner(shield="commands")):
            assert each.policy is not None
            found = drive(each.policy, given.trials, manner)
            rows.append({"policy": each.name, "shield": bool(manner.shield), **found})
            print(rows[-1], flush=True)
    record = {"trials": given.trials, "seed": SEED, "rows": rows}
    write_text(RECORD.with_name("mujoco.json"), json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
