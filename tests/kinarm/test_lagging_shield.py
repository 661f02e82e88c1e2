"""Shields of joints that lag, and of bodies that move: what follows from a step counts."""

import numpy as np
import pytest
from random_scenes import among, swinging
from reference_episodes import held_actions

from kinarm.episodes import shield_table
from kinarm.kernels.plant import COMMAND, MOST_CHANGE, RATE, STEADY
from kinarm.plant import Plant
from kinarm.simulator import Simulator
from tests.helpers.reference_plant import ReferencePlant

PLANTS = {
    "hard": "hard",
    "slow": Plant(bandwidth=(2.0, 8.0), damping=(0.3, 2.0), calibration=0.05, delay=(0, 3)),
    "weak": Plant(bandwidth=(2.0, 20.0), acceleration=(20.0, 200.0), resolution=0.01),
    "late": Plant(delay=2, feedback="commanded"),
}


@pytest.fixture(params=PLANTS)
def simulator(request):
    return Simulator("right", threads=1).with_plant(PLANTS[request.param])


def drawn(simulator, count, seed=0):
    rng = np.random.default_rng(seed)
    starts, goals = simulator.sample(rng, count)
    return held_actions(simulator, rng, count), starts, goals


def test_no_motion_touches(simulator):
    given, shielded = drawn(simulator, 200), simulator.shielded()
    bare, safe = simulator.rollout_actions(*given), shielded.rollout_actions(*given, record=True)
    assert bare.collision.sum() > 20
    assert not safe.collision.any()
    # No verdict of Coal was needed: what is held was proven before.
    assert shielded.checked_by_coal == 0
    for row in np.flatnonzero(safe.interventions)[:15]:
        for step in np.flatnonzero(safe.replaced[row])[:8]:
            here, there = safe.paths[row, step : step + 2]
            assert simulator.world.contact(here, there) is None


def test_an_arm_may_stay_within_a_micrometre_of_contact(simulator):
    """There, a step counts as contact even if it leads nowhere."""
    start = np.array([[-2.646941661551418, 2.1704060311243802, 3.143250312650669]])
    start = np.append(start, [[-0.5147626012274045, -1.3051352492950334, 0.0]], axis=1)
    given = np.zeros((1, 64, 5)), start, np.array([[0.1, -0.66, 0.325]])
    assert simulator.rollout_actions(*given).collision
    assert not simulator.shielded().rollout_actions(*given).collision


def test_a_command_may_be_held_at_any_time(simulator):
    actions, starts, goals = drawn(simulator, 100, seed=1)
    shielded, still = simulator.shielded(), np.zeros((100, simulator.n_actions))
    episodes = shielded.reset(starts, goals)
    for step in range(40):
        shielded.step(episodes, actions[:, step])
        if step % 13 == 5:
            now = {"origins": starts, "taken": episodes.steps, "drive": episodes.drive}
            held = simulator.reset(episodes.q, goals, **now)
            for _ in range(64 - step):
                simulator.step(held, still)
            touched = simulator.world.contact_pairs(held.q[held.touched > 0])
            assert not held.touched.any(), touched


def test_replacements_are_shares_of_the_commands_step():
    simulator = Simulator("right").with_plant(Plant(bandwidth=10.0)).shielded()
    actions, starts, goals = drawn(simulator, 200, seed=2)
    episodes, arm, found = simulator.reset(starts, goals), simulator.arm, 0
    shares = np.concatenate([shield_table(5), np.zeros((1, 5))])
    for step in range(40):
        before, count = episodes.drive[:, COMMAND].copy(), episodes.interventions.copy()
        simulator.step(episodes, actions[:, step])
        for row in np.flatnonzero(episodes.interventions > count):
            move = before[row] + np.clip(actions[row, step], -1, 1) * simulator.step_limit
            move = np.clip(move, arm.lower[:5], arm.upper[:5]) - before[row]
            off = np.abs(before[row] + shares * move - episodes.drive[row, COMMAND]).max(axis=1)
            assert off.min() < 1e-12
            found += 1
    assert found > 50


def test_joints_settle_as_far_as_is_claimed(simulator):
    """From states where no limit acts, the reference goes no farther than |e| + swing / rate."""
    world, rng, n = simulator.world, np.random.default_rng(4), simulator.n_actions
    starts, goals = simulator.sample(rng, 16)
    numbers, tried = world.plants.of(starts, goals, 1), 0
    for start, goal, plant in zip(starts, goals, numbers, strict=True):
        joints = ReferencePlant(world, start, goal)
        rate, steady = plant[RATE], min(plant[STEADY], (simulator.step_limit / 0.02).min())
        swing = min(steady, 3.0) * rng.uniform(0, 1, n)
        angle = rng.uniform(0, 2 * np.pi, n)
        error = np.clip(swing * np.sin(angle) / rate, -0.3, 0.3)
        q = np.clip(start.copy(), world.arm.lower + 0.7, world.arm.upper - 0.7)
        # Told so long ago that it arrives.
        command = q[:n] + error - joints._calibration
        joints._commands = [command] * 40
        joints._velocity[:] = velocity = swing * np.cos(angle)
        claimed = np.abs(error) + np.sqrt(velocity**2 + (rate * error) ** 2) / rate
        moved = q
        for _ in range(60):
            moved = joints.moved(moved, np.zeros(n))
            # A command that is not held is rounded.
            rounding = plant[1] if plant[1] > 0 else 0.0
            assert (np.abs(moved - q)[:n] <= claimed * (1 + 1e-9) + rounding + 1e-12).all()
        tried += np.isfinite(plant[MOST_CHANGE]) or plant[STEADY] == np.inf
    assert tried == 16


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["ideal", Plant(bandwidth=20.0)])
def test_arms_stay_away_from_bodies_that_move(plant):
    simulator = Simulator(among("right", swinging(0.35)), threads=1).with_plant(plant)
    actions, starts, goals = drawn(simulator, 200)
    bare, safe = (
        each.rollout_actions(actions, starts, goals) for each in (simulator, simulator.shielded())
    )
    assert safe.collision.sum() < 0.5 * bare.collision.sum()
    if plant == "ideal":
        # An arm that would rest leaves.
        bare, safe = (
            each.rollout_actions(0 * actions, starts, goals)
            for each in (simulator, simulator.shielded())
        )
        assert safe.collision.sum() < 0.6 * bare.collision.sum()


@pytest.mark.rare
def test_hundreds_of_thousands_of_random_steps_touch_nothing():
    simulator = Simulator("right").with_plant("hard").shielded()
    steps = 0
    for seed in range(4):
        rollouts = simulator.rollout_actions(*drawn(simulator, 1000, seed=100 + seed))
        assert not rollouts.collision.any()
        steps += int(rollouts.steps.sum())
    assert steps > 250_000
