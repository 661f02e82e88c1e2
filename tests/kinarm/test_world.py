"""What can be asked about configurations, held against Pinocchio and Coal."""

import numpy as np
import pytest
from configurations import contact_boundary, random_configurations, substeps

from kinarm.errors import InvalidInputError, ProblemError, UnknownNameError
from kinarm.problem import ReachProblem
from kinarm.scene import Obstacle, Scene
from kinarm.world import World

FALLING = np.deg2rad([0, 110, -60, 0, 0, 0])


def test_of_a_name_a_problem_or_a_file(tmp_path):
    problem = ReachProblem.load("left").replace(name="mine", arm="paper_flange")
    problem.save(tmp_path / "mine.toml")
    for given in ("left", problem, tmp_path / "mine.toml"):
        world = World(given, threads=1)
        assert world.problem == ReachProblem.load(given)
        assert world.arm.name == world.problem.arm.name
    with pytest.raises(UnknownNameError, match="problem 'up'; available: left, right, both"):
        World("up")


def test_screening_equals_pinocchio_and_coal(any_simulator):
    world = any_simulator.world
    q = random_configurations(any_simulator, 1, 1500)
    q = np.concatenate([q, *contact_boundary(any_simulator, 2, 400)])
    tools, touching = world.screen(q)
    np.testing.assert_array_equal(touching, world.contact_model.in_contact(q))
    assert 0.05 < touching.mean() < 0.95
    for configuration, tool in zip(q[:200], tools, strict=False):
        np.testing.assert_allclose(tool, world.arm.tool_position(configuration), atol=1e-12)


def test_threads_do_not_matter(simulator):
    q = random_configurations(simulator, 3, 3000)
    alone, together = (World(simulator.problem, threads=n).screen(q) for n in (1, 3))
    np.testing.assert_array_equal(alone[0], together[0])
    np.testing.assert_array_equal(alone[1], together[1])


@pytest.mark.parametrize(
    ("asked", "given", "message"),
    [
        ("observe", (np.zeros((2, 5)), np.zeros((2, 3))), r"must have shape \(n, 6\)"),
        ("distances", (np.zeros((2, 6)), np.zeros((1, 3))), r"goals must have shape \(2, 3\)"),
        ("contact_pair", (np.full(6, np.nan), np.zeros(6)), "configuration must be finite"),
        ("observe", (np.zeros((2, 6)), np.zeros((2, 3)), 65), r"steps taken .* in 0\.\.64"),
    ],
)
def test_bad_input(simulator, asked, given, message):
    with pytest.raises(InvalidInputError, match=message):
        getattr(simulator.world, asked)(*given)


def test_what_is_observed_is_the_beginning_of_an_episode(simulator):
    starts, goals = simulator.sample(np.random.default_rng(4), 50)
    episodes = simulator.reset(starts, goals)
    np.testing.assert_array_equal(simulator.world.observe(starts, goals), episodes.observation)
    np.testing.assert_array_equal(simulator.world.distances(starts, goals), episodes.distance)


def test_changed_worlds_are_as_if_built_so(simulator):
    world = World(simulator.problem, threads=1)
    assert world.goals.lower[:, 1].min() < 0.0
    left = world.changed(goal_regions=("left",))
    assert left.goals.lower[:, 1].min() > 0.0
    assert world.changed(goal={"kind": "pose"}).goal_width == 7
    with pytest.raises(ProblemError, match=r"task.starts\[0\] is in contact"):
        world.changed(starts=[np.deg2rad([0, 110, -60, 0, 0, 0]).tolist()])


class TestContact:
    def test_of_configurations(self, any_simulator):
        world, q = any_simulator.world, random_configurations(any_simulator, 6, 200)
        touching, pairs = world.in_contact(q), world.contact_pairs(q)
        np.testing.assert_array_equal(touching, world.contact_model.in_contact(q))
        for each, touches, pair in zip(q, touching, pairs, strict=True):
            assert pair == world.contact_pair(each)
            assert (pair is not None) == touches
            assert pair is None or pair in world.contact_model.pair_names

    def test_first_on_the_way_is_described(self, simulator):
        world = simulator.world
        contact = world.contact(np.zeros(6), FALLING)
        tested = substeps(world, np.zeros((1, 6)), FALLING[None])[0]
        touching = world.contact_model.in_contact(tested)
        first = tested[touching.argmax()]
        np.testing.assert_array_equal(contact.configuration, first)
        assert contact.pair == world.contact_pair(np.zeros(6), FALLING)
        assert contact.pair == world.contact_model.contact_pair(first)
        assert contact.point.shape == (3,)

    def test_ends_alone_do_not_tell(self, simulator):
        """A post stands in the middle of the way."""
        post = Obstacle(name="post", lower=(0.5, -0.01, 0), upper=(0.52, 0.01, 1))
        problem = simulator.problem.replace(scene=Scene(obstacles=(post,)))
        q, target = np.deg2rad([[-40, 0, 0, 0, 0, 0], [40, 0, 0, 0, 0, 0]])
        found = {
            n: World(problem.replace(tested_configurations=n), threads=1).contact_pair(q, target)
            for n in (1, 2, 16)
        }
        assert found[1] is None
        assert "post" in found[2]
        assert "post" in found[16]
