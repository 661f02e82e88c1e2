"""Policies for joints that lag, in MuJoCo: ``python -m docs.measurements.hard POLICY``.

Each trial has servos, a delay, limits of acceleration and noise, drawn as those of ``hard-paper``.
The exported policy sees measured joint positions and remembers the rest, as on an arm.
``data/results/skills/mujoco.json`` keeps what the training seeds reach, bare and behind a shield of
their commands; `docs.tables` makes a table of it.
"""

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from docs.measurements.plants import ServoArm
from docs.measurements.skills import RECORD, SEED
from kinarm import Plant, Simulator
from kinarm._files import write_text
from kinarm.evaluation import find_contestants
from kinarm.evaluation.contestants import NEVER
from kinarm.policies import Policy, export_policy
from kinarm.policies.arm_policy import ArmPolicy

PROBLEM = "hard-paper"


def drive(policy: Policy, trials: int, *, shielded: bool) -> dict[str, float]:
    """Shares of trials that succeed and touch, each on an arm of its own."""
    hard = Simulator(PROBLEM, threads=1)
    plant, ideal, task = hard.problem.plant, hard.with_plant(Plant()), hard.task
    rng, n, seconds = np.random.default_rng(SEED), hard.n_actions, hard.problem.stepping.time_step
    starts, goals = ideal.sample(rng, trials)
    drawn = {
        each: rng.uniform(*plant.range_of(each), trials) for each in ("bandwidth", "acceleration")
    }
    lowest, highest = (int(each) for each in plant.range_of("delay"))
    delays = rng.integers(lowest, highest + 1, trials)
    arms = []
    for row, start in enumerate(starts):
        lag = Plant(**{each: float(values[row]) for each, values in drawn.items()})
        arms.append(ServoArm(ideal.with_plant(lag), 1))
        arms[-1].begin(start[None])
    with tempfile.TemporaryDirectory() as folder:
        export_policy(policy, Path(folder) / "arm", onnx=False)
        runtime = ArmPolicy(Path(folder) / "arm", feedback="measured")
    shield = ideal.with_tolerance(NEVER).shielded()
    told, commands, q = shield.reset(starts, goals), [starts], starts.copy()
    success, contact = np.zeros(trials, dtype=bool), np.zeros(trials, dtype=bool)
    tools = ideal.world.poses(q)[:, :3, 3]
    for _ in range(task.horizon):
        seen, aims = q.copy(), goals.copy()
        seen[:, :n] += plant.range_of("noise")[0] * rng.normal(size=(trials, n))
        aims += plant.range_of("goal_noise")[0] * rng.normal(size=goals.shape)
        command = runtime.command(seen, aims)
        if shielded:
            shield.step(told, (command - commands[-1])[:, :n] / hard.step_limit)
            command = runtime.commanded = told.q.copy()
        commands.append(command)
        running, before = ~(success | contact), tools
        for row in np.flatnonzero(running):
            late = commands[max(0, len(commands) - 1 - delays[row])][row, :n]
            (way,) = arms[row].move(late[None], running[row : row + 1])
            visited = np.repeat(q[row : row + 1], len(way), axis=0)
            visited[:, :n] = way
            contact[row] = ideal.world.in_contact(visited).any()
            q[row, :n] = way[-1]
        tools = ideal.world.poses(q)[:, :3, 3]
        near = ideal.world.distances(q, goals) <= task.tolerance
        slow = np.linalg.norm(tools - before, axis=1) <= task.goal.speed * seconds
        success |= running & ~contact & near & slow
    return {"success": float(success.mean()), "contact": float(contact.mean())}


def main() -> None:
    """Drive every training seed of a policy, and keep the record."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("policy", nargs="?", default=f"ppo-best-{PROBLEM}")
    parser.add_argument("--trials", type=int, default=1000)
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for each in find_contestants(given.policy):
        for shielded in (False, True):
            assert each.policy is not None
            found = drive(each.policy, given.trials, shielded=shielded)
            rows.append({"policy": each.name, "shield": shielded, **found})
            print(rows[-1], flush=True)
    record = {"trials": given.trials, "seed": SEED, "rows": rows}
    write_text(RECORD.with_name("mujoco.json"), json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
