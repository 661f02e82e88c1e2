"""Proofs of the oracle, and configurations that are drawn to beat them."""

import numpy as np
import pytest
from simulators import changed

from kinarm.kernels.records import recorded
from kinarm.policies.oracle.bounding import Prover
from kinarm.policies.oracle.goals import Aims
from kinarm.policies.oracle.kernels.projection import damped_least_squares, layout
from tests.helpers.reference import ReferenceSimulator


def prove_steps(simulator, starts, goals, *, fewest=1, most=None, **settings):
    """Floors under the number of steps, whether they are tight, and witnesses."""
    n, witnesses = len(starts), starts.copy()
    last = simulator.task.horizon if most is None else most
    limits = (np.full(n, 1) * fewest, np.full(n, 1) * last)
    trials = (starts, goals, witnesses, np.arange(n))
    found = Prover(simulator).bound_steps(*trials, *limits, **settings)
    return *found, witnesses


def aims_at(simulator, goals):
    """What goals ask for, whatever joints that are not actuated do."""
    return Aims.of(simulator, np.zeros((len(goals), simulator.arm.n_joints)), goals, 0.0)


def projected(simulator, begun, owner, box, aims, radius):
    """Configurations moved towards goals by damped least squares, and their distances."""
    ended, distances = begun.copy(), np.empty(len(begun))
    moving = layout(begun.shape[1], box[0].shape[1], len(aims.turn.axes)).record()
    arrays = (owner, *box, aims.position, recorded(aims.turn), aims.wanted, radius)
    chain = simulator.world.records[0]
    damped_least_squares(0, len(begun), moving, chain, *arrays, ended, distances)
    return ended, distances


def within(lower, upper, start, rng, count):
    """Random configurations of a box: inside, on its faces and at its corners."""
    n = len(lower)
    shares = np.clip(rng.uniform(-0.5, 1.5, (count, n)), 0, 1)
    drawn = np.tile(start, (count, 1))
    drawn[:, :n] = lower + shares * (upper - lower)
    return drawn


def drawn(simulator, seed, count):
    return simulator.sample(np.random.default_rng(seed), count)


def assert_identical(first, second, rows=slice(None)):
    for name, array in vars(first).items():
        other = vars(second)[name]
        if name == "reasons":
            assert array[rows].tolist() == other.tolist()
        else:
            assert array[rows].tobytes() == other.tobytes(), name


def replayed(simulator, start, goal, actions):
    """A motion of the oracle, as the slow reference runs it: at four configurations a step."""
    simulator, left = changed(simulator, tested_configurations=4), iter(actions)
    reference = ReferenceSimulator(simulator)
    return reference.rollout(lambda _: next(left), start, goal, observed=False)


def assert_reference_agrees(oracle, starts, goals, known):
    for row, (start, goal) in enumerate(zip(starts, goals, strict=True)):
        episode = replayed(oracle.simulator, start, goal, known.actions[row])
        steps = known.steps[row]
        assert episode.contact is None
        assert episode.success == known.reachable[row]
        assert len(episode.rewards) == steps
        assert episode.distance == pytest.approx(known.final_distance[row], abs=1e-9)
        np.testing.assert_allclose(known.paths[row, : steps + 1], episode.path, rtol=0, atol=1e-9)
