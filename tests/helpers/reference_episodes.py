"""Episodes held against the slow reference, one at a time."""

import numpy as np

from tests.helpers.reference import ReferenceSimulator
from tests.helpers.simulators import changed


def scripted(table):
    """A policy that plays the rows of a table."""
    rows = iter(table)
    return lambda _: next(rows)


def assert_equal_outcome(simulator, rollouts, i, episode, atol=1e-12):
    steps = len(episode.rewards)
    assert rollouts.success[i] == episode.success
    assert rollouts.collision[i] == episode.collision
    assert rollouts.steps[i] == steps
    np.testing.assert_allclose(rollouts.paths[i, : steps + 1], episode.path, rtol=0, atol=atol)
    assert np.isnan(rollouts.paths[i, steps + 1 :]).all()
    np.testing.assert_allclose(rollouts.distance[i], episode.distance, rtol=0, atol=atol)
    np.testing.assert_allclose(rollouts.returns[i], episode.rewards.sum(), rtol=0, atol=atol)
    np.testing.assert_array_equal(rollouts.configurations[i], rollouts.paths[i, steps])
    if episode.collision:
        there = simulator.world.in_scene(rollouts.starts[i], rollouts.goals[i])
        refused = rollouts.configurations[i], rollouts.targets[i]
        pair = there.contact_pair(*refused, step=steps - 1)
        assert pair == episode.contact


def held_actions(simulator, rng, count, held=6):
    """Random actions of episodes, each held for some steps."""
    horizon = simulator.task.horizon
    blocks = rng.uniform(-1.5, 1.5, (count, -(-horizon // held), simulator.n_actions))
    return np.repeat(blocks, held, axis=1)[:, :horizon]


def compare_actions(simulator, seed, count, held=6, tested=4):
    """Successes, collisions and episodes that are alike, tested at few configurations a step.

    That is quick; 0 has the reference look at `tests.helpers.reference.SAMPLES` of each.
    """
    simulator = changed(simulator, tested_configurations=tested)
    rng = np.random.default_rng(seed)
    starts, goals = simulator.sample(rng, count)
    actions = held_actions(simulator, rng, count, held)
    rollouts = simulator.rollout_actions(actions, starts, goals, record=True)
    reference = ReferenceSimulator(simulator)
    for i in range(count):
        scenario = starts[i], goals[i]
        episode = reference.rollout(scripted(actions[i]), *scenario, observed=False)
        assert_equal_outcome(simulator, rollouts, i, episode)
    return np.array([rollouts.success.sum(), rollouts.collision.sum(), count])
