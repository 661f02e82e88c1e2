"""Scenarios of many arms: each arm's own, whichever of them take one together."""

import numpy as np
import pytest

from kinarm.scenarios import PREFETCHED, ScenarioQueues, draw_scenarios
from kinarm.world import World

ARMS = 5


@pytest.fixture(scope="module")
def world():
    return World("both", threads=1)


def generators():
    return [np.random.default_rng(seed) for seed in range(ARMS)]


def seeded_queues(world):
    queues = ScenarioQueues(world, ARMS)
    for row, rng in enumerate(generators()):
        queues.seed(row, rng)
    return queues


def scenarios_of(world, rng):
    while True:
        starts, goals = draw_scenarios(world, [rng], PREFETCHED)
        yield from zip(starts[0], goals[0], strict=True)


def test_each_arm_goes_through_its_own_stream(world):
    queues = seeded_queues(world)
    streams = [scenarios_of(world, rng) for rng in generators()]
    rng, dealt = np.random.default_rng(9), np.zeros(ARMS, dtype=int)
    q, goal = np.zeros((ARMS, 6)), np.zeros((ARMS, 3))
    while dealt.min() <= 2 * PREFETCHED:
        rows = np.flatnonzero(rng.random(ARMS) < 0.6)
        kept = q.copy(), goal.copy()
        queues.put(rows, q, goal)
        for row in range(ARMS):
            start, aim = next(streams[row]) if row in rows else (kept[0][row], kept[1][row])
            np.testing.assert_array_equal(q[row], start)
            np.testing.assert_array_equal(goal[row], aim)
        dealt[rows] += 1


def test_another_generator_begins_anew(world):
    queues, other = seeded_queues(world), seeded_queues(world)
    everyone, seen = np.arange(ARMS), np.zeros((2, ARMS, 6))
    goal = np.zeros((ARMS, 3))
    for _ in range(3):
        queues.put(everyone, seen[0], goal)
    queues.seed(2, np.random.default_rng(2))
    queues.put(everyone[2:3], seen[0], goal)
    other.put(everyone, seen[1], goal)
    np.testing.assert_array_equal(seen[0, 2], seen[1, 2])
    assert (seen[0, [0, 1, 3, 4]] != seen[1, [0, 1, 3, 4]]).any(axis=1).all()
