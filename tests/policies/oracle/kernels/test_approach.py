"""Branch and bound: closed forms and grids of a planar arm."""

from functools import cache

import numpy as np
import pytest
from configurations import depths
from proofs import prove_steps

from kinarm.arm import Arm
from kinarm.problem import PROBLEMS
from kinarm.scene import Obstacle, Scene
from kinarm.simulator import Simulator

INNER, OUTER, HEIGHT = 0.5, 0.3, 0.4
"""Lengths of the planar arm's links, and the height of the plane [m]."""

TOLERANCE = 0.02

GRID = 10_001


def turning_joints(make_joint):
    limit = '<limit lower="-3.3" upper="3.3" velocity="3" effort="0"/>'
    return [make_joint(xyz=xyz, limit=limit) for xyz in (f"0 0 {HEIGHT}", f"{INNER} 0 0")]


def planar_simulator(arm, scene=None, **settings):
    problem = PROBLEMS["left"].replace(arm=arm, scene=scene, tolerance=TOLERANCE, **settings)
    return Simulator(problem, threads=1)


@pytest.fixture(scope="module")
def planar(make_joint, write_robot):
    """Two links in a horizontal plane, without shapes; the axes turn by 0.06 rad a step."""
    return planar_simulator(Arm.load(write_robot(turning_joints(make_joint), tool=f"{OUTER} 0 0")))


@pytest.fixture(scope="module")
def walled(make_joint, make_collision, write_robot):
    """The planar arm with capsules for links, beside a wall that it reaches with both."""
    shapes = {
        k + 1: make_collision(
            f'<capsule radius="0.03" length="{length}"/>',
            xyz=f"{length / 2} 0 0",
            rpy="0 1.5707963267948966 0",
        )
        for k, length in enumerate((INNER, OUTER))
    }
    wall = Obstacle(name="wall", lower=(-1, 0.3, 0), upper=(1, 0.5, 1))
    arm = Arm.load(write_robot(turning_joints(make_joint), shapes, tool=f"{OUTER} 0 0"))
    return planar_simulator(arm, Scene(obstacles=(wall,)))


def planar_goals(rng, count, nearest=0.0, farthest=INNER + OUTER, height=0.0):
    """Goals in a ring, at most so far from the plane."""
    angle, radius = rng.uniform(-np.pi, np.pi, count), rng.uniform(nearest, farthest, count)
    return goals_at(radius * np.exp(1j * angle), height * rng.uniform(-1, 1, count))


def goals_at(points, above=0.0):
    """Goals at complex numbers, in the plane or above it."""
    return np.stack([points.real, points.imag, HEIGHT + above + 0 * points.real], axis=1)


def ring_distance(goals):
    """Distance from the ring that the planar arm reaches."""
    radius = np.hypot(goals[:, 0], goals[:, 1])
    aside = np.fmax(np.fmax(radius - (INNER + OUTER), (INNER - OUTER) - radius), 0)
    return np.hypot(aside, goals[:, 2] - HEIGHT)


def planar_tools(first, second):
    elbow = INNER * np.exp(1j * first)
    return elbow + OUTER * np.exp(1j * (first + second))


def planar_distance(lower, upper, goal):
    """Smallest distance over a box: a grid of the first axis, the best second one for each.

    Also how much smaller the true one may be.
    """
    first = np.linspace(lower[0], upper[0], GRID)
    towards = np.angle((goal[0] + 1j * goal[1]) - INNER * np.exp(1j * first)) - first
    # Whichever turn of the best angle lies in the interval, or else the closer end.
    candidates = [np.full(GRID, lower[1]), np.full(GRID, upper[1])]
    candidates += [np.clip(towards + 2 * np.pi * k, lower[1], upper[1]) for k in range(-2, 3)]
    away = [np.abs(planar_tools(first, q) - (goal[0] + 1j * goal[1])) for q in candidates]
    error = (INNER + OUTER) * (first[1] - first[0]) / 2
    return np.hypot(np.min(away), goal[2] - HEIGHT), error


def planar_steps(start, goal):
    """Fewest steps of 64 by the grid of distances, else 65: with its error allowed, and without."""

    @cache
    def distance(steps):
        lower, upper = np.fmax(start - 0.06 * steps, -3.3), np.fmin(start + 0.06 * steps, 3.3)
        return planar_distance(lower, upper, goal)

    def fewest(allowance):
        few, many = 0, 65
        while many - few > 1:
            steps = (few + many) // 2
            least, error = distance(steps)
            few, many = (few, steps) if least - allowance * error <= TOLERANCE else (steps, many)
        return many

    return fewest(1), fewest(0)


class TestPlanarSteps:
    def test_equal_those_of_an_exhaustive_grid(self, planar):
        rng = np.random.default_rng(6)
        starts = rng.uniform(-3.3, 3.3, (60, 2))
        goals = planar_goals(rng, 60, 0.15, 0.85, height=TOLERANCE)
        floors, tight, witnesses = prove_steps(planar, starts, goals)
        assert tight.all()
        trials = zip(starts, goals, strict=True)
        possible, steps = np.array([planar_steps(*trial) for trial in trials]).T
        assert (floors <= steps).all()
        assert (floors >= possible).all()
        assert (floors == steps).mean() > 0.95
        assert len(set(floors.tolist())) > 20
        found = floors <= 64
        assert 0.5 < found.mean() < 1
        moved = np.abs(witnesses - starts).max(axis=1) / 0.06
        assert (moved[found] <= floors[found] + 1e-6).all()
        tools = np.array([planar.arm.tool_position(q) for q in witnesses])
        assert (np.linalg.norm(tools - goals, axis=1)[found] <= TOLERANCE).all()

    def test_goals_that_full_steps_just_reach_are_decided(self, planar):
        rng = np.random.default_rng(10)
        starts, steps = rng.uniform(-3, 3, (1000, 2)), rng.integers(1, 6, 1000)
        sides, ends = rng.choice([-1, 1], (1000, 2)), starts.copy()
        for k in range(5):
            ends += np.where(k < steps[:, None], sides * planar.step_limit, 0)
        towards = np.exp(1j * rng.uniform(-np.pi, np.pi, 1000))
        goals = goals_at(planar_tools(*ends.T) + TOLERANCE * towards)
        # Either axis comes closer only beyond its last step.
        speeds = [1j * planar_tools(*ends.T), 1j * OUTER * np.exp(1j * ends.sum(axis=1))]
        nearer = sides.T * np.real(np.conj(towards) * speeds)
        kept = (nearer > 0.1).all(axis=0) & (planar.world.distances(ends, goals) <= TOLERANCE)
        floors, tight, _ = prove_steps(planar, starts[kept], goals[kept])
        assert kept.sum() > 50
        assert tight.all()
        np.testing.assert_array_equal(floors, steps[kept])

    def test_goals_that_a_stretched_arm_just_reaches_are_not_ruled_out(self, planar):
        rng = np.random.default_rng(11)
        ends = np.stack([rng.uniform(-3, 3, 400), np.zeros(400)], axis=1)
        goals = goals_at((INNER + OUTER + TOLERANCE) * np.exp(1j * ends[:, 0]))
        starts = ends + rng.uniform(-0.3, 0.3, (400, 2))
        kept = planar.world.distances(ends, goals) <= TOLERANCE
        floors, _, _ = prove_steps(planar, starts[kept], goals[kept])
        steps = np.ceil(np.abs(ends - starts).max(axis=1) / 0.06)
        assert kept.sum() > 50
        np.testing.assert_array_equal(floors, steps[kept])

    def test_unreachable_goals(self, planar):
        starts = np.random.default_rng(7).uniform(-3.3, 3.3, (20, 2))
        goals = planar_goals(np.random.default_rng(8), 20, 0.83, 2)
        floors, tight, witnesses = prove_steps(planar, starts, goals, most=17)
        np.testing.assert_array_equal(floors, 18)
        assert tight.all()
        np.testing.assert_array_equal(witnesses, starts)

    def test_all_numbers_of_steps_at_once_are_one_after_the_other(self, simulator, trials):
        floors, _, witnesses = prove_steps(simulator, *trials)
        steps, done = np.ones(len(floors), dtype=np.int64), np.zeros(len(floors), dtype=bool)
        while not done.all():
            one, certain, _ = prove_steps(simulator, *trials, fewest=steps, most=steps)
            assert certain.all()
            done |= one == steps
            steps = np.where(done, steps, one)
        np.testing.assert_array_equal(steps, floors)
        moved = np.abs(witnesses - trials[0])[:, :5] / simulator.step_limit
        assert (np.ceil(moved.max(axis=1) - 1e-6) == floors).all()


@pytest.fixture(scope="module")
def free_grid(walled):
    """Contact-free configurations of a grid, and where the tool is."""
    axis = np.linspace(-3.3, 3.3, 401)
    configurations = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    free = ~walled.world.contact_model.in_contact(configurations)
    # Coal's verdict alone misses about one contact of a capsule and a box in 100 000.
    free[free] = depths(walled, configurations[free]) < 0
    assert 0.2 < free.mean() < 0.8
    return configurations[free], planar_tools(*configurations[free].T)


@pytest.fixture(scope="module")
def before_the_wall(free_grid):
    """Starts that touch nothing, and goals before the wall."""
    rng = np.random.default_rng(11)
    goals = np.column_stack(
        [rng.uniform(-0.7, 0.7, 80), rng.uniform(0, 0.3, 80), np.full(80, HEIGHT)]
    )
    goals = goals[ring_distance(goals) == 0]
    starts = free_grid[0][rng.integers(0, len(free_grid[0]), len(goals))]
    return starts, goals


class TestPlanarContact:
    """The links may not touch the wall: every configuration of a grid is asked about."""

    def test_no_configuration_of_the_grid_is_reached_sooner(
        self, walled, free_grid, before_the_wall
    ):
        starts, goals = before_the_wall
        floors, tight, witnesses = prove_steps(walled, starts, goals, contact=True)
        ignoring, _, _ = prove_steps(walled, starts, goals)
        assert (floors >= ignoring).all()
        assert (floors > ignoring).mean() > 0.2
        configurations, tools = free_grid
        steps = np.full(len(starts), 65.0)
        for i, (start, goal) in enumerate(zip(starts, goals, strict=True)):
            close = np.abs(tools - (goal[0] + 1j * goal[1])) <= TOLERANCE
            if close.any():
                moved = np.abs(configurations[close] - start).max(axis=1) / 0.06
                steps[i] = min(np.ceil(moved.min()), 65)
        assert (floors <= steps).all()
        assert tight.mean() > 0.9
        # The grid is coarse: 0.0165 rad, a quarter of a step.
        assert (steps - floors <= 1)[tight].mean() > 0.8
        reached = tight & (floors <= 64)
        assert not walled.world.contact_model.in_contact(witnesses[reached]).any()


@pytest.fixture(scope="module")
def trials(simulator):
    return simulator.sample(np.random.default_rng(12), 15)


class TestBudget:
    @pytest.mark.parametrize("budget", [0, 1, 3, 10, 30, 100, 300, 1000])
    def test_small_budgets_prove_less(self, simulator, trials, budget):
        floors, tight, _ = prove_steps(simulator, *trials)
        proven, certain, _ = prove_steps(simulator, *trials, budget=budget)
        assert tight.all()
        assert ((proven >= 1) & (proven <= floors)).all()
        np.testing.assert_array_equal(proven[certain], floors[certain])
        if budget < 30:
            assert not certain.all()
