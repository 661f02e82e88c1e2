"""Scenes that differ from episode to episode."""

import gymnasium
import numpy as np
import pytest
from configurations import random_configurations
from numba import njit
from reference_episodes import compare_actions

from kinarm.bodies import Body, RandomBodies
from kinarm.episode_draws import scene_of_episode
from kinarm.errors import KinarmError
from kinarm.kernels.placing import uniform
from kinarm.meshes import coal_shape
from kinarm.policies import Oracle
from kinarm.problem import PROBLEMS
from kinarm.recording import record_rollouts
from kinarm.scene import PAPER_BENCHES, Mount, Scene
from kinarm.scene_draws import SceneDraws
from kinarm.simulator import Simulator
from kinarm.viewer import replay_page


def box_about(body):
    """Lower and upper corner of a box about a body, in its own frame, shape (2, 3) [m]."""
    shape = coal_shape(body)
    shape.computeLocalAABB()
    return np.array([shape.aabb_local.min_, shape.aabb_local.max_])


RANGE = {"lower": (-0.5, -0.5, 0.1), "upper": (0.5, 0.5, 0.7)}

BALLS = RandomBodies(
    name="ball", shape="sphere", count=(1, 4), smallest=(0.02,), largest=(0.08,), **RANGE
)
BLOCKS = RandomBodies(
    name="block",
    shape="box",
    count=(0, 3),
    smallest=(0.02, 0.03, 0.05),
    largest=(0.1, 0.1, 0.2),
    near="right bench",
    turned="yaw",
)
RODS = RandomBodies(
    name="rod",
    shape="capsule",
    smallest=(0.02, 0.1),
    largest=(0.03, 0.3),
    near="path",
    lower=(-0.05, -0.05, -0.05),
    upper=(0.05, 0.05, 0.05),
    turned="any",
)
CANS = RandomBodies(
    name="can", shape="cylinder", smallest=(0.02, 0.1), largest=(0.03, 0.3), near="left bench"
)
WEDGES = RandomBodies(
    name="wedge",
    shape="mesh",
    vertices=[(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)],
    turned="any",
    **RANGE,
)
ALL = (BALLS, BLOCKS, RODS, CANS, WEDGES)


def problem(*bodies, **changes):
    scene = Scene(obstacles=PAPER_BENCHES, random_bodies=bodies or ALL, **changes)
    return PROBLEMS["both"].replace(scene=scene)


@pytest.fixture(scope="module")
def changing():
    """A simulator of random bodies of every shape."""
    return Simulator(problem(), threads=1)


@pytest.fixture(scope="module")
def scenarios(changing):
    return changing.sample(np.random.default_rng(0), 1000)


@njit
def first_numbers(seed, count):
    state = np.array([seed], dtype=np.uint64)
    return [uniform(state) for _ in range(count)]


def test_the_generator_is_the_published_one():
    """The first outputs of SplitMix64 for this seed, of which 53 bits are kept."""
    outputs = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431]
    expected = [(each >> 11) * 2.0**-53 for each in outputs]
    np.testing.assert_array_equal(first_numbers(np.uint64(1234567), 4), expected)


class TestDraws:
    def test_number_sizes_and_places_are_uniform(self, changing, scenarios):
        rows = changing.world.scenes_of(*scenarios)
        balls = rows[:, 2:6]
        there = balls[..., 15] > -1
        counts = np.bincount(there.sum(axis=1), minlength=5)
        assert counts[0] == 0
        np.testing.assert_allclose(counts[1:] / len(rows), 0.25, atol=0.06)
        for values, low, high in (
            (balls[there][:, 3], 0.02, 0.08),
            *(
                (balls[there][:, 13 + k], *ends)
                for k, ends in enumerate(zip(*RANGE.values(), strict=True))
            ),
        ):
            assert low <= values.min() < low + 0.02 * (high - low)
            assert high >= values.max() > high - 0.02 * (high - low)
            np.testing.assert_allclose(values.mean(), (low + high) / 2, atol=0.04 * (high - low))

    def test_turns_are_uniform(self, changing, scenarios):
        rows = changing.world.scenes_of(*scenarios)
        turns = rows[:, -2, 4:13].reshape(-1, 3, 3)
        unit = np.tile(np.eye(3), (1000, 1, 1))
        np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), unit, atol=1e-12)
        np.testing.assert_allclose(turns.mean(axis=0), 0.0, atol=0.08)
        np.testing.assert_allclose((turns**2).mean(axis=0), 1 / 3, atol=0.04)

    def test_bodies_stand_on_what_they_are_near(self, changing, scenarios):
        for start, goal in zip(*(each[:50] for each in scenarios), strict=True):
            scene = scene_of_episode(changing.scene, changing.arm, start, goal)
            for body in scene.obstacles[2:]:
                height = body.position[2] + (body.rotation @ box_about(body).T).min(axis=1)[2]
                if body.name.startswith(("block", "can")):
                    bottom = body.position[2] + box_about(body)[0, 2]
                    assert bottom == pytest.approx(0.3, abs=1e-12)
                    side = -1 if body.name.startswith("block") else 1
                    assert 0.55 <= side * body.position[1] <= 0.75
                assert height < 1.2

    def test_bodies_on_the_path_are_near_it(self, changing, scenarios):
        tools = np.array([changing.arm.tool_position(q) for q in scenarios[0]])
        rods = changing.world.scenes_of(*scenarios)[:, 9, 13:]
        way = scenarios[1] - tools
        share = np.clip(((rods - tools) * way).sum(axis=1) / (way**2).sum(axis=1), 0, 1)
        assert np.linalg.norm(tools + share[:, None] * way - rods, axis=1).max() < 0.05 * 3**0.5
        np.testing.assert_allclose(share.mean(), 0.5, atol=0.1)

    def test_goals_are_clear(self, changing, scenarios):
        for start, goal in zip(*(each[:200] for each in scenarios), strict=True):
            scene = scene_of_episode(changing.scene, changing.arm, start, goal)
            for body in scene.obstacles[2:]:
                assert not body.contains(goal[None], 0.05 / 3**0.5).any()

    def test_another_seed_gives_other_scenes(self, changing, scenarios):
        scenes = changing.world.scenes_of(*scenarios)
        other = Simulator(problem(seed=1)).world.scenes_of(*scenarios)
        assert (other[:, 2:-1] != scenes[:, 2:-1]).any(axis=(1, 2)).all()


class TestEpisodes:
    def test_are_those_of_the_reference(self, changing):
        _, collisions, count = compare_actions(changing, 3, 60)
        assert 0.3 * count < collisions < count

    def test_claims_hold(self, changing, scenarios):
        world, q = changing.world, random_configurations(changing, 4, 1000)
        scenes = world.scenes_of(*scenarios)
        _, free, touching, _ = world.proven(q, scenes)
        found = world.contact_model.touching(q, scenes)
        assert not (free & found).any()
        assert not (touching & ~found).any()
        alone = [
            world.in_scene(*each).in_contact(q[i])
            for i, each in enumerate(zip(*scenarios, strict=True))
        ]
        np.testing.assert_array_equal(found, alone)

    def test_starts_are_free_in_their_scenes(self, changing, scenarios):
        scenes = changing.world.scenes_of(*scenarios)
        assert not changing.world.contact_model.touching(scenarios[0], scenes).any()

    def test_the_oracle_knows_each_scene(self, changing, scenarios):
        chosen = [each[:8] for each in scenarios]
        solutions = Oracle(changing.problem, threads=1).solve_batch(*chosen)
        replayed = changing.rollout_actions(solutions.actions, *chosen)
        np.testing.assert_array_equal(replayed.success, solutions.reachable)
        np.testing.assert_array_equal(replayed.steps, solutions.steps)
        assert (solutions.steps_lower_bound <= solutions.steps).all()
        bare = Oracle(PROBLEMS["both"], threads=1).solve_batch(*chosen)
        assert (solutions.steps_lower_bound >= bare.steps_lower_bound).all()
        assert solutions.steps.sum() > bare.steps.sum()

    def test_recordings_and_pages_show_what_was_there(self, changing, scenarios):
        actions = np.repeat(np.random.default_rng(5).uniform(-1, 1, (40, 8, 5)), 8, axis=1)
        chosen = [each[:40] for each in scenarios]
        rollouts = changing.rollout_actions(actions, *chosen, record=True)
        pairs = changing.contact_pairs(rollouts)
        numbers = [i for i, pair in enumerate(pairs) if pair and "ball" in pair[1]][:2]
        recordings = record_rollouts(changing, rollouts, "random", numbers)
        assert [each.contact for each in recordings] == [pairs[i] for i in numbers]
        assert "kinarm replay" in str(replay_page(recordings).html)


def test_environments_begin_in_the_scene_of_start_and_goal(changing, scenarios):
    pytest.importorskip("raylib")
    env = gymnasium.make("kinarm/Reach-v0", problem=changing.problem, render_mode="rgb_array")
    pictures = []
    for start, goal in zip(*(each[:2] for each in scenarios), strict=True):
        env.reset(options={"start": start, "goal": goal})
        np.testing.assert_array_equal(
            env.unwrapped._episodes.scenes, changing.world.scenes_of(start[None], goal[None])
        )
        pictures.append(env.render())
    assert (pictures[0] != pictures[1]).any()
    with pytest.raises(KinarmError, match="start and goal decide where random bodies are"):
        env.reset(options={"start": scenarios[0][0]})


def test_goals_are_reachable_where_a_task_asks_for_it():
    """The oracle finds nothing at some goals among walls, but at all that are drawn so."""
    walls = RandomBodies(
        name="wall",
        shape="box",
        count=(2, 2),
        smallest=(0.8, 0.02, 0.1),
        largest=(0.8, 0.02, 0.5),
        near="path",
        lower=(-0.2, 0.0, 0.0),
        upper=(0.2, 0.0, 0.2),
        clear_of_goal=0.0,
    )
    crowded = problem(walls)
    drawn = {}
    for asked in (False, True):
        simulator = Simulator(crowded.replace(reachable_goals=asked), threads=1)
        scenarios = simulator.sample(np.random.default_rng(1), 10)
        reasons = Oracle(simulator.problem, threads=1).solve_batch(*scenarios).reasons
        drawn[asked] = sum("configuration at the goal" in each for each in reasons)
    assert drawn[True] == 0 < drawn[False]


def test_goals_that_nothing_reaches_are_refused(monkeypatch):
    monkeypatch.setattr("kinarm.scenarios.START_ATTEMPTS", 5)
    scene = Scene(mount=Mount(position=(3.0, 0.0, 0.0)))
    far = PROBLEMS["both"].replace(reachable_goals=True, scene=scene)
    with pytest.raises(KinarmError, match="nothing free of contact is found at the goal"):
        Simulator(far).sample(np.random.default_rng(0), 10)


@pytest.mark.parametrize(
    ("shape", "size", "rpy"),
    [("sphere", (0.2,), (0, 0, 0)), ("box", (1, 1, 1), (0.1, 0, 0)), ("box", (1, 1, 1), (3, 0, 0))],
)
def test_they_stand_on_upright_boxes_alone(shape, size, rpy):
    below = Body(name="below", shape=shape, size=size, rpy=rpy)
    its = {"smallest": (0.1,), "largest": (0.1,), "near": "below"}
    standing = RandomBodies(name="it", shape="sphere", **its)
    with pytest.raises(KinarmError, match="'it' stand on 'below', which is no upright box"):
        SceneDraws.of(Scene(obstacles=(below,), random_bodies=(standing,)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape": "halfspace"}, "shape must be one of box, sphere, capsule, cylinder, mesh"),
        ({"count": (3, 1)}, "random bodies 'it': count goes from 3 to 1"),
        ({"smallest": (0.2,)}, "a size of smallest exceeds that of largest"),
        ({"lower": None}, "one of lower and upper only"),
        ({"near": "left bench", "turned": "any"}, "turned must be no or yaw"),
        ({"clear_of_goal": 5.0}, "no place clear of the goal found for one of random bodies 'it'"),
    ],
)
def test_impossible_ones_are_refused(changes, message):
    given = {"name": "it", "shape": "sphere", "smallest": (0.02,), "largest": (0.1,)} | RANGE
    with pytest.raises(KinarmError, match=message):
        Simulator(problem(RandomBodies(**given | changes))).sample(np.random.default_rng(0), 10)
