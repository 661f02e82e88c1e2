"""Branch and bound for shipped arms: searches that try to beat it."""

import numpy as np
import pytest
from proofs import aims_at, projected, prove_steps, within

from kinarm.policies.oracle.inverse import solve_within, step_box

CAPSULE_ARMS = ("lrmate200ic_5l", "paper", "paper_flange")


@pytest.fixture(scope="module", params=CAPSULE_ARMS)
def shipped(request, simulators):
    """A shipped arm, trials, and what is proven of them."""
    simulator = simulators[request.param]
    starts, goals = simulator.sample(np.random.default_rng(14), 40)
    return simulator, starts, goals, *prove_steps(simulator, starts, goals)[:2]


class TestSearchesDoNotBeatTheFloor:
    def test_descent_from_many_configurations(self, shipped):
        simulator, starts, goals, floors, tight = shipped
        assert not reached_within(simulator, starts, goals, floors - 1).any()
        found = reached_within(simulator, starts, goals, floors + 1)
        assert found[tight & (floors + 1 <= 64)].mean() > 0.9

    def test_contact_free_configurations(self, shipped):
        simulator, starts, goals, floors, _ = shipped
        # Lowered towards the bench, the tool reaches the tolerance only where the hand touches.
        goals = goals - [0, 0, 0.06]
        floors, _, _ = prove_steps(simulator, starts, goals)
        rows = np.flatnonzero(floors <= 64)[:24]
        starts, goals, floors = starts[rows], goals[rows], floors[rows]
        limits = {"fewest": floors, "most": np.minimum(floors + 8, 64)}
        counting, _, witnesses = prove_steps(
            simulator, starts, goals, contact=True, budget=20_000, **limits
        )
        assert (counting >= floors).all()
        raised = np.flatnonzero(counting > floors)
        assert raised.size > 0
        tolerances = np.full(raised.size, simulator.task.tolerance)
        sought = [part[raised] for part in (starts, goals, counting - 1)]
        found = solve_within(simulator, *sought, tolerances, witnesses[raised], 3000)
        assert len(found.owner) == 0
        assert reached_within(simulator, *sought).all()


def reached_within(simulator, starts, goals, steps):
    """Whether a descent from some of many configurations reaches the goal, contact ignored."""
    n, rng = len(starts), np.random.default_rng(17)
    box = step_box(simulator, starts, steps)
    begun = [within(box[0][i], box[1][i], starts[i], rng, 300) for i in range(n)]
    owner, radius = np.repeat(np.arange(n), 300), np.full(300 * n, simulator.task.tolerance)
    begun, aims = np.concatenate(begun), aims_at(simulator, goals)
    _, distances = projected(simulator, begun, owner, box, aims, radius)
    return (distances.reshape(n, -1) <= simulator.task.tolerance).any(axis=1)
