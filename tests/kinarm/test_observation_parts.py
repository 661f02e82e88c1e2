"""Observations as a choice of the problem: each part against Pinocchio, Coal and by hand."""

from dataclasses import replace
from itertools import product, starmap

import coal
import numpy as np
import pinocchio as pin
import pytest
from configurations import random_configurations
from random_scenes import random_scene
from reference_episodes import held_actions, scripted

from kinarm import Observation, Plant, ReachProblem, Simulator
from kinarm.bodies import Body, RandomBodies
from kinarm.body_motion import BodyMotion
from kinarm.errors import InvalidInputError, KinarmError
from kinarm.goals import GOAL_RESTS, REST_ERRORS
from kinarm.kernels.surroundings import NEAR
from kinarm.networks import Layer, Networks
from kinarm.observation import OBSERVATION
from kinarm.observation_choice import CERTAIN
from kinarm.scene import Scene
from tests.helpers.reference import ReferenceSimulator

BOTH = ReachProblem.load("both")
OF_RESTS = (*GOAL_RESTS, *REST_ERRORS)
ALL = tuple(part.name for part in OBSERVATION if part.name not in OF_RESTS)
FALLING = RandomBodies(
    name="it",
    shape="box",
    count=(0, 3),
    smallest=(0.02, 0.03, 0.04),
    largest=(0.1, 0.2, 0.1),
    lower=(-0.6, -0.6, 0.6),
    upper=(0.6, 0.6, 1.2),
    turned="any",
    motion=BodyMotion(velocity=(0.1, 0.0, -0.2)),
)
SCENES = {
    "benches": Scene(),
    "moving": random_scene(3, 7, largest=0.25, moving=3),
    "random": Scene(random_bodies=(FALLING,)),
}

HARD = pytest.param("benches", "hard", marks=pytest.mark.slow)


def test_parts_that_need_no_table_are_in_it():
    assert {part.name for part in OBSERVATION} > set(CERTAIN)


def simulator_of(parts=ALL, problem=BOTH, **settings):
    """A simulator whose problem shows some parts."""
    fields = {
        name: settings.pop(name) for name in ("history", "obstacle_slots") if name in settings
    }
    # The reference looks at each of these configurations.
    settings = {"tested_configurations": 4, **settings}
    observation = Observation(parts=parts, **fields)
    return Simulator(problem.replace(observation=observation, **settings), threads=1)


def stepped(simulator, starts, goals, actions):
    """Observations of each step, shape (n_steps + 1, n, n_observations)."""
    episodes = simulator.reset(starts, goals)
    seen = [episodes.observation.copy()]
    for step in range(actions.shape[1]):
        simulator.step(episodes, actions[:, step])
        seen.append(episodes.observation.copy())
    return np.array(seen)


def part(simulator, seen, name):
    return seen[..., simulator.world.layout.places[name]]


def linear(simulator, seed):
    rng, shape = np.random.default_rng(seed), (1, simulator.n_actions, simulator.n_observations)
    return Networks((Layer(rng.normal(size=shape) / 8, np.zeros(shape[:2])),))


class TestReference:
    @pytest.mark.parametrize("scene", SCENES)
    @pytest.mark.parametrize("arm", ["paper", "lrmate200ic_5l"])
    def test_agrees_about_all_parts(self, scene, arm):
        settings = {"scene": SCENES[scene], "arm": arm, "horizon": 12}
        self.compare(simulator_of(history=3, obstacle_slots=5, **settings))

    @pytest.mark.slow
    @pytest.mark.parametrize("feedback", ["measured", "commanded"])
    def test_agrees_behind_a_plant(self, feedback):
        plant = replace(Plant.load("hard"), feedback=feedback)
        self.compare(simulator_of(history=2, scene=SCENES["moving"], horizon=12, plant=plant))

    def test_agrees_about_an_arm_that_slides(self, simulators):
        problem = simulators["sliding"].problem.replace(horizon=12)
        chosen = [name for name in reversed(ALL) if name != "joint_angles"]
        self.compare(simulator_of(chosen, problem))

    def compare(self, simulator):
        rng = np.random.default_rng(0)
        starts, goals = simulator.sample(rng, 12)
        actions = held_actions(simulator, rng, 12)
        seen, reference = stepped(simulator, starts, goals, actions), ReferenceSimulator(simulator)
        for i, start in enumerate(starts):
            found = reference.rollout(scripted(actions[i]), start, goals[i]).observations
            np.testing.assert_allclose(seen[: len(found), i], found, rtol=0, atol=1e-12)

    def test_compiled_networks_see_them(self):
        simulator = simulator_of(scene=SCENES["random"], history=2, horizon=20)
        networks, scenarios = linear(simulator, 3), simulator.sample(np.random.default_rng(1), 12)
        rollouts, reference = simulator.rollout(networks, *scenarios), ReferenceSimulator(simulator)
        weights = networks.layers[0].weights[0]
        for i, scenario in enumerate(zip(*scenarios, strict=True)):
            episode = reference.rollout(lambda seen: np.einsum("ji,i->j", weights, seen), *scenario)
            assert len(episode.rewards) == rollouts.steps[i]
            np.testing.assert_allclose(rollouts.distance[i], episode.distance, rtol=0, atol=1e-10)


class TestProximity:
    @pytest.mark.parametrize("name", ["paper", "mesh", "bodies"])
    def test_is_a_lower_bound_of_coals_distance(self, simulators, name):
        problem = simulators[name].problem
        simulator = simulator_of(("proximity",), problem)
        world, model = simulator.world, simulator.arm.model
        q = random_configurations(simulator, 5, 120)
        q = q[~world.in_contact(q)]
        seen = world.observe(q, np.zeros((len(q), 3))).reshape(len(q), simulator.arm.n_joints, -1)
        geometry, of_arm = world.contact_model.geometry.copy(), simulator.arm.geometry.ngeoms
        links = [g.parentJoint for g in geometry.geometryObjects]
        # Also pairs that are not tested, since they never touch; but not of the first link.
        above = [k for k in range(of_arm) if links[k] > 1]
        for pair in starmap(pin.CollisionPair, product(above, range(of_arm, len(links)))):
            if not geometry.existCollisionPair(pair):
                geometry.addCollisionPair(pair)
        data, gaps = geometry.createData(), []
        for k, configuration in enumerate(q):
            pin.computeDistances(model, model.createData(), geometry, data, configuration)
            nearest = np.full(simulator.arm.n_joints, NEAR)
            for pair, found in zip(geometry.collisionPairs, data.distanceResults, strict=True):
                first, second = sorted((pair.first, pair.second))
                if first < of_arm <= second and links[first]:
                    link = links[first] - 1
                    nearest[link] = min(nearest[link], found.min_distance)
            gaps += (nearest - seen[k, :, 0])[nearest < NEAR].tolist()
            assert (seen[k, :, 0] <= nearest + 1e-9).all()
        assert np.median(gaps) < 1e-3
        assert np.quantile(gaps, 0.9) < 0.02
        norms = np.linalg.norm(seen[..., 1:4], axis=-1)
        np.testing.assert_allclose(norms, seen[..., 0] < NEAR, rtol=0, atol=1e-9)
        assert not seen[seen[..., 0] == NEAR][:, 1:].any()

    def test_points_away_from_the_body(self):
        ball = Body(name="ball", shape="sphere", size=(0.1,), position=(0.625, 0.0, 1.0))
        scene = replace(Scene(), obstacles=(ball,), ground=False)
        simulator = simulator_of(("proximity",), scene=scene)
        *_, hand = simulator.world.observe(np.zeros((1, 6)), np.zeros((1, 3))).reshape(6, -1)
        assert 0 < hand[0] < 0.2
        assert hand[3] < -0.9  # down, from the ball above the hand

    def test_slopes_are_what_joints_add_to_distances(self):
        """Distances of links from a ball, before and after small moves."""
        ball = Body(name="ball", shape="sphere", size=(0.1,), position=(0.5, 0.1, 0.8))
        scene = replace(Scene(), obstacles=(ball,), ground=False)
        simulator = simulator_of(("proximity",), scene=scene)
        q = random_configurations(simulator, 6, 40)[:40]
        seen = simulator.world.observe(q, np.zeros((40, 3))).reshape(40, 6, 9)
        limit, share = simulator.world.rules.step_limit, 1e-4
        for joint in range(5):
            moved = q.copy()
            moved[:, joint] += share * limit[joint]
            there = simulator.world.observe(moved, np.zeros((40, 3))).reshape(40, 6, 9)
            near = (seen[..., 0] > 0) & (seen[..., 0] < NEAR) & (there[..., 0] < NEAR)
            assert near.sum() > 40
            added = (there[..., 0] - seen[..., 0])[near] / share
            assert np.quantile(np.abs(added - seen[..., 4 + joint][near]), 0.9) < 2e-3


class TestObstacles:
    def test_are_sorted_by_their_distance_from_the_tool(self):
        simulator = simulator_of(("obstacles", "goal_minus_tool"), obstacle_slots=3)
        seen = simulator.world.observe(np.zeros((2, 6)), np.zeros((2, 3)))
        right, left, none = part(simulator, seen, "obstacles")[0].reshape(3, 12)
        tool = np.array([0.625, 0.0, 0.705])
        np.testing.assert_allclose(right[:3], np.array([0, -0.65, 0.15]) - tool, atol=1e-12)
        np.testing.assert_allclose(left[:3], np.array([0, 0.65, 0.15]) - tool, atol=1e-12)
        np.testing.assert_allclose(left[3:6], [0.5, 0.1, 0.15], atol=1e-15)
        np.testing.assert_array_equal(left[6:], [1, 0, 0, 0, 1, 0])
        np.testing.assert_array_equal(none, 0)

    def test_are_inside_their_boxes(self):
        """Points of Coal's shapes, in slots of all bodies."""
        scene = random_scene(4, 6, shapes=("box", "sphere", "capsule", "cylinder", "mesh"))
        simulator = simulator_of(("obstacles",), scene=scene, obstacle_slots=6)
        q, model = random_configurations(simulator, 2, 1), simulator.world.contact_model
        tool = simulator.world.poses(q)[0, :3, 3]
        slots = simulator.world.observe(q, np.zeros((1, 3)))[0].reshape(6, 12)
        centres = slots[:, :3] + tool
        for shape in list(model.geometry.geometryObjects)[simulator.arm.geometry.ngeoms :]:
            if isinstance(shape.geometry, coal.Halfspace):
                continue
            shape.geometry.computeLocalAABB()
            middle = shape.placement.act(shape.geometry.aabb_local.center())
            row = np.linalg.norm(centres - middle, axis=1).argmin()
            extent = np.ptp(
                [shape.geometry.aabb_local.min_, shape.geometry.aabb_local.max_], axis=0
            )
            np.testing.assert_allclose(2 * slots[row, 3:6], extent, atol=1e-12)
            columns = shape.placement.rotation[:, :2].T.ravel()
            np.testing.assert_allclose(slots[row, 6:], columns, atol=1e-12)


class TestMemory:
    def test_last_action_velocity_and_time_by_hand(self):
        parts = ("last_action", "joint_velocities", "time_left", "commanded")
        simulator = simulator_of(parts, horizon=4)
        actions = np.array([[[0.5, -2.0, 0, 0, 0.1], [0, 0, 1, 0, 0]]])
        seen = stepped(simulator, np.zeros((1, 6)), np.array([[0.0, 5, 0]]), actions)[:, 0]
        clipped = [[0] * 5, [0.5, -1, 0, 0, 0.1], [0, 0, 1, 0, 0]]
        np.testing.assert_array_equal(part(simulator, seen, "last_action"), clipped)
        velocities = part(simulator, seen, "joint_velocities")
        np.testing.assert_allclose(velocities, clipped, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(part(simulator, seen, "time_left")[:, 0], [1, 0.75, 0.5])
        moved = np.cumsum(clipped, axis=0) * simulator.step_limit
        commanded = part(simulator, seen, "commanded")
        np.testing.assert_allclose(commanded[:, :5], moved, rtol=0, atol=1e-12)

    def test_history_has_the_last_step_first(self):
        plain, stacked = (
            simulator_of(("joint_positions",)),
            simulator_of(("joint_positions",), history=4),
        )
        starts, goals = plain.sample(np.random.default_rng(0), 9)
        actions = 0.1 * held_actions(plain, np.random.default_rng(1), 9)[:, :6]
        once, often = (stepped(each, starts, goals, actions) for each in (plain, stacked))
        rows = np.diff(once, axis=0).any(axis=2).all(axis=0)  # which did not end
        assert rows.any()
        for age in range(4):
            for step in range(7):
                expected = once[max(step - age, 0), rows]
                np.testing.assert_array_equal(often[step, rows, 6 * age : 6 * age + 6], expected)


class TestDeterminism:
    def test_threads_batches_and_resets_do_not_matter(self):
        simulator = simulator_of(scene=SCENES["random"], history=3)
        starts, goals = simulator.sample(np.random.default_rng(0), 70)
        networks, shift = linear(simulator, 4), np.zeros(simulator.n_observations)
        whole = simulator.rollout(networks, starts, goals, shift=shift)
        shared = Simulator(simulator.problem, threads=3).rollout(
            networks, starts, goals, shift=shift
        )
        for name, array in vars(whole).items():
            np.testing.assert_array_equal(array, getattr(shared, name))
        for i in (3, 50):
            row = slice(i, i + 1)
            alone = simulator.rollout(networks, starts[row], goals[row], shift=shift)
            np.testing.assert_array_equal(alone.moments[0], whole.moments[i])
        begun = simulator.reset(starts, goals).observation
        np.testing.assert_array_equal(simulator.world.observe(starts, goals), begun)

    def test_one_after_the_other_equals_at_once(self):
        """A table of actions, a function and steps."""
        simulator = simulator_of(history=2, scene=SCENES["moving"])
        starts, goals = simulator.sample(np.random.default_rng(0), 30)
        networks = linear(simulator, 5)
        weights = networks.layers[0].weights[0]
        compiled = simulator.rollout(networks, starts, goals)
        called = simulator.rollout(
            lambda seen: np.einsum("ji,ni->nj", weights, seen), starts, goals
        )
        np.testing.assert_array_equal(compiled.steps, called.steps)
        np.testing.assert_allclose(compiled.distance, called.distance, rtol=0, atol=1e-9)


class TestBounds:
    @pytest.mark.parametrize(("scene", "plant"), [*((name, "ideal") for name in SCENES), HARD])
    def test_contain_all_that_is_seen(self, scene, plant):
        from kinarm.envs.environment import state_bounds

        simulator = simulator_of(scene=SCENES[scene], history=2, plant=plant)
        low, high = state_bounds(simulator)
        starts, goals = simulator.sample(np.random.default_rng(0), 40)
        actions = held_actions(simulator, np.random.default_rng(1), 40)[:, :20]
        seen = stepped(simulator, starts, goals, actions)
        assert (seen >= low).all()
        assert (seen <= high).all()

    def test_contain_first_commands_and_actions_of_a_shield(self):
        from kinarm.envs.environment import state_bounds

        plant = Plant(delay=(0, 2), calibration=0.2, feedback="commanded")
        parts = ("joint_velocities", "last_action", "commanded")
        simulator = simulator_of(parts, plant=plant, shield=True)
        starts, goals = simulator.sample(np.random.default_rng(0), 80)
        starts[:, 0] = simulator.arm.lower[0]
        free = ~simulator.world.in_contact(starts)
        actions = held_actions(simulator, np.random.default_rng(1), 80)[free, :20]
        actions[:, 0, 0] = 1.0
        low, high = state_bounds(simulator)
        seen = stepped(simulator, starts[free], goals[free], actions)
        assert (seen >= low).all()
        assert (seen <= high).all()


class TestProblem:
    def test_the_papers_list_is_the_default(self):
        paper = BOTH.replace(observation=["goal", "goal_minus_tool", "orientation", "position"])
        assert paper == BOTH
        assert paper.digest == BOTH.digest
        assert "observation" not in BOTH.to_json()

    def test_round_trip(self, tmp_path):
        chosen = Observation(parts=("goal", "obstacles"), obstacle_slots=2, history=5)
        problem = BOTH.replace(observation=chosen)
        assert problem.digest != BOTH.digest
        problem.save(tmp_path / "mine.toml")
        assert ReachProblem.load(tmp_path / "mine.toml").digest == problem.digest
        assert problem.replace(observation={"history": 1}).observation == replace(chosen, history=1)

    @pytest.mark.parametrize(
        "text",
        ['observation = ["goal", "time_left"]', '[observation]\nparts = ["goal", "time_left"]'],
    )
    def test_in_a_file(self, tmp_path, text):
        (tmp_path / "mine.toml").write_text(f'base = "both"\n{text}\n')
        problem = ReachProblem.load(tmp_path / "mine.toml")
        assert problem.observation == Observation(parts=("goal", "time_left"))
        assert Simulator(problem, threads=1).n_observations == 4

    @pytest.mark.parametrize(
        ("observation", "message"),
        [
            (["goal", "goals"], "unknown part of the observation 'goals' .did you mean 'goal'"),
            (["goal", "goal"], "the observation has the part 'goal' twice"),
            ([], "an observation needs parts; available: goal, "),
            ({"history": 1000}, "history must be at most 32, got 1000"),
            ({"history": 0}, "history must be a whole number of at least 1, got 0"),
            ({"obstacle_slots": 0}, "obstacle_slots must be a whole number of at least 1, got 0"),
            ({"obstacle_slots": 100}, "obstacle_slots must be at most 32, got 100"),
            ({"part": ["goal"]}, "unknown field of an observation 'part'"),
            ("goal", "observation must be a table, got 'goal'"),
        ],
    )
    def test_bad_choices_are_refused(self, observation, message):
        with pytest.raises(KinarmError, match=message) as refused:
            BOTH.replace(observation=observation)
        assert "\n" not in str(refused.value)

    @pytest.mark.parametrize(
        ("part", "scene", "message"),
        [
            ("obstacles", Scene(obstacles=()), "has no bodies but half-spaces"),
            ("proximity", Scene(obstacles=(), ground=False), "has neither bodies nor ground"),
        ],
    )
    def test_what_a_scene_cannot_show(self, part, scene, message):
        with pytest.raises(KinarmError, match=f"cannot have '{part}': the scene {message}"):
            simulator_of((part,), scene=scene)

    def test_what_an_arm_cannot_show(self, simulators):
        with pytest.raises(KinarmError, match="'joint_angles': joint .* slides"):
            simulator_of(("joint_angles",), simulators["sliding"].problem)

    def test_networks_of_other_observations_are_refused(self):
        simulator = simulator_of(("goal",))
        with pytest.raises(InvalidInputError, match="the policy maps 48 observations"):
            simulator.rollout(linear(simulator_of(None), 0), np.zeros((1, 6)), np.ones((1, 3)))
