"""Reflection about the x-z plane, and policies that act in it."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from known_arms import INSTALLED, KNOWN_ARMS

from kinarm.arm import Arm
from kinarm.arm_specification import arm_names
from kinarm.errors import InvalidInputError
from kinarm.policies.library import load_policy
from kinarm.policies.mirror import (
    find_mirror,
    missing_mirror,
    obstacles_are_symmetric,
    problem_mirror,
)
from kinarm.policies.policy import Layer
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import problem_names
from kinarm.scene import Mount, Obstacle, Scene
from kinarm.simulator import Simulator
from kinarm.world import World

OPPOSITE = np.array([1, -1, 1])
REVERSED = np.array([-1, 1, 1, -1, 1, -1])
BOTH = PROBLEMS["both"]


@pytest.fixture(scope="module")
def mirror(simulator):
    return find_mirror(simulator.world)


@pytest.fixture(scope="module")
def situations(simulator):
    """Observations of random situations, goals on both sides."""
    return simulator.world.observe(*simulator.sample(np.random.default_rng(0), 400))


@pytest.fixture
def lopsided(shipped_arms, tmp_path):
    """The arm ``paper`` with one limit that its mirror image lacks."""
    text = shipped_arms["paper"].description.path.read_text()
    path = tmp_path / "lopsided.urdf"
    path.write_text(re.sub('lower="[^"]*"', 'lower="-2"', text, count=1))
    return Arm.load(path)


def reflected(starts, goals):
    return starts * REVERSED, goals * OPPOSITE


def lively(policy, gain):
    """The same policy with larger weights, so that its units saturate more or less."""
    layers = tuple(Layer(gain * layer.weights, layer.bias) for layer in policy.layers)
    return replace(policy, layers=layers)


class TestFindMirror:
    def test_axes_about_x_or_z_are_reversed(self, mirror):
        np.testing.assert_array_equal(mirror.actions, REVERSED[:5])
        np.testing.assert_array_equal(mirror.observations[:6], [1, -1, 1] * 2)
        np.testing.assert_array_equal(mirror.observations[6:30], [1, -1, 1, -1] * 6)
        np.testing.assert_array_equal(mirror.observations[30:], [1, -1, 1] * 6)

    @pytest.mark.parametrize("name", ["paper", "paper_flange", "lrmate200ic_5l"])
    def test_observations_of_mirror_images(self, simulators, name):
        simulator = simulators[name]
        mirror = find_mirror(simulator.world)
        starts, goals = simulator.sample(np.random.default_rng(0), 100)
        seen = simulator.world.observe(starts, goals)
        image = simulator.world.observe(*reflected(starts, goals))
        np.testing.assert_allclose(image, seen * mirror.observations, rtol=0, atol=1e-12)

    def test_is_checked_with_the_kinematics(self, simulators):
        with pytest.raises(InvalidInputError, match="'made' is not its own mirror image"):
            find_mirror(simulators["sliding"].world)

    def test_limits_count(self, lopsided):
        world = World(BOTH.replace(arm=lopsided))
        with pytest.raises(InvalidInputError, match="'lopsided' is not its own mirror image"):
            find_mirror(world)


class TestProblems:
    def test_obstacles_count_whether_goals_lie_on_them_or_not(self):
        right, left = Scene().obstacles
        higher = replace(right, upper=(*right.upper[:2], 0.31))
        assert not obstacles_are_symmetric(BOTH.replace(scene=Scene(obstacles=(left, higher))))
        assert not obstacles_are_symmetric(BOTH.replace(scene=Scene(obstacles=(left,))))
        middle = Obstacle(name="middle", lower=(0.5, -0.2, 0), upper=(0.7, 0.2, 0.3))
        three = Scene(obstacles=(left, middle, right))
        assert obstacles_are_symmetric(BOTH.replace(scene=three))
        assert obstacles_are_symmetric(BOTH.replace(scene=Scene(obstacles=())))

    @pytest.mark.parametrize(("size", "symmetric"), [(0.05, True), (0.03, False)])
    def test_a_post_that_is_turned_by_an_eighth(self, size, symmetric):
        """Its image is turned the other way, which is the same for a square one alone."""
        post = Obstacle(name="post", lower=(0.4, -size, 0), upper=(0.5, size, 1), yaw=np.pi / 4)
        scene = replace(Scene(), obstacles=(post,))
        assert obstacles_are_symmetric(BOTH.replace(scene=scene)) == symmetric

    def test_mirror_of_a_problem(self, lopsided, mirror):
        for problem in (BOTH, PROBLEMS["left"]):
            found = problem_mirror(problem)
            np.testing.assert_array_equal(found.observations, mirror.observations)
        (bench, _) = Scene().obstacles
        assert problem_mirror(BOTH.replace(scene=Scene(obstacles=(bench,)))) is None
        assert problem_mirror(BOTH.replace(arm=lopsided)) is None

    def test_why_there_is_none(self, lopsided):
        one_bench = PROBLEMS["left"].replace(scene=Scene(obstacles=Scene().obstacles[:1]))
        cases = (BOTH.replace(arm=lopsided), one_bench, PROBLEMS["left"])
        assert [missing_mirror(each) for each in cases] == [
            "arm 'lopsided' is not its own mirror image",
            "obstacles are not their own mirror image",
            "",
        ]

    def test_an_arm_that_stands_aside(self):
        aside, ahead = (
            BOTH.replace(scene=replace(Scene(), mount=Mount(position=position)))
            for position in ((0, 0.2, 0), (0.1, 0, 0.05))
        )
        assert missing_mirror(aside) == "arm 'paper' is not its own mirror image"
        assert missing_mirror(ahead) == ""


class TestMirroredPolicy:
    """On the left it does what the same policy without a mirror does on the right."""

    @pytest.mark.parametrize("hidden", [(), (6,), (6, 7), (9, 8, 7)])
    @pytest.mark.parametrize("gain", [1, 30])
    @pytest.mark.parametrize("function", ["linear", "tanh"])
    def test_acts_as_given_on_the_right_and_as_its_image_on_the_left(
        self, make_policy, mirror, situations, hidden, gain, function
    ):
        functions = (*["relu"] * len(hidden), function)
        policy = lively(make_policy(*hidden, constant=1, activations=functions), gain)
        mirrored = replace(policy, mirror=mirror)
        left = situations[:, 1] > 0
        assert 100 < left.sum() < 300
        right_actions = policy(situations[~left])
        assert right_actions.std(axis=0).max() > 1e-3
        np.testing.assert_array_equal(mirrored(situations[~left]), right_actions)
        image = policy(situations[left] * mirror.observations) * mirror.actions
        np.testing.assert_allclose(mirrored(situations[left]), image, rtol=0, atol=1e-14)

    @pytest.mark.parametrize("hidden", [(), (8, 8)])
    def test_compiled_rollouts_mirror_each_other(self, make_policy, mirror, simulator, hidden):
        policy = replace(lively(make_policy(*hidden, seed=1), 5), mirror=mirror)
        starts, goals = simulator.sample(np.random.default_rng(1), 200)
        first = simulator.rollout(policy, starts, goals, record=True)
        second = simulator.rollout(policy, *reflected(starts, goals), record=True)
        np.testing.assert_array_equal(first.collision, second.collision)
        np.testing.assert_array_equal(first.steps, second.steps)
        np.testing.assert_allclose(first.paths * REVERSED, second.paths, rtol=0, atol=1e-9)

    def test_called_compiled_and_reflected_by_hand_agree(self, make_policy, mirror, simulator):
        policy = make_policy(8, 7, seed=3)
        mirrored = replace(policy, mirror=mirror)

        def by_hand(seen):
            left = seen[:, 1:2] > 0
            actions = policy(np.where(left, seen * mirror.observations, seen))
            return np.where(left, actions * mirror.actions, actions)

        starts, goals = simulator.sample(np.random.default_rng(3), 100)
        found = [
            simulator.rollout(way, starts, goals, record=True)
            for way in (mirrored, lambda seen: mirrored(seen), by_hand)
        ]
        for other in found[1:]:
            np.testing.assert_array_equal(found[0].steps, other.steps)
            np.testing.assert_allclose(found[0].paths, other.paths, rtol=0, atol=1e-12)


SYMMETRIC_ARMS = {"lrmate200ic_5l", "paper", "paper_flange", "z1"}


def marks(arm):
    """Arms with meshes have to be installed; that others have no mirror takes longer to find."""
    installed = [INSTALLED] if arm in KNOWN_ARMS else []
    return installed if arm in SYMMETRIC_ARMS else [*installed, pytest.mark.rare]


class TestTransferByReflection:
    """What a policy does for goals on one side it does for those on the other, unseen."""

    @pytest.mark.parametrize("arm", [pytest.param(arm, marks=marks(arm)) for arm in arm_names()])
    def test_mirrored_trials_give_mirrored_trajectories(self, make_policy, arm):
        """In all shipped problems that are said to have a mirror with a shipped arm.

        Of learnt policies, and of one that turns at full speed. An arm without a mirror has none
        in any problem.
        """
        names = problem_names() if arm in SYMMETRIC_ARMS else problem_names()[:2]
        posed = [ReachProblem.load(name).replace(arm=arm) for name in names]
        seen = PROBLEMS["both"].observation, PROBLEMS["both"].task.goal
        shown = [each for each in posed if (each.observation, each.task.goal) == seen]
        symmetric = [problem for problem in shown if not missing_mirror(problem)]
        assert len(symmetric) >= 10 if arm in SYMMETRIC_ARMS else not symmetric
        learnt = load_policy("ppo-paper-both-seed0"), load_policy("ars-tuned-both-seed0")
        plain = *learnt, lively(make_policy(8, seed=4), 30)
        faced = [Simulator(problem, threads=1) for problem in symmetric]
        for simulator, policy in product(faced, plain):
            mirror = find_mirror(simulator.world)
            mirrored, signs = replace(policy, mirror=mirror), np.append(mirror.actions, 1)
            starts, goals = simulator.sample(np.random.default_rng(2), 50)
            first = simulator.rollout(mirrored, starts, goals, record=True)
            second = simulator.rollout(mirrored, starts * signs, goals * OPPOSITE, record=True)
            differing = (first.steps != second.steps) | (first.collision != second.collision)
            if arm in KNOWN_ARMS:  # whose meshes are their own image but for a millimetre
                assert differing.sum() <= 2
                assert (first.collision | second.collision)[differing].all()
            else:
                assert not differing.any()
            apart = np.abs(first.paths * signs - second.paths)
            both_move = np.minimum(first.steps, second.steps) - differing
            compared = np.arange(apart.shape[1]) <= both_move[:, None]
            assert apart[compared].max() <= 1e-12
