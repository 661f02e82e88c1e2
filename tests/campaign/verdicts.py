"""Verdicts of contact: the kernels' proofs against Coal, and Coal against a second engine."""

import numpy as np
from numpy.typing import NDArray

from kinarm.problem import ReachProblem
from kinarm.simulator import Simulator
from kinarm.world import World
from tests.helpers.configurations import contact_boundary, jittered, substeps

from .engines import MARGIN, SecondEngine, is_fit
from .tally import Tally

Array = NDArray[np.float64]

LOT = 20_000
"""Configurations that are looked at together."""
JITTERS = 9
"""Configurations around each end of a pair at the boundary of contact, besides the end itself."""


def check_verdicts(problem: ReachProblem, configurations: int, seed: int) -> Tally:
    """Compare verdicts at so many configurations or a few more, half of them near contact.

    Half are those that were tested for contact in episodes of random actions; a third are within
    1e-10 to about 0.1 rad of the boundary of contact; the others were tested in steps that begin
    there.
    """
    tally, simulator = Tally(), Simulator(problem, threads=1)
    rng = np.random.default_rng(seed)
    engine = SecondEngine(simulator.world) if is_fit(problem) else None
    lot = min(LOT, -(-configurations // 5))
    while tally.counts.get("configurations", 0) < configurations:
        near = _near_contact(simulator, rng, 2 * lot)
        _check_proofs(tally, simulator, near)
        for asked in (
            _tested_in_episodes(tally, simulator, rng, lot),
            _tested_in_episodes(tally, simulator, rng, lot),
            near,
            _tested_from(tally, simulator, rng, near, lot),
        ):
            if engine is not None:
                _ask_second_engine(tally, engine, simulator.world, asked)
    return tally


def _near_contact(simulator: Simulator, rng: np.random.Generator, count: int) -> Array:
    """Configurations at and around the boundary of contact."""
    seeds = rng.integers(2**32, size=JITTERS + 1).tolist()
    ends = np.concatenate(contact_boundary(simulator, seeds[0], -(-count // (2 * len(seeds)))))
    return np.concatenate([ends, *(jittered(ends, seed) for seed in seeds[1:])])


def proven(simulator: Simulator, asked: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which configurations kernels prove to be free, and which to touch something."""
    _, free, touching, _ = simulator.world.proven(np.ascontiguousarray(asked))
    return free, touching


def _check_proofs(tally: Tally, simulator: Simulator, asked: Array) -> None:
    """Check the proofs for single configurations."""
    free, touching = proven(simulator, asked)
    truth = simulator.world.contact_model.in_contact(asked)
    _claim(tally, "what is proven free touches nothing", (~truth)[free], asked[free])
    _claim(tally, "what is proven to touch does", truth[touching], asked[touching])
    tally.count("configurations", len(asked))
    tally.count("near contact", len(asked))
    tally.count("decided without Coal", (free | touching).sum())


def _tested_in_episodes(
    tally: Tally, simulator: Simulator, rng: np.random.Generator, count: int
) -> Array:
    """Run episodes of random actions, and check what became of every tested configuration."""
    horizon, tested = simulator.task.horizon, simulator.world.rules.tested
    parts: list[Array] = []
    while sum(map(len, parts)) < count:
        n = max(count // (64 * tested), 1)
        drawn = rng.uniform(-1.5, 1.5, (n, -(-horizon // 4), simulator.n_actions))
        actions = np.repeat(drawn, 4, axis=1)[:, :horizon]
        done = simulator.rollout_actions(actions, *simulator.sample(rng, n), record=True)
        last, step = done.steps[:, None] - 1, np.arange(horizon)
        ends = done.paths[:, 1:].copy()
        refused = (step == last) & done.collision[:, None]
        ends[refused] = done.targets[done.collision]
        taken = step <= last
        ways = substeps(simulator.world, done.paths[:, :-1][taken], ends[taken])
        parts.append(_check_ways(tally, simulator, ways, refused[taken]))
    return np.concatenate(parts)


def _tested_from(
    tally: Tally, simulator: Simulator, rng: np.random.Generator, near: Array, count: int
) -> Array:
    """Take one step from free configurations near contact, large or small."""
    arm = simulator.arm
    allowed = ((near >= arm.lower) & (near <= arm.upper)).all(axis=1)
    free = near[allowed & ~simulator.world.contact_model.in_contact(near)]
    starts = free[rng.integers(len(free), size=-(-count // simulator.world.rules.tested))]
    size = 10.0 ** rng.uniform(-9, 0, (len(starts), 1))
    episodes = simulator.reset(starts, np.full((len(starts), 3), 10.0))  # nothing reaches it
    actions = size * rng.normal(size=(len(starts), simulator.n_actions))
    refused = simulator.step(episodes, actions).collision
    ways = substeps(simulator.world, starts, episodes.target)
    tally.count("near contact", ways.shape[0] * ways.shape[1])
    return _check_ways(tally, simulator, ways, refused)


def _check_ways(
    tally: Tally, simulator: Simulator, ways: Array, refused: NDArray[np.bool_]
) -> Array:
    """Check that steps were refused where they touch something, and nowhere else."""
    asked = ways.reshape(-1, ways.shape[2])
    truth = simulator.world.contact_model.in_contact(asked).reshape(ways.shape[:2]).any(axis=1)
    _claim(tally, "a step that was made touches nothing", (~truth)[~refused], ways[~refused])
    _claim(tally, "a step that was refused touches something", truth[refused], ways[refused])
    tally.count("configurations", len(asked))
    tally.count("steps refused", refused.sum())
    return asked


def _ask_second_engine(tally: Tally, engine: SecondEngine, world: World, asked: Array) -> None:
    """Compare Coal's verdicts with the second engine's, and measure how far they are apart."""
    contact, gaps = world.contact_model, np.zeros(len(asked))
    truth = contact.in_contact(asked)
    other = np.array([engine.in_contact(q) for q in asked])
    for row in np.flatnonzero(truth != other):
        q = asked[row]
        pair = int(contact.first_in_contact(q) or 0)
        gaps[row] = engine.distance(q, pair) if truth[row] else engine.depth(q)
    tally.count("configurations of the second engine", len(asked))
    tally.count("touching for Coal alone", (truth & ~other).sum())
    tally.count("touching for MuJoCo alone", (other & ~truth).sum())
    tally.largest("gap where Coal alone sees contact [m]", gaps[truth].max(initial=0.0))
    tally.largest("depth where Coal alone sees none [m]", gaps[~truth].max(initial=0.0))
    claim = f"engines agree, but for {MARGIN:g} m about contact"
    _claim(tally, claim, np.abs(gaps) <= MARGIN, asked)


def _claim(tally: Tally, claim: str, holds: NDArray[np.bool_], asked: Array) -> None:
    tally.check(claim, holds, lambda row: {"configuration": asked[row].tolist()})
