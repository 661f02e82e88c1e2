"""Branch and bound: closed forms and grids of a planar arm, and searches that try to beat it."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize

from kinarm.arm import Arm
from kinarm.kernels.records import recorded
from kinarm.motion_bounds import MotionBounds
from kinarm.policies.oracle.bounding import bound_distance, bound_steps
from kinarm.policies.oracle.inverse import project, solve_within, step_box
from kinarm.policies.oracle.kernels.approach import ArmInScene
from kinarm.problem import PROBLEMS
from kinarm.scene import Obstacle, Scene
from kinarm.simulator import Simulator

CAPSULE_ARMS = ("lrmate200ic_5l", "paper", "paper_flange")

BUDGET = 100_000

INNER, OUTER, HEIGHT = 0.5, 0.3, 0.4
"""Lengths of the planar arm's links, and the height of the plane [m]."""

TOLERANCE = 0.02

GRID = 10_001


def known(simulator):
    """What the kernels know of an arm in a scene."""
    chain, shapes, _ = simulator.world.records
    bounds = MotionBounds.of(simulator.arm.chain, simulator.n_actions)
    return recorded(ArmInScene(chain, recorded(bounds), shapes))


def prove_steps(simulator, starts, goals, *, contact=False, budget=BUDGET, fewest=1, most=None):
    """Floors under the number of steps, whether they are tight, and witnesses."""
    n = len(starts)
    floors, tight, witnesses = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool), starts.copy()
    last = simulator.task.horizon if most is None else most
    limits = (np.full(n, 1) * fewest, np.full(n, 1) * last)
    inputs = (known(simulator), starts, goals, simulator.step_limit, simulator.task.tolerance)
    bound_steps(0, n, *inputs, contact, budget, *limits, floors, tight, witnesses)
    return floors, tight, witnesses


def prove_distance(
    simulator, starts, goals, box=None, *, resolution=1e-3, contact=False, budget=BUDGET
):
    """Distances proven and found, and where they were found."""
    n, moved = len(starts), slice(simulator.n_actions)
    arm = simulator.arm
    lower, upper = box or (np.tile(limit[moved], (n, 1)) for limit in (arm.lower, arm.upper))
    distances, configurations = np.empty((n, 2)), np.empty(starts.shape)
    inputs = (known(simulator), lower, upper, starts, goals, resolution, contact, budget)
    bound_distance(0, n, *inputs, distances, configurations)
    return distances[:, 0], distances[:, 1], configurations


def within(lower, upper, start, rng, count):
    """Random configurations of a box, in its inside and on its faces."""
    n = len(lower)
    shares = np.clip(rng.uniform(-0.2, 1.2, (count, n)), 0, 1)
    drawn = np.tile(start, (count, 1))
    drawn[:, :n] = lower + shares * (upper - lower)
    return drawn


def turning_joint(make_joint, xyz):
    return make_joint(xyz=xyz, limit='<limit lower="-3.3" upper="3.3" velocity="3" effort="0"/>')


def planar_simulator(arm, scene=None, **settings):
    problem = PROBLEMS["left"].replace(arm=arm, scene=scene, tolerance=TOLERANCE, **settings)
    return Simulator(problem, threads=1)


@pytest.fixture(scope="module")
def planar(make_joint, write_robot):
    """Two links in a horizontal plane, without shapes; the axes turn by 0.06 rad a step."""
    joints = [
        turning_joint(make_joint, f"0 0 {HEIGHT}"),
        turning_joint(make_joint, f"{INNER} 0 0"),
    ]
    return planar_simulator(Arm.load(write_robot(joints, tool=f"{OUTER} 0 0")))


@pytest.fixture(scope="module")
def walled(make_joint, make_collision, write_robot):
    """The planar arm with capsules for links, beside a wall that it reaches with both."""
    joints = [
        turning_joint(make_joint, f"0 0 {HEIGHT}"),
        turning_joint(make_joint, f"{INNER} 0 0"),
    ]
    shapes = {
        k + 1: make_collision(
            f'<capsule radius="0.03" length="{length}"/>',
            xyz=f"{length / 2} 0 0",
            rpy="0 1.5707963267948966 0",
        )
        for k, length in enumerate((INNER, OUTER))
    }
    wall = Obstacle(name="wall", lower=(-1, 0.3, 0), upper=(1, 0.5, 1))
    arm = Arm.load(write_robot(joints, shapes, tool=f"{OUTER} 0 0"))
    return planar_simulator(arm, Scene(obstacles=(wall,)))


def planar_goals(rng, count, nearest=0.0, farthest=INNER + OUTER, height=0.0):
    """Goals in a ring, at most so far from the plane."""
    angle, radius = rng.uniform(-np.pi, np.pi, count), rng.uniform(nearest, farthest, count)
    z = HEIGHT + height * rng.uniform(-1, 1, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


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


class TestPlanarDistance:
    def test_goals_outside_the_ring(self, planar):
        goals = planar_goals(np.random.default_rng(1), 60, 0.82, 1.6)
        proven, found, at = prove_distance(planar, np.zeros((60, 2)), goals)
        exact = np.hypot(goals[:, 0], goals[:, 1]) - (INNER + OUTER)
        assert (proven <= exact + 1e-12).all()
        assert (proven > exact - 1.1e-3).all()
        assert (found >= exact - 1e-12).all()
        assert (found - proven < 1.1e-3).all()
        tools = np.array([planar.arm.tool_position(q) for q in at])
        np.testing.assert_allclose(np.linalg.norm(tools - goals, axis=1), found, atol=1e-12)

    def test_goals_in_the_hole(self, planar):
        goals = planar_goals(np.random.default_rng(2), 60, 0, 0.18)
        proven, found, _ = prove_distance(planar, np.zeros((60, 2)), goals)
        exact = (INNER - OUTER) - np.hypot(goals[:, 0], goals[:, 1])
        assert (proven <= exact + 1e-12).all()
        assert (proven > exact - 1.1e-3).all()
        assert (found >= exact - 1e-12).all()

    def test_goals_above_and_below_the_plane(self, planar):
        goals = planar_goals(np.random.default_rng(3), 60, 0, 1.2, height=0.5)
        proven, found, _ = prove_distance(planar, np.zeros((60, 2)), goals)
        exact = ring_distance(goals)
        assert (proven <= exact + 1e-12).all()
        assert (found >= exact - 1e-12).all()
        assert (found - proven < 1.1e-3).all()

    @pytest.mark.parametrize("resolution", [0.1, 0.01, 1e-4])
    def test_resolution_is_kept(self, planar, resolution):
        goals = planar_goals(np.random.default_rng(4), 30, 0, 1.2, height=0.3)
        proven, found, _ = prove_distance(planar, np.zeros((30, 2)), goals, resolution=resolution)
        exact = ring_distance(goals)
        assert (proven <= exact + 1e-12).all()
        assert (exact <= found + 1e-12).all()
        assert (found - proven <= resolution + 1e-8).all()

    def test_boxes(self, planar):
        rng = np.random.default_rng(5)
        goals = planar_goals(rng, 60, 0, 1.0, height=0.1)
        ends = np.sort(rng.uniform(-3.3, 3.3, (2, 60, 2)), axis=0)
        proven, found, at = prove_distance(
            planar, np.zeros((60, 2)), goals, (ends[0].copy(), ends[1].copy())
        )
        assert ((at >= ends[0] - 1e-12) & (at <= ends[1] + 1e-12)).all()
        for i in range(60):
            least, error = planar_distance(ends[0, i], ends[1, i], goals[i])
            assert proven[i] <= least
            assert found[i] >= least - error
        assert (found - proven < 1.1e-3).all()

    def test_box_of_no_extent(self, planar):
        configuration, goals = np.array([[0.3, -1.2]]), np.array([[0.1, 0.2, 0.3]])
        proven, found, at = prove_distance(
            planar, np.zeros((1, 2)), goals, (configuration, configuration)
        )
        exact = np.linalg.norm(planar.arm.tool_position(configuration[0]) - goals[0])
        np.testing.assert_allclose([proven[0], found[0]], exact, atol=1e-8)
        np.testing.assert_array_equal(at, configuration)


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

    def test_by_hand(self, planar):
        # Stretched out, the goal is a turn of 0.6 rad of the base away, of which the tolerance
        # saves 0.025 rad: ten steps. The tool moves by at most 0.06 (0.8 + 0.3) m a step, and so
        # takes at least seven.
        goals = (INNER + OUTER) * np.array([[np.cos(0.6), np.sin(0.6), HEIGHT / 0.8]])
        floors, tight, _ = prove_steps(planar, np.zeros((1, 2)), goals)
        assert tight[0]
        assert 7 <= floors[0] <= 10
        assert floors[0] == planar_steps(np.zeros(2), goals[0])[1]

    def test_unreachable_goals(self, planar):
        starts = np.random.default_rng(7).uniform(-3.3, 3.3, (20, 2))
        goals = planar_goals(np.random.default_rng(8), 20, 0.83, 2)
        floors, tight, witnesses = prove_steps(planar, starts, goals, most=17)
        np.testing.assert_array_equal(floors, 18)
        assert tight.all()
        np.testing.assert_array_equal(witnesses, starts)

    def test_reached_at_once(self, planar):
        starts = np.random.default_rng(9).uniform(-3, 3, (20, 2))
        goals = np.array([planar.arm.tool_position(q) for q in starts])
        floors, tight, _ = prove_steps(planar, starts, goals)
        np.testing.assert_array_equal(floors, 1)
        assert tight.all()

    def test_search_begins_at_the_fewest(self, planar):
        starts, goals = np.zeros((1, 2)), np.array([[0.0, 0.8, HEIGHT]])
        floor = prove_steps(planar, starts, goals)[0][0]
        for fewest in (floor - 3, floor, floor + 5):
            assert prove_steps(planar, starts, goals, fewest=fewest)[0][0] == max(floor, fewest)

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

    def test_budget_for_each_number_of_steps(self, simulator, trials):
        # Too small for all numbers at once, it suffices for most of them one by one.
        floors, _, _ = prove_steps(simulator, *trials)
        for budget in (37, 250):
            proven, tight, _ = prove_steps(simulator, *trials, budget=budget)
            for row in range(len(floors)):
                some = [part[row : row + 1] for part in trials]
                for steps in range(1, proven[row]):
                    limits = {"fewest": steps, "most": steps, "budget": budget}
                    if not tight[row]:
                        assert prove_steps(simulator, *some, **limits)[0][0] == steps + 1
            np.testing.assert_array_equal(proven[tight], floors[tight])
            assert (~tight).sum() > 2

    def test_rows_are_treated_alone(self, planar):
        rng = np.random.default_rng(10)
        starts, goals = rng.uniform(-3, 3, (8, 2)), planar_goals(rng, 8, 0.2, 0.8)
        floors, tight = np.full(8, -1), np.zeros(8, dtype=bool)
        limits = (np.full(8, 1), np.full(8, 64))
        inputs = (known(planar), starts, goals, planar.step_limit, TOLERANCE, False, BUDGET)
        bound_steps(3, 5, *inputs, *limits, floors, tight, starts.copy())
        np.testing.assert_array_equal(floors[[0, 1, 2, 5, 6, 7]], -1)
        np.testing.assert_array_equal(floors[3:5], prove_steps(planar, starts, goals)[0][3:5])


def measured_free(simulator, configurations):
    """Which configurations are free, by the distances that Coal measures.

    Its verdict alone misses about one contact of a capsule and a box in 100 000, at any depth.
    """
    model, geometry = simulator.arm.model, simulator.world.contact_model.geometry
    data, geometry_data = model.createData(), geometry.createData()
    free = ~simulator.world.contact_model.in_contact(configurations)
    for index in np.flatnonzero(free):
        pin.computeDistances(model, data, geometry, geometry_data, configurations[index])
        free[index] = all(result.min_distance > 0 for result in geometry_data.distanceResults)
    return free


@pytest.fixture(scope="module")
def free_grid(walled):
    """Contact-free configurations of a grid, and where the tool is."""
    axis = np.linspace(-3.3, 3.3, 401)
    configurations = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    free = measured_free(walled, configurations)
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

    def test_approach_stops_at_the_wall(self, walled, free_grid):
        goals = np.stack(
            [np.linspace(-0.5, 0.5, 11), np.full(11, 0.4), np.full(11, HEIGHT)], axis=1
        )
        _, tools = free_grid
        proven, found, at = prove_distance(
            walled, np.zeros((11, 2)), goals, contact=True, resolution=0.01
        )
        nearest = np.array([np.abs(tools - (goal[0] + 1j * goal[1])).min() for goal in goals])
        assert (proven <= nearest).all()
        assert (found > nearest - 0.02).all()
        complete = found - proven < 0.011
        assert complete.sum() > 5
        # Whichever way, the outer link stays its radius away from the wall at y = 0.3.
        assert (proven > 0.1 + 0.03 - 0.011)[complete].all()
        assert not walled.world.contact_model.in_contact(at).any()


@pytest.fixture(scope="module")
def trials(simulator):
    return simulator.sample(np.random.default_rng(12), 15)


class TestBudget:
    def test_small_budgets_prove_less(self, simulator, trials):
        floors, tight, _ = prove_steps(simulator, *trials)
        assert tight.all()
        loose = 0
        before = np.zeros(len(floors))
        for budget in (1, 3, 10, 30, 100, 300, 1000):
            proven, certain, _ = prove_steps(simulator, *trials, budget=budget)
            assert (proven <= floors).all()
            assert (proven >= 1).all()
            np.testing.assert_array_equal(proven[certain], floors[certain])
            assert (proven >= before).all()
            before = proven
            loose += (~certain).sum()
        assert loose > 15

    def test_nothing_examined_proves_nothing(self, simulator, trials):
        floors, tight, _ = prove_steps(simulator, *trials, budget=0)
        np.testing.assert_array_equal(floors, 1)
        assert not tight.any()
        proven, found, _ = prove_distance(simulator, *trials, budget=0)
        np.testing.assert_array_equal(proven, 0)
        assert np.isinf(found).all()

    def test_distances_proven_with_small_budgets_are_not_larger(self, planar):
        goals = planar_goals(np.random.default_rng(13), 40, 0, 1.4, height=0.3)
        exact, before = ring_distance(goals), np.zeros(40)
        for budget in (1, 2, 5, 20, 100, 1000, 20_000):
            proven, found, _ = prove_distance(planar, np.zeros((40, 2)), goals, budget=budget)
            assert (proven <= exact + 1e-12).all()
            assert (found >= exact - 1e-12).all()
            assert (proven >= before - 1e-9).all()
            before = proven
        assert (exact - before < 1.1e-3).all()

    def test_no_tolerance_that_numbers_resolve(self, planar):
        # An axis stretched out approaches the rim to second order: halving goes on for ever.
        goals = np.array([[INNER + OUTER, 0, HEIGHT + 1e-13]])
        proven, found, _ = prove_distance(planar, np.ones((1, 2)), goals, resolution=0.0)
        assert proven[0] <= 1e-13
        assert found[0] >= 0


@pytest.fixture(scope="module", params=CAPSULE_ARMS)
def shipped(request, simulators):
    """A shipped arm, trials, and what is proven of them."""
    simulator = simulators[request.param]
    starts, goals = simulator.sample(np.random.default_rng(14), 40)
    return simulator, starts, goals, *prove_steps(simulator, starts, goals)[:2]


class TestSearchesDoNotBeatTheFloor:
    def test_random_configurations(self, shipped):
        simulator, starts, goals, floors, _ = shipped
        lower, upper = step_box(simulator, starts, floors - 1)
        rng, closest = np.random.default_rng(15), []
        for i in range(len(starts)):
            drawn = within(lower[i], upper[i], starts[i], rng, 6_000)
            tools, _ = simulator.world.screen(drawn)
            closest.append(np.linalg.norm(tools - goals[i], axis=1).min())
        assert (np.array(closest) > simulator.task.tolerance).all()
        assert min(closest) < 0.08

    def test_descent_from_many_configurations(self, shipped):
        simulator, starts, goals, floors, tight = shipped
        n, rng = len(starts), np.random.default_rng(16)
        for steps, reached in ((floors - 1, False), (floors + 1, True)):
            box = step_box(simulator, starts, steps)
            begun = [within(box[0][i], box[1][i], starts[i], rng, 300) for i in range(n)]
            owner = np.repeat(np.arange(n), 300)
            radius = np.full(len(owner), simulator.task.tolerance)
            _, distances = project(simulator, np.concatenate(begun), owner, box, goals, radius)
            found = (distances.reshape(n, -1) <= simulator.task.tolerance).any(axis=1)
            if reached:
                assert found[tight & (steps <= 64)].mean() > 0.9
            else:
                assert not found.any()

    def test_contact_free_configurations(self, shipped):
        simulator, starts, goals, floors, _ = shipped
        # Lowered towards the bench, the tool reaches the tolerance only where the hand touches.
        goals = goals - [0, 0, 0.06]
        floors, _, _ = prove_steps(simulator, starts, goals)
        rows = np.flatnonzero(floors <= 64)[:24]
        starts, goals, floors = starts[rows], goals[rows], floors[rows]
        counting, _, witnesses = prove_steps(
            simulator,
            starts,
            goals,
            contact=True,
            budget=20_000,
            fewest=floors,
            most=np.minimum(floors + 8, 64),
        )
        assert (counting >= floors).all()
        raised = np.flatnonzero(counting > floors)
        assert raised.size > 0
        tolerances = np.full(raised.size, simulator.task.tolerance)
        sought = [part[raised] for part in (starts, goals, counting - 1)]
        found = solve_within(simulator, *sought, tolerances, witnesses[raised], 3000)
        assert len(found.owner) == 0
        ignoring, _ = project_within(simulator, *sought)
        assert ignoring.all()


def project_within(simulator, starts, goals, steps):
    """Whether some configuration reaches the goal, contact ignored."""
    n = len(starts)
    box = step_box(simulator, starts, steps)
    rng = np.random.default_rng(17)
    begun = [within(box[0][i], box[1][i], starts[i], rng, 300) for i in range(n)]
    owner, radius = np.repeat(np.arange(n), 300), np.full(300 * n, simulator.task.tolerance)
    _, distances = project(simulator, np.concatenate(begun), owner, box, goals, radius)
    closest = distances.reshape(n, -1).min(axis=1)
    return closest <= simulator.task.tolerance, closest


class TestSearchesDoNotBeatTheDistance:
    def test_random_configurations_and_descent(self, shipped):
        simulator, starts, _, _, _ = shipped
        starts, rng, n = starts[:8], np.random.default_rng(18), simulator.n_actions
        goals = rng.uniform([-1.5, -1.5, -0.5], [1.5, 1.5, 1.8], (8, 3))
        box = step_box(simulator, starts, rng.integers(3, 40, 8))
        proven, found, at = prove_distance(simulator, starts, goals, box, budget=15_000)
        assert (proven > 0).sum() > 4
        # Where the budget runs out, the proof lags behind.
        assert (found - proven < 1.1e-3).sum() > 2
        for i, (lower, upper) in enumerate(zip(*box, strict=True)):
            assert ((at[i, :n] >= lower - 1e-12) & (at[i, :n] <= upper + 1e-12)).all()

            def distance(moved, i=i):
                q = np.append(moved, starts[i, n:])
                return np.linalg.norm(simulator.arm.tool_position(q) - goals[i])

            assert distance(at[i, :n]) == pytest.approx(found[i], abs=1e-12)
            drawn = within(lower, upper, starts[i], rng, 5000)
            tools, _ = simulator.world.screen(drawn)
            away = np.linalg.norm(tools - goals[i], axis=1)
            limits = list(zip(lower, upper, strict=True))
            descended = [
                minimize(distance, q[:n], method="L-BFGS-B", bounds=limits).fun
                for q in drawn[np.argsort(away)[:3]]
            ]
            least = min(away.min(), *descended)
            assert least >= proven[i]
            if found[i] - proven[i] < 1.1e-3:
                assert least > found[i] - 1.1e-3
