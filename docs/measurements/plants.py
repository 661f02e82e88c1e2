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
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from kinarm import Plant, Simulator
from kinarm.evaluation.contestants import NEVER
from kinarm.kernels.plant import COMMAND
from kinarm.policies import Policy, load_policy
from kinarm.policies.running.mujoco_arm import SUBSTEP, servo_model

Array = NDArray[np.float64]

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


class Manner(NamedTuple):
    """How a policy drives an arm.

    Attributes
    ----------
    feedback : str
        Which joint positions it sees; see `kinarm.Plant`.
    shield : str
        Of what a shield lets nothing touch: the motion of ``"commands"``, as if
        joints obeyed at once, or that of ``"joints"``, whose plant it knows.
    speed : float
        Share of its actions that is commanded, for as many times as long.
    """

    feedback: str = "measured"
    shield: Literal["", "commands", "joints"] = ""
    speed: float = 1.0


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


class ServoArm:
    """Arms in MuJoCo on critically damped position servos, without gravity.

    Parameters
    ----------
    simulator : Simulator
        Arm, scene and plant.
    count : int
        Number of arms.
    """

    def __init__(self, simulator: Simulator, count: int) -> None:
        self.simulator, plant = simulator, simulator.problem.plant
        model = servo_model(mujoco, simulator.world, plant.range_of("bandwidth")[0])
        self.model, self.states = model, [mujoco.MjData(model) for _ in range(count)]
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        if plant.acceleration:
            rate = 2 * np.pi * plant.range_of("bandwidth")[0]
            moved = model.actuator_gainprm[:, 0] / rate**2
            most = moved * plant.range_of("acceleration")[0]
            model.actuator_forcelimited[:] = 1
            model.actuator_forcerange[:] = np.stack([-most, most], axis=1)

    def begin(self, starts: Array) -> None:
        """Let arms rest at configurations, shape (n, n_joints) [rad or m]."""
        for state, start in zip(self.states, starts, strict=True):
            mujoco.mj_resetData(self.model, state)
            state.qpos[:] = start[: self.model.nq]

    def move(self, commands: Array, running: Array) -> Array:
        """Joint positions on the way, shape (n, parts, n_actions) [rad or m], for commands.

        Arms that are not ``running`` stay. Motors go at most as fast as joints are rated,
        and joints stop at their limits.
        """
        parts, time_step = 10, self.simulator.problem.stepping.time_step
        fastest = self.simulator.step_limit / time_step
        limits = self.model.jnt_range.T
        ways = np.empty((len(commands), parts, self.model.nq))
        for row, (way, state) in enumerate(zip(ways, self.states, strict=True)):
            way[:] = state.qpos
            state.ctrl[:] = commands[row]
            for part in range(parts if running[row] else 0):
                mujoco.mj_step(self.model, state, round(time_step / SUBSTEP / parts))
                speeds = np.clip(state.qvel, -fastest, fastest)
                late = 0.5 * time_step / parts * (speeds - state.qvel)
                within = np.clip(state.qpos + late, *limits)
                state.qvel[:] = speeds
                state.qvel[(within == limits[0]) | (within == limits[1])] = 0.0
                state.qpos[:] = within
                way[part] = state.qpos
        return ways


def run(
    arm: ServoArm,
    policy: Policy | Array,
    starts: Array,
    goals: Array,
    manner: Manner | None = None,
) -> dict[str, Array]:
    """Drive arms by a policy, or by actions, shape (n, horizon, n_actions).

    Returns which succeeded and touched, shape (n,), and the paths of actuated joints, shape (n,
    horizon + 1, n_actions). Resolved rates are of commanded joints in every manner.
    """
    simulator, plant = arm.simulator, arm.simulator.problem.plant
    watched = simulator.world
    if isinstance(policy, Policy):
        watched = simulator.seen_as(policy.observation).world
    rates = watched.layout.places.get("resolved_rate")
    manner = manner or Manner(plant.feedback)
    n, n_actions = len(starts), simulator.n_actions
    horizon = round(simulator.task.horizon / manner.speed)
    world, rng = simulator.world, np.random.default_rng(0)
    lower, upper = (each[:n_actions] for each in (simulator.arm.lower, simulator.arm.upper))
    known = replace(plant, noise=0.0) if manner.shield == "joints" else Plant()
    shield = simulator.with_plant(known).with_tolerance(NEVER).shielded()
    told = shield.reset(starts, goals)
    arm.begin(starts)
    commands = [starts[:, :n_actions]]
    paths = np.empty((n, horizon + 1, n_actions))
    paths[:, 0] = starts[:, :n_actions]
    success, contact = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    for step in range(horizon):
        seen = starts.copy()
        seen[:, :n_actions] = commands[-1] if manner.feedback == "commanded" else paths[:, step]
        if manner.feedback == "measured":
            seen[:, :n_actions] += float(plant.range_of("noise")[0]) * rng.normal(
                size=(n, n_actions)
            )
        if isinstance(policy, Policy):
            observed = watched.observe(seen, goals)
            if rates is not None:
                seen[:, :n_actions] = commands[-1]
                observed[:, rates] = watched.observe(seen, goals)[:, rates]
            actions = policy(observed)
        else:
            actions = policy[:, step]
        actions = manner.speed * np.clip(actions, -1, 1)
        if manner.shield:
            shield.step(told, actions)
            moved = told.q[:, :n_actions] if known.ideal else told.drive[:, COMMAND]
            commands.append(moved.copy())
        else:
            moved = commands[-1] + actions * simulator.step_limit
            commands.append(np.clip(moved, lower, upper))
        late = commands[max(0, len(commands) - 1 - int(plant.range_of("delay")[1]))]
        running = ~(success | contact)
        ways = arm.move(late, running | isinstance(policy, np.ndarray))
        paths[:, step + 1] = ways[:, -1]
        visited = np.repeat(starts[running, None], ways.shape[1], axis=1)
        visited[:, :, :n_actions] = ways[running]
        touched = world.in_contact(visited.reshape(-1, starts.shape[1]))
        touched = touched.reshape(len(visited), ways.shape[1]).any(axis=1)
        near = world.distances(visited[:, -1], goals[running]) <= simulator.task.tolerance
        contact[running], success[running] = touched, ~touched & near
        if isinstance(policy, Policy) and (success | contact).all():
            break
    return {"success": success, "contact": contact, "paths": paths}


def trajectories(simulator: Simulator, count: int = 50) -> float:
    """Largest difference of joints on held random actions, as a share of their ranges."""
    rng = np.random.default_rng(1)
    starts, goals = simulator.sample(rng, count)
    shape = count, simulator.task.horizon // 8, simulator.n_actions
    actions = np.repeat(rng.uniform(-1, 1, shape), 8, axis=1)
    ours = simulator.rollout_actions(actions, starts, goals, record=True)
    theirs = run(ServoArm(simulator, count), actions, starts, goals)["paths"]
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
        arm, figures = ServoArm(simulator, trials), {}
        for policy in POLICIES:
            trained = load_policy(policy)
            ours = simulator.rollout(trained, starts, goals)
            theirs = run(arm, trained, starts, goals)
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
        arm = ServoArm(ideal.with_plant(Plant(**LAGS[plant])), count)
        ended = run(arm, load_policy(name), starts[:count], goals[:count], how)
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
