"""What a shield keeps: random steps that touch nothing, and bodies that move.

``python -m docs.measurements.shield data/results/plants`` writes ``shield.json``, from which
``docs/tables.py`` makes the tables of *Contact*. Ten million steps take ten minutes.
"""

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kinarm import Simulator
from kinarm.episodes import RUNNING, Rollouts
from kinarm.policies import load_policy
from tests.helpers.random_scenes import CLUTTER, among, swinging
from tests.helpers.reference_episodes import held_actions

HELD, EPISODES, TRIALS, PUSHES = 8, 1000, 400, 200
"""Steps for which a random action is held, episodes at a time, trials among balls, and pushes."""


def random_rollouts(simulator: Simulator) -> Iterator[Rollouts]:
    """Episodes of random actions, without end."""
    rng = np.random.default_rng(0)
    while True:
        starts, goals = simulator.sample(rng, EPISODES)
        actions = held_actions(simulator, rng, EPISODES, HELD)
        yield simulator.rollout_actions(actions, starts, goals)


def random_steps(name: str, simulator: Simulator, least: int) -> dict[str, Any]:
    """At least so many random steps behind a shield: replaced ones, contacts, and speed."""
    counts, begun = np.zeros(3, dtype=int), time.process_time()
    for rollouts in random_rollouts(simulator):
        ends = rollouts.steps, rollouts.interventions, rollouts.collision
        counts += [int(column.sum()) for column in ends]
        if counts[0] >= least:
            break
    steps, replaced, contacts = counts.tolist()
    speed = steps / (time.process_time() - begun)
    row = {"what": name, "steps": steps, "replaced": replaced, "contacts": contacts}
    return {**row, "steps_per_second_and_core": round(speed)}


def beside_balls(speed: float) -> dict[str, Any]:
    """Success and contact of a policy, and contact of a resting arm, without and with a shield."""
    simulator = Simulator(among("both", swinging(speed)))
    scenarios = simulator.sample(np.random.default_rng(0), TRIALS)
    shape = TRIALS, simulator.task.horizon, simulator.n_actions
    row: dict[str, Any] = {"speed": speed}
    for name, each in (("bare", simulator), ("shield", simulator.shielded())):
        driven = each.rollout(load_policy("ppo-best-both-seed0"), *scenarios)
        resting = each.rollout_actions(np.zeros(shape), *scenarios)
        row[name] = [driven.success.mean(), driven.collision.mean(), resting.collision.mean()]
    return row


def pushing() -> dict[str, Any]:
    """Processor time of steps of a UR5 with pieces that pushes into what is around it [ms]."""
    simulator, rng = Simulator("ring-ur5", threads=1).shielded(), np.random.default_rng(0)
    times, replaced = list[float](), 0
    for _ in range(PUSHES):
        episodes = simulator.reset(*simulator.sample(rng, 1))
        push = rng.uniform(-1, 1, (1, simulator.n_actions))
        push /= np.abs(push).max()
        while episodes.status[0] == RUNNING:
            begun = time.process_time()
            simulator.step(episodes, push)
            times.append(1e3 * (time.process_time() - begun))
        replaced += int(episodes.interventions[0])
    median, most = np.quantile(times, [0.5, 0.99]).round(2)
    return {"steps": len(times), "replaced": replaced, "median": median, "most": most}


def measure(least: int) -> dict[str, Any]:
    """Everything for the tables."""
    worlds = {
        "random scenes, `ideal`": Simulator(among("both", CLUTTER)).shielded(),
        "`both`, `hard`": Simulator("both").with_plant("hard").shielded(),
    }
    return {
        "trials": TRIALS,
        "pushing": pushing(),
        "balls": [beside_balls(speed) for speed in (0.2, 0.5, 1.0, 2.0)],
        "random": [random_steps(name, each, least) for name, each in worlds.items()],
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--steps", type=int, default=10_000_000)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    record = measure(given.steps)
    (given.out / "shield.json").write_text(json.dumps(record, indent=1) + "\n")
