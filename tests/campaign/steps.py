"""Steps of the kernels and policies: consistent with themselves, the limits and proven bounds?"""

from dataclasses import fields
from itertools import count, cycle

import numpy as np
from numpy.typing import NDArray

from kinarm.envs.environment import Interface
from kinarm.episodes import Rollouts
from kinarm.policies import load_policy, policy_names, recipe, train_policy
from kinarm.policies.oracle import Oracle, OracleSolutions
from kinarm.problem import ReachProblem
from kinarm.reference import ReferenceSimulator
from kinarm.simulator import Simulator
from tests.helpers.reference_episodes import assert_equal_outcome, scripted

from .tally import Tally

Array = NDArray[np.float64]

SCENARIOS, BATCH = 512, 8192
"""Starts and goals of an arm, with bounds that the oracle proves, and episodes run together."""
RECORDED, REFERENCED = 24, 4
"""Of so many batches, the first three are run again, recorded and on two threads; the reference
simulator repeats so many episodes of each."""
ROUNDING = 1e-12
"""What a joint may move more than its limits say, for rounding [rad or m]."""
TRAINING = 20
"""Iterations of ARS after which a policy no longer acts at random."""


def check_steps(problem: ReachProblem, steps: int, seed: int) -> Tally:
    """Take so many steps or a few more, and check them.

    A third of the episodes acts at random, a third as a policy of a short training, and a third
    plays the oracle's motions with noise, which is where bounds are closest.
    """
    tally, rng = Tally(), np.random.default_rng(seed)
    one, two = (Simulator(problem, threads=threads) for threads in (1, 2))
    batch = int(np.clip(steps // 500, 64, BATCH))
    starts, goals = one.sample(rng, min(SCENARIOS, batch))
    bounds = Oracle(problem, threads=1).solve_batch(starts, goals)
    trained = recipe("ars", "paper", problem=problem, iterations=TRAINING, seed=seed)
    policy = train_policy(trained, threads=1).policy
    tally.count("scenarios", len(starts))
    kept = ~bounds.reachable | (bounds.steps >= bounds.steps_lower_bound)
    tally.check("the oracle's motions take no fewer steps than it proves", kept)
    for number, kind in zip(count(), cycle(("random", "oracle", "policy")), strict=False):
        if tally.counts.get("steps", 0) >= steps:
            break
        rows = rng.integers(len(starts), size=batch)
        scenarios, actions = (starts[rows], goals[rows]), _actions(kind, one, bounds, rows, rng)
        runs = [
            simulator.rollout(policy, *scenarios, record=record)
            if actions is None
            else simulator.rollout_actions(actions, *scenarios, record=record)
            for simulator, record in ((one, False), (two, True))[: 1 + (number % RECORDED < 3)]
        ]
        done = runs[0]
        tally.count("steps", done.steps.sum())
        tally.count("episodes", batch)
        tally.count("successes", done.success.sum())
        tally.count("contacts", done.collision.sum())
        _check_ends(tally, one, done, {"kind": kind, "seed": seed, "number": number})
        _check_bounds(tally, done, bounds, rows)
        if len(runs) > 1:
            _check_equal(tally, *runs)
            _check_paths(tally, one, runs[1])
            if actions is not None:
                _check_reference(tally, one, runs[1], actions)
    return tally


def check_policies(problem: ReachProblem, trials: int, seed: int) -> Tally:
    """Put all shipped policies to the same scenarios, so many trials or a few more in all."""
    tally, oracle, names = Tally(), Oracle(problem, threads=1), policy_names()
    rng, n = np.random.default_rng(seed), -(-trials // len(names))
    scenarios = oracle.simulator.sample(rng, n)
    bounds = oracle.solve_batch(*scenarios)
    tally.count("scenarios", len(bounds))
    tally.count("scenarios whose floor is exact", bounds.proof_complete.sum())
    for name in names:
        done = oracle.simulator.rollout(load_policy(name), *scenarios)
        tally.count("trials", len(done))
        tally.count("successes", done.success.sum())
        _check_ends(tally, oracle.simulator, done, {"policy": name, "seed": seed})
        _check_bounds(tally, done, bounds, np.arange(n))
    return tally


def _actions(
    kind: str,
    simulator: Simulator,
    bounds: OracleSolutions,
    rows: NDArray[np.int64],
    rng: np.random.Generator,
) -> Array | None:
    """Tables of actions; none where a policy acts."""
    shape = (len(rows), simulator.task.horizon, simulator.n_actions)
    if kind == "policy":
        return None
    if kind == "oracle":
        size = 10.0 ** rng.uniform(-6, 0, (len(rows), 1, 1))
        return bounds.actions[rows] + size * rng.normal(size=shape)
    repeated = int(rng.choice([1, 2, 4, 8, 16, 64]))
    drawn = rng.uniform(-1.5, 1.5, (shape[0], -(-shape[1] // repeated), shape[2]))
    return np.repeat(drawn, repeated, axis=1)[:, : shape[1]]


def _check_ends(
    tally: Tally, simulator: Simulator, done: Rollouts, where: dict[str, object]
) -> None:
    """Check the ends of episodes."""
    arm, task = simulator.arm, simulator.task
    reached, refused = done.success, done.collision

    def claim(what: str, holds: NDArray[np.bool_]) -> None:
        def describe(row: int) -> dict[str, object]:
            return {**where, "start": done.starts[row].tolist(), "goal": done.goals[row].tolist()}

        tally.check(what, holds, describe)

    moved = np.abs(done.configurations - done.starts)[:, : simulator.n_actions]
    farthest = done.steps[:, None] * (simulator.step_limit + ROUNDING)
    numbers = (done.distance, done.returns, *done.configurations.T, *done.targets.T)
    claim("no number is infinite or NaN", np.isfinite(numbers).all(axis=0))
    claim("an episode ends in one way", ~(reached & refused))
    claim("it takes 1 to horizon steps", (done.steps >= 1) & (done.steps <= task.horizon))
    claim("it goes on to the horizon", reached | refused | (done.steps == task.horizon))
    claim("success is being within the tolerance", reached == (done.distance <= task.tolerance))
    claim("joints end within their limits", _within(done.configurations, arm.lower, arm.upper))
    claim("joints go no farther than their speeds allow", (moved <= farthest).all(axis=1))


def _check_bounds(
    tally: Tally, done: Rollouts, bounds: OracleSolutions, rows: NDArray[np.int64]
) -> None:
    """Check that no episode beats what the oracle proves; a refused step counts as one."""
    reached, proven = done.success, bounds.steps_lower_bound[rows]
    closest = bounds.distance_lower_bound[rows]
    faster = reached & (done.steps < proven)
    tally.check("no success is faster than is proven possible", ~faster)
    tally.check("no episode ends closer than is proven possible", done.distance >= closest)
    tally.count("successes as fast as is proven possible", (done.steps == proven)[reached].sum())


def _within(values: Array, lower: Array, upper: Array) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = ((values >= lower) & (values <= upper)).all(axis=-1)
    return inside


def _check_equal(tally: Tally, one: Rollouts, other: Rollouts) -> None:
    """Check that a second run, recorded and on two threads, gives the same bits."""
    for item in fields(Rollouts):
        if item.name not in ("paths", "moments"):
            pair = getattr(one, item.name), getattr(other, item.name)
            same = [a.reshape(len(one), -1).view(np.uint8) for a in map(np.ascontiguousarray, pair)]
            tally.check("a second run gives the same bits", (same[0] == same[1]).all(axis=1))
    tally.count("steps run twice", one.steps.sum())


def _check_paths(tally: Tally, simulator: Simulator, done: Rollouts) -> None:
    """Check every state on the way."""
    arm, n = simulator.arm, simulator.n_actions
    moving = np.arange(done.paths.shape[1]) <= done.steps[:, None]
    states = done.paths[moving]
    goals = np.broadcast_to(done.goals[:, None], (*moving.shape, 3))[moving]
    moves = np.abs(np.diff(done.paths, axis=1))[moving[:, 1:]]
    tally.check("paths end with their episodes", np.isnan(done.paths[~moving]).all(axis=-1))
    tally.check("joints stay within their limits", _within(states, arm.lower, arm.upper))
    allowed = (moves[:, :n] <= simulator.step_limit + ROUNDING).all(axis=1)
    tally.check("joints move no faster than they may", allowed & (moves[:, n:] == 0).all(axis=1))
    space = Interface(simulator).observation_space
    for first in range(0, len(states), BATCH):
        seen = simulator.world.observe(states[first : first + BATCH], goals[first : first + BATCH])
        tally.check("observations are inside their space", _within(seen, space.low, space.high))


def _check_reference(tally: Tally, simulator: Simulator, done: Rollouts, actions: Array) -> None:
    """Repeat some episodes by the reference simulator."""
    reference = ReferenceSimulator(simulator)
    for row in range(REFERENCED):
        episode = reference.rollout(scripted(actions[row]), done.starts[row], done.goals[row])
        why = ""
        try:
            assert_equal_outcome(simulator, done, row, episode)
        except AssertionError as error:
            why = str(error)
        claim = "episodes equal those of the reference"
        tally.check(claim, not why, lambda _, why=why: {"why": why})
        tally.count("steps of the reference", len(episode.rewards))
