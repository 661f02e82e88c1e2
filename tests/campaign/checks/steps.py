"""Steps of the kernels: are they consistent with themselves, the limits and the proven bounds?"""

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from kinarm.envs.interface import Interface
from kinarm.policies import recipe, train_policy
from kinarm.policies.oracle import Oracle, OracleSolutions
from kinarm.policies.policy import Policy
from kinarm.problem import ReachProblem
from kinarm.reference import ReferenceSimulator
from kinarm.rollouts import Rollouts
from kinarm.simulator import Simulator
from tests.campaign.checks.tally import Tally
from tests.helpers.reference_episodes import assert_equal_outcome, scripted

Array = NDArray[np.float64]

SCENARIOS = 512
"""Starts and goals of an arm, each with bounds that the oracle proves."""

BATCH = 8192
"""Episodes that are run together."""

RECORDED = 24
"""Of so many batches, the first three are run again, recorded and on two threads."""

REFERENCED = 4
"""Episodes of such a batch that the reference simulator repeats."""

CHUNK = 8192
"""States that are observed together."""

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
    oracle = Oracle(problem, threads=1)
    twins = tuple(Simulator(problem, threads=threads) for threads in (1, 2))
    batch = int(np.clip(steps // 500, 64, BATCH))
    starts, goals = twins[0].sample(rng, min(SCENARIOS, batch))
    bounds = oracle.solve_batch(starts, goals)
    trained = recipe("ars", "paper", problem=problem, iterations=TRAINING, seed=seed)
    policy = train_policy(trained, threads=1).policy
    tally.count("scenarios", len(starts))
    tally.check("the oracle's motions take no fewer steps than it proves", _kept(bounds))
    for number, kind in enumerate(_kinds()):
        if tally.counts.get("steps", 0) >= steps:
            return tally
        rows = rng.integers(len(starts), size=batch)
        actions = _actions(kind, twins[0], bounds, rows, rng)
        scenarios = starts[rows], goals[rows]
        done = _run(twins[0], actions, policy, scenarios)
        tally.count("steps", done.steps.sum())
        tally.count("episodes", batch)
        tally.count("successes", done.success.sum())
        tally.count("contacts", done.collision.sum())
        _check_outcomes(tally, twins[0], done, scenarios, bounds, rows, (kind, seed, number))
        if number % RECORDED < 3:
            again = _run(twins[1], actions, policy, scenarios, record=True)
            _check_equal(tally, done, again)
            _check_paths(tally, twins[0], again)
            if actions is not None:
                _check_reference(tally, twins[0], again, actions)
    raise AssertionError


def _kinds() -> Iterator[str]:
    while True:
        yield from ("random", "oracle", "policy")


def _kept(bounds: OracleSolutions) -> NDArray[np.bool_]:
    kept: NDArray[np.bool_] = ~bounds.reachable | (bounds.steps >= bounds.steps_lower_bound)
    return kept


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
    held = int(rng.choice([1, 2, 4, 8, 16, 64]))
    drawn = rng.uniform(-1.5, 1.5, (shape[0], -(-shape[1] // held), shape[2]))
    return np.repeat(drawn, held, axis=1)[:, : shape[1]]


def _run(
    simulator: Simulator,
    actions: Array | None,
    policy: Policy,
    scenarios: tuple[Array, Array],
    *,
    record: bool = False,
) -> Rollouts:
    if actions is None:
        return simulator.rollout(policy, *scenarios, record=record)
    return simulator.rollout_actions(actions, *scenarios, record=record)


def _check_outcomes(
    tally: Tally,
    simulator: Simulator,
    done: Rollouts,
    scenarios: tuple[Array, Array],
    bounds: OracleSolutions,
    rows: NDArray[np.int64],
    where: tuple[str, int, int],
) -> None:
    """Check the ends of episodes."""
    arm, task = simulator.arm, simulator.task
    reached, refused = done.success, done.collision

    def describe(row: int) -> dict[str, object]:
        start, goal = (part[row].tolist() for part in scenarios)
        return {"batch": where, "start": start, "goal": goal, "steps": int(done.steps[row])}

    def claim(what: str, holds: NDArray[np.bool_]) -> None:
        tally.check(what, holds, describe)

    moved = np.abs(done.configurations - scenarios[0])[:, : simulator.n_actions]
    farthest = done.steps[:, None] * (simulator.step_limit + ROUNDING)
    numbers = (done.distance, done.returns, *done.configurations.T, *done.targets.T)
    claim("no number is infinite or NaN", np.isfinite(numbers).all(axis=0))
    claim("an episode ends in one way", ~(reached & refused))
    claim("it takes 1 to horizon steps", (done.steps >= 1) & (done.steps <= task.horizon))
    claim("it goes on to the horizon", reached | refused | (done.steps == task.horizon))
    claim("success is being within the tolerance", reached == (done.distance <= task.tolerance))
    claim("joints end within their limits", _within(done.configurations, arm.lower, arm.upper))
    claim("joints go no farther than their speeds allow", (moved <= farthest).all(axis=1))
    # A refused step counts, but a success never ends in one.
    proven = bounds.steps_lower_bound[rows]
    claim("no success is faster than is proven possible", (done.steps >= proven)[reached])
    tally.count("successes as fast as is proven possible", (done.steps == proven)[reached].sum())
    closest = bounds.distance_lower_bound[rows]
    claim("no episode ends closer than is proven possible", done.distance >= closest)


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
    for first in range(0, len(states), CHUNK):
        part = slice(first, first + CHUNK)
        seen = simulator.world.observe(states[part], goals[part])
        tally.check("observations are inside their space", _within(seen, space.low, space.high))


def _check_reference(tally: Tally, simulator: Simulator, done: Rollouts, actions: Array) -> None:
    """Repeat some episodes by the reference simulator."""
    reference = ReferenceSimulator(simulator)
    for row in range(REFERENCED):
        episode = reference.rollout(scripted(actions[row]), done.starts[row], done.goals[row])
        try:
            assert_equal_outcome(simulator, done, row, episode)
        except AssertionError as error:
            equal, why = False, str(error)
        else:
            equal, why = True, ""
        tally.check("episodes equal those of the reference", equal, lambda _, why=why: {"why": why})
        tally.count("steps of the reference", len(episode.rewards))
