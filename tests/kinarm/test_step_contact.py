"""Contact at any time of a step's motion, and not at some of its configurations alone."""

import gymnasium
import numpy as np
import pytest
from configurations import pair_distances, random_configurations
from reference_episodes import compare_actions
from simulators import changed

from kinarm.arm import Arm
from kinarm.bodies import Body
from kinarm.problem import PROBLEMS
from kinarm.scene import Scene
from kinarm.simulator import Simulator
from kinarm.step_contact import _distances


@pytest.fixture(scope="module")
def pen(make_joint, make_collision, write_robot):
    """Simulators of a pen of 4 mm that slides 0.15 m a step, and a plate of 5 mm across its way."""
    limit = '<limit lower="-1" upper="1" velocity="7.5" effort="0"/>'
    slide = make_joint("prismatic", xyz="0 0 0.5", axis="1 0 0", limit=limit)
    shape = make_collision('<capsule radius="0.002" length="0.1"/>')
    arm = Arm.load(write_robot([slide], {1: shape}, tool="0 0 -0.05"))
    plate = Body(name="plate", shape="box", size=(0.005, 0.4, 0.4), position=(0.2, 0, 0.5))
    scene = Scene(obstacles=(plate,), goal_regions=Scene().goal_regions)
    problem = PROBLEMS["left"].replace(arm=arm, scene=scene)
    return [
        Simulator(problem.replace(tested_configurations=tested), threads=1) for tested in (4, 0)
    ]


def test_a_pen_never_passes_a_thin_plate(pen):
    starts = np.linspace(-0.9, 0.15, 100)[:, None]
    goals, actions = np.tile([0.0, 0.6, 0.6], (100, 1)), np.ones((100, 64, 1))
    discrete, whole = (each.rollout_actions(actions, starts, goals) for each in pen)
    assert discrete.collision.mean() == pytest.approx(0.25, abs=0.05)  # as the docs say
    assert whole.collision.all()
    # The step before the plate is made, and the next one refused.
    edge = 0.2 - 0.0025 - 0.002
    np.testing.assert_array_equal(whole.steps, np.floor((edge - starts[:, 0]) / 0.15 + 1e-9) + 1)
    assert whole.configurations.max() < edge
    assert set(pen[1].contact_pairs(whole)) == {("link_1", "plate")}
    contact = pen[1].world.contact([0.1], [0.25])
    np.testing.assert_allclose(contact.configuration, edge, atol=2e-6)
    assert pen[1].world.contact([0.0], [0.15]) is None


@pytest.mark.parametrize("name", ["paper", "sliding", "mesh", "bodies"])
def test_outcomes_are_those_of_many_configurations(simulators, name, monkeypatch):
    """Hundreds of a step, which lie half a millimetre apart."""
    monkeypatch.setattr("tests.helpers.reference.SAMPLES", 300)
    _, collisions, count = compare_actions(simulators[name], 13, 5, tested=0)
    assert 0 < collisions <= count


@pytest.mark.parametrize("name", ["paper", "mesh", "bodies"])
def test_it_refuses_all_that_the_discrete_rule_refuses(simulators, name):
    whole = changed(simulators[name], tested_configurations=0)
    starts, goals = whole.sample(np.random.default_rng(1), 400)
    blocks = np.random.default_rng(2).uniform(-1, 1, (400, 8, whole.n_actions))
    actions = np.repeat(blocks, 8, axis=1)
    few, all_of_it = (
        each.rollout_actions(actions, starts, goals) for each in (simulators[name], whole)
    )
    assert (all_of_it.steps <= few.steps)[all_of_it.collision].all()
    same = all_of_it.steps == few.steps
    assert all_of_it.collision[few.collision & same].all()
    assert few.collision.sum() <= all_of_it.collision.sum()
    for i in np.flatnonzero(all_of_it.collision)[:40]:
        contact = whole.world.contact(all_of_it.configurations[i], all_of_it.targets[i])
        distances = pair_distances(whole.world, contact.configuration[None])
        assert -1e-5 < distances.min() < 2e-6
        assert contact.pair == whole.world.contact_model.pair_names[int(distances.argmin())]


def test_environments_name_what_was_touched_first(pen):
    problem = pen[1].problem.replace(start_spread=0.0)
    env = gymnasium.make("kinarm/Reach-v0", problem=problem)
    env.reset(options={"start": [0.1], "goal": [0.0, 0.6, 0.325]})
    *_, terminated, _, info = env.step(np.ones(1, dtype=np.float32))
    assert terminated
    assert info["contact"] > 0
    assert env.unwrapped.contact_names[info["contact"]] == ("link_1", "plate")


def test_random_configurations_are_apart_or_touch_as_before(simulators):
    """What a configuration touches does not depend on how steps are tested."""
    q = random_configurations(simulators["paper"], 3, 2000)
    whole = changed(simulators["paper"], tested_configurations=0).world
    np.testing.assert_array_equal(whole.in_contact(q), simulators["paper"].world.in_contact(q))


def test_distances_do_not_depend_on_what_was_measured_before(simulators):
    """Of cylinders among others, whose distances Coal finds step by step."""
    model = simulators["sliding"].world.contact_model
    q = random_configurations(simulators["sliding"], 5, 60)
    order = np.random.default_rng(6).permutation(60)
    pairs = range(len(model.pair_names))
    there = np.array([_distances(model, each, pairs)[0] for each in q])
    again = np.array([_distances(model, each, pairs)[0] for each in q[order]])
    np.testing.assert_array_equal(again, there[order])
