"""Bodies of a scene that move."""

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from configurations import random_configurations
from drawings import unpacked
from reference_episodes import compare_actions

from kinarm import BodyMotion
from kinarm.bodies import Body, RandomBodies
from kinarm.errors import KinarmError
from kinarm.policies import Oracle
from kinarm.policies.mirror import obstacles_are_symmetric
from kinarm.problem import PROBLEMS
from kinarm.recording import record_path, record_rollouts
from kinarm.scene import PAPER_BENCHES, Scene
from kinarm.simulator import Simulator
from kinarm.viewer import Renderer, replay_page

SWING = BodyMotion(
    waypoints=((0.4, 0.2, -0.2, 0.1), (0.7, 0.0, 0.3, 0.0), (1.2, 0, 0, 0)), periodic=True
)
FALL = BodyMotion(velocity=(-0.1, 0.05, -0.3))


def body(shape, position, motion, **given):
    return Body(name=shape, shape=shape, position=position, motion=motion, **given)


CORNERS = [(0, 0, 0), (0.2, 0, 0), (0, 0.2, 0), (0, 0, 0.2)]
PUSH, DRIFT = (BodyMotion(velocity=each) for each in ((0.7, 0, 0), (0.2, 0.1, 0)))
SOLID = (
    body("box", (0.5, 0.3, 0.5), SWING, size=(0.1, 0.2, 0.1), rpy=(0.3, 1, 0)),
    body("sphere", (-0.4, 0.3, 0.7), FALL, size=(0.06,)),
    body("capsule", (0.4, -0.4, 0.6), SWING, size=(0.05, 0.2), rpy=(1, 0, 0)),
    body("cylinder", (0.5, 0.0, 0.9), FALL, size=(0.06, 0.15)),
    body("halfspace", (-1.2, 0, 0), PUSH, rpy=(0, 1.3, 0)),
    body("mesh", (-0.5, -0.4, 0.5), DRIFT, vertices=CORNERS),
)
BALLS = RandomBodies(
    name="ball",
    shape="sphere",
    count=(1, 3),
    smallest=(0.02,),
    largest=(0.06,),
    lower=(0.2, -0.4, 0.3),
    upper=(0.6, 0.4, 0.8),
    motion=BodyMotion(velocity=(0.0, 0.3, -0.1)),
)


def problem(*bodies, **changes):
    scene = Scene(obstacles=(*PAPER_BENCHES, *bodies))
    return PROBLEMS["both"].replace(scene=scene, **changes)


def busy(**changes):
    everything = problem(*SOLID, **changes)
    return everything.replace(scene=replace(everything.scene, random_bodies=(BALLS,)))


@pytest.fixture(scope="module")
def changing():
    """A simulator of moving bodies of every shape, and of random ones."""
    return Simulator(busy(), threads=1)


@pytest.fixture(scope="module")
def passing():
    """A ball that passes through the upright arm at 1 m/s, from 0.5 m beside it."""
    ball = Body(
        name="ball",
        shape="sphere",
        size=(0.05,),
        position=(0.5, 0.0, 0.45),
        motion=BodyMotion(velocity=(-1.0, 0.0, 0.0)),
    )
    return Simulator(problem(ball, starts=[(0.0,) * 6]), threads=1)


@pytest.mark.parametrize(
    ("motion", "time", "offset"),
    [
        (FALL, 2.0, (-0.2, 0.1, -0.6)),
        (SWING, 0.2, (0.1, -0.1, 0.05)),
        (SWING, 0.55, (0.1, 0.05, 0.05)),
        (SWING, 1.2, (0, 0, 0)),
        (SWING, 1.4, (0.1, -0.1, 0.05)),
        (BodyMotion(waypoints=((1.0, 2.0, 0, 0),)), 0.25, (0.5, 0, 0)),
        (BodyMotion(waypoints=((1.0, 2.0, 0, 0),)), 5.0, (2, 0, 0)),
    ],
)
def test_motions_are_straight_between_waypoints(motion, time, offset):
    np.testing.assert_allclose(
        motion.offsets(np.array([0.0, time])), [(0, 0, 0), offset], atol=1e-15
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "either a velocity or waypoints"),
        ({"waypoints": [(2, 0, 0, 1), (1, 0, 0, 0)]}, "times of waypoints must rise"),
        ({"waypoints": [(1, 0, 0, 1)], "periodic": True}, "ends where it begins"),
        ({"velocity": (200, 0, 0)}, "velocities 100 m/s"),
        ({"waypoints": [(1, 0, 2e4, 0)]}, "at most 10000 m"),
    ],
)
def test_impossible_motions_are_refused(given, message):
    with pytest.raises(KinarmError, match=message):
        BodyMotion(**given)


class TestEpisodes:
    def test_are_those_of_the_reference(self, changing):
        _, collisions, count = compare_actions(changing, 3, 60, held=12)
        assert 0.3 * count < collisions < count

    def test_are_those_of_the_reference_for_the_whole_motion(self, monkeypatch):
        monkeypatch.setattr("tests.helpers.reference.SAMPLES", 300)
        assert compare_actions(Simulator(busy(horizon=20)), 5, 3, tested=0)[1] > 0

    def test_what_moves_meets_an_arm_that_rests(self, passing):
        """Where the ball has come is free at the last step, and touches in the next one."""
        world, start, goal = passing.world, np.zeros((1, 6)), np.array([(0.0, 0.65, 0.325)])
        rollouts = passing.rollout_actions(np.zeros((1, passing.task.horizon, 5)), start, goal)
        assert rollouts.collision[0]
        steps = int(rollouts.steps[0])
        assert passing.contact_pairs(rollouts)[0][1] == "ball"
        time_step, there = passing.problem.stepping.time_step, passing.scene.obstacles[-1]
        touches = []
        for time in (steps - 1) * time_step, steps * time_step:
            ball = replace(there, position=(0.5 - time, 0.0, 0.45), motion=None)
            touches.append(Simulator(problem(ball)).world.in_contact(start[0]))
        assert touches == [False, True]
        assert world.contact_pair(start[0], start[0], step=steps - 2) is None
        assert world.contact_pair(start[0], start[0], step=steps - 1)[1] == "ball"

    def test_what_moves_meets_the_first_link(self):
        """Where it begins, the first link never touches it, wherever its joint is."""
        ram = Body(
            name="ram",
            shape="box",
            size=(0.1, 0.1, 0.1),
            position=(1.2, 0.0, 0.17),
            motion=BodyMotion(velocity=(-2.0, 0.0, 0.0)),
        )
        simulator = Simulator(problem(ram), threads=1)
        start, goal = np.array([(0, -0.5, 0.3, 0, 0, 0)]), np.array([(0.0, 0.65, 0.325)])
        rollouts = simulator.rollout_actions(np.zeros((1, 64, 5)), start, goal)
        assert simulator.contact_pairs(rollouts) == (("shoulder", "ram"),)

    def test_go_on_where_bodies_are_by_then(self, passing):
        rest, goal = np.zeros((1, 5)), np.array([(0.0, 0.65, 0.325)])
        whole = passing.reset(np.zeros((1, 6)), goal)
        while whole.status[0] == 0:
            passing.step(whole, rest)
        later = passing.reset(np.zeros((1, 6)), goal, taken=whole.steps - 3)
        ends = [bool(passing.step(later, rest).collision[0]) for _ in range(3)]
        assert ends == [False, False, True]
        assert later.steps[0] == whole.steps[0]


class TestOracle:
    def test_motions_are_found_in_time(self):
        gate = Body(
            name="gate",
            shape="box",
            size=(1.0, 0.02, 0.6),
            position=(0.0, 0.35, 0.3),
            motion=BodyMotion(waypoints=((0.5, 0, 0, 0.8), (3.0, 0, 0, 0.8))),
        )
        moving, shut = (problem(replace(gate, motion=each)) for each in (gate.motion, None))
        trials = Simulator(problem()).sample(np.random.default_rng(0), 200)
        free = ~Simulator(shut).world.in_contact(trials[0]) & (trials[1][:, 1] > 0)
        chosen = [each[free][:6] for each in trials]
        found, stuck = (Oracle(each, threads=1).solve_batch(*chosen) for each in (moving, shut))
        replayed = Simulator(moving).rollout_actions(found.actions, *chosen)
        np.testing.assert_array_equal(replayed.success, found.reachable)
        assert found.reachable.sum() > stuck.reachable.sum()
        bare = Oracle(problem(), threads=1).solve_batch(*chosen)
        np.testing.assert_array_equal(found.steps_lower_bound, bare.steps_lower_bound)
        assert (found.steps_lower_bound <= found.steps).all()

    def test_its_world_has_nothing_that_moves(self, changing):
        starts, goals = changing.sample(np.random.default_rng(0), 300)
        alone = changing.in_scene(starts[0], goals[0]).world.without_moving_bodies()
        q = random_configurations(changing, 1, 2000)
        np.testing.assert_array_equal(alone.in_contact(q), Simulator(problem()).world.in_contact(q))

    def test_bodies_that_rest_are_all_that_random_scenes_then_have(self, changing):
        starts, goals = changing.sample(np.random.default_rng(0), 100)
        actions = np.repeat(np.random.default_rng(1).uniform(-1, 1, (100, 1, 5)), 64, axis=1)
        still, alone = changing.without_moving_bodies(), Simulator(problem(), threads=1)
        ends, free = (each.rollout_actions(actions, starts, goals) for each in (still, alone))
        np.testing.assert_array_equal(ends.configurations, free.configurations)
        assert still.contact_pairs(ends) == alone.contact_pairs(free)


class TestPictures:
    def test_recordings_and_pages_show_what_was_there(self, changing):
        rng = np.random.default_rng(5)
        chosen = changing.sample(rng, 60)
        actions = np.repeat(rng.uniform(-1, 1, (60, 8, 5)), 8, axis=1)
        rollouts = changing.rollout_actions(actions, *chosen, record=True)
        pairs = changing.contact_pairs(rollouts)
        numbers = [i for i, pair in enumerate(pairs) if pair and pair[1] != "ground"][:3]
        recordings = record_rollouts(changing, rollouts, "random", numbers)
        assert [each.contact for each in recordings] == [pairs[i] for i in numbers]
        trials = json.loads(unpacked(replay_page(recordings), "page"))["trials"]
        for trial, recording in zip(trials, recordings, strict=True):
            assert set(trial["moving"]) >= {f"obstacles/{number}" for number in range(2, 8)}
            times = np.arange(len(recording.states)) * changing.problem.stepping.time_step
            np.testing.assert_allclose(trial["moving"]["obstacles/2"], SWING.offsets(times))
        numbered = enumerate(recordings)
        assert all(f"trials/{k}/random/0" in trials[k]["moving"] for k, _ in numbered)

    def test_paths_meet_what_moves(self, passing):
        rest = record_path(passing.world, np.zeros((2, 6)), goal=(0.0, 0.65, 0.325))
        assert rest.outcome == "truncated"
        sway = np.zeros((40, 6))
        sway[1::2, 0] = 1e-3
        assert record_path(passing.world, sway, goal=(0.0, 0.65, 0.325)).contact[1] == "ball"

    def test_pictures_show_the_time(self, passing):
        pytest.importorskip("raylib")
        goal, q = (0.0, 0.65, 0.325), np.zeros(6)
        moved = replace(passing.scene.obstacles[-1], position=(0.3, 0.0, 0.45), motion=None)
        resting = Renderer(problem(moved), width=120, height=90).render(q, goal)
        renderer = Renderer(passing.problem, width=120, height=90)
        np.testing.assert_array_equal(renderer.render(q, goal, time=0.2), resting)
        assert (renderer.render(q, goal) != resting).any()

    def test_environments_show_it_too(self, passing):
        pytest.importorskip("raylib")
        env = gymnasium.make("kinarm/Reach-v0", problem=passing.problem, render_mode="rgb_array")
        _, _ = env.reset(seed=0)
        first = env.render()
        for _ in range(passing.task.horizon):
            _, _, terminated, _, info = env.step(np.zeros(5))
            if terminated:
                break
        assert env.unwrapped.contact_names[info["contact"]][1] == "ball"
        assert (env.render() != first).any()


def test_a_mirror_image_moves_in_mirror_image():
    box = replace(SOLID[0], rpy=(0, 0, 0))
    turned = BodyMotion(
        waypoints=((0.4, 0.2, 0.2, 0.1), (0.7, 0, -0.3, 0), (1.2, 0, 0, 0)), periodic=True
    )
    image = replace(box, name="image", position=(0.5, -0.3, 0.5), motion=turned)
    assert obstacles_are_symmetric(problem(box, image))
    assert not obstacles_are_symmetric(problem(box, replace(image, motion=SWING)))
