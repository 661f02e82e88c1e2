"""Plants beside MuJoCo: the same arm on position servos, step by step.

``python -m docs.measurements.plants data/results/plants`` writes ``mujoco.json``, and with
``--transfer`` what policies reach there in several `MANNERS`, a file each. From these
``docs/tables.py`` makes the tables of *Lag, delay and noise* and *Transfer to MuJoCo*. A call with
``--transfer`` goes on where another one ended.
"""

import argparse
import json
import time
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from docs.measurements.servo_arms import Manner, ServoArms, draw_lags, run
from kinarm import Plant, Simulator
from kinarm.policies import load_policy

POLICIES = (
    "ppo-best-both-seed0",
    "ars-best-both-seed0",
    "ars-linear-both-seed0",
)
SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "servo of 50 Hz": {"bandwidth": 50.0},
    "servo of 20 Hz": {"bandwidth": 20.0},
    "servo of 10 Hz": {"bandwidth": 10.0},
    "servo of 5 Hz": {"bandwidth": 5.0},
    "20 Hz, a step of delay": {"bandwidth": 20.0, "delay": 1},
    "20 Hz, two steps of delay": {"bandwidth": 20.0, "delay": 2},
    "50 Hz, noise of .03 rad": {"bandwidth": 50.0, "noise": 0.03},
    "20 Hz, at most 100 rad/s^2": {"bandwidth": 20.0, "acceleration": 100.0},
    "5 Hz, commanded positions": {"bandwidth": 5.0, "feedback": "commanded"},
    "20 Hz, two steps, commanded": {"bandwidth": 20.0, "delay": 2, "feedback": "commanded"},
}
"""Plants by what a table calls them."""

LAGS: Mapping[str, Mapping[str, Any]] = {
    **{f"servo of {rate} Hz": {"bandwidth": float(rate)} for rate in (50, 20, 10, 5, 3)},
    "20 Hz, a step of delay": {"bandwidth": 20.0, "delay": 1},
    "20 Hz, two steps of delay": {"bandwidth": 20.0, "delay": 2},
    "50 Hz, noise of .03 rad": {"bandwidth": 50.0, "noise": 0.03},
    **{
        f"20 Hz, at most {most} rad/s^2": {"bandwidth": 20.0, "acceleration": float(most)}
        for most in (400, 200, 100, 50)
    },
}
"""Plants of the table of transfer."""


MANNERS = {
    "bare": Manner(),
    "commanded": Manner("commanded"),
    "shield": Manner(shield="commands"),
    "both": Manner("commanded", "commands"),
    "both, lag known": Manner("commanded", "joints"),
    "quarter of the speed": Manner(speed=0.25),
}

DECISIVE = (*list(LAGS)[1:4], *list(LAGS)[5:7])
"""Plants in which networks with commanded state and shield face all trials."""

FEWER = 0.1
"""Share of the trials in other cells."""


def trajectories(simulator: Simulator, count: int = 50) -> float:
    """Largest difference of joints on held random actions, as a share of their ranges."""
    rng = np.random.default_rng(1)
    starts, goals = simulator.sample(rng, count)
    shape = count, simulator.task.horizon // 8, simulator.n_actions
    actions = np.repeat(rng.uniform(-1, 1, shape), 8, axis=1)
    ours = simulator.rollout_actions(actions, starts, goals, record=True)
    arms = ServoArms(simulator, draw_lags(simulator.problem.plant, count, rng))
    theirs = run(arms, actions, starts, goals, Manner(), rng)["paths"]
    n_actions = simulator.n_actions
    extent = (simulator.arm.upper - simulator.arm.lower)[:n_actions]
    off = np.abs(ours.paths[:, :, :n_actions] - theirs) / extent
    rows, ends = np.arange(count), ours.steps
    off[rows[ours.collision], ends[ours.collision]] = np.nan  # where the move was refused
    return float(np.nanmax(off))


def measure(trials: int) -> dict[str, Any]:
    """Success and contact of policies in both, and how far trajectories are apart."""
    ideal = Simulator("both")
    starts, goals = ideal.sample(np.random.default_rng(2), trials)
    rows = []
    for name, settings in SETTINGS.items():
        simulator = ideal.with_plant(Plant(**settings))
        apart = trajectories(ideal.with_plant(Plant(**{**settings, "noise": 0.0})))
        rng, figures = np.random.default_rng(0), {}
        arms = ServoArms(simulator, draw_lags(simulator.problem.plant, trials, rng))
        for policy in POLICIES:
            trained = load_policy(policy)
            ours = simulator.rollout(trained, starts, goals)
            manner = Manner(simulator.problem.plant.feedback)
            theirs = run(arms, trained, starts, goals, manner, np.random.default_rng(0))
            figures[policy] = {
                "kinarm": [ours.success.mean(), ours.collision.mean()],
                "mujoco": [theirs["success"].mean(), theirs["contact"].mean()],
            }
        rows.append({"plant": name, "settings": settings, "apart": apart, "policies": figures})
        print(rows[-1])
    return {"trials": trials, "rows": rows}


def measure_transfer(trials: int, name: str, path: Path) -> None:
    """Fill in the cells of a policy that its file lacks."""
    record = {"policy": name, "trials": trials, "cells": []}
    if path.exists():
        record = json.loads(path.read_text())
    known = {(cell["plant"], cell["manner"]) for cell in record["cells"]}
    cells = [each for each in product(LAGS, MANNERS) if each not in known]
    ideal = Simulator("both")
    starts, goals = ideal.sample(np.random.default_rng(2), record["trials"])
    for number, (plant, manner) in enumerate(cells):
        begun, how = time.process_time(), MANNERS[manner]
        decides = name.startswith("ppo") and manner.startswith("both") and plant in DECISIVE
        count = record["trials"] if decides else round(FEWER * record["trials"])
        simulator, rng = ideal.with_plant(Plant(**LAGS[plant])), np.random.default_rng(0)
        arms = ServoArms(simulator, draw_lags(simulator.problem.plant, count, rng))
        ended = run(arms, load_policy(name), starts[:count], goals[:count], how, rng)
        shares = {key: float(ended[key].mean()) for key in ("success", "contact")}
        seconds = round(time.process_time() - begun, 1)
        cell = {"plant": plant, "manner": manner, "trials": count, **shares, "seconds": seconds}
        record["cells"].append(cell)
        path.write_text(json.dumps(record, indent=1) + "\n")
        print(f"{name}, {number + 1} of {len(cells)}: {cell}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--transfer", nargs="*", metavar="POLICY", help="by default, three")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if given.transfer is not None:
        for policy in given.transfer or POLICIES:
            measure_transfer(given.trials, policy, given.out / f"transfer-{policy}.json")
    else:
        record = measure(given.trials)
        (given.out / "mujoco.json").write_text(json.dumps(record, indent=1) + "\n")
