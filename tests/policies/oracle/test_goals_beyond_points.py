"""Bounds and motions for goals beyond points, and searches that try to beat them."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from proofs import assert_identical, assert_reference_agrees, prove_steps, within
from scipy.optimize import least_squares, minimize

from kinarm import BodyMotion
from kinarm.goals import GoalSpecification
from kinarm.policies import Oracle
from kinarm.policies.oracle.goals import stages_of
from kinarm.policies.oracle.inverse import solve_within, step_box, steps_between
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator

KINDS = ("direction", "pose", "configuration")
SWAY = BodyMotion(velocity=(0.1, 0.15, -0.05))


def problem(kind="position", arm="paper", tolerance=0.03, **given):
    goal = GoalSpecification(kind=kind, rotation_tolerance=0.15, **given)
    return PROBLEMS["both"].replace(arm=arm, tolerance=tolerance, goal=goal)


def errors(simulator, q, goal):
    """By Pinocchio: errors of position and rest as vectors, as shares of their tolerances."""
    model, spec = simulator.arm.model, simulator.task.goal
    data, tool = model.createData(), simulator.world.tool
    pin.forwardKinematics(model, data, q)
    last, turn = data.oMi[model.njoints - 1], np.zeros(1)
    apart = last.rotation @ tool[:3, 3] + last.translation - goal[:3]
    if spec.kind == "direction":
        axis = last.rotation @ simulator.world.rules.goal.axis
        angle = np.arccos(np.clip(axis @ goal[3:], -1, 1))
        turn = angle * (axis - goal[3:]) / max(np.linalg.norm(axis - goal[3:]), 1e-9)
    elif spec.kind == "pose":
        wanted = pin.Quaternion(*goal[3:]).matrix()
        turn = pin.log3(wanted.T @ last.rotation @ tool[:3, :3])
    elif spec.kind == "configuration":
        turn = q - goal[3:]
    return apart / simulator.task.tolerance, turn / spec.rotation_tolerance


def misses(simulator, configurations, goal):
    """The larger of both errors of configurations: a goal is reached at 1."""
    order = np.inf if simulator.task.goal.kind == "configuration" else 2
    found = [errors(simulator, q, goal) for q in configurations]
    return np.array([max(np.linalg.norm(p), np.linalg.norm(r, order)) for p, r in found])


def least_miss(simulator, start, goal, steps, rng):
    """Smallest miss that searches of the box of some steps find."""
    n = simulator.n_actions
    lower, upper = (part[0] for part in step_box(simulator, start[None], np.array([steps])))
    drawn = within(lower, upper, start, rng, 100)
    drawn[:, :n] = np.clip(drawn[:, :n], lower + 1e-9, upper - 1e-9)

    def descended(q):
        best = least_squares(
            lambda moved: np.concatenate(errors(simulator, np.append(moved, start[n:]), goal)),
            q[:n],
            bounds=(lower, upper),
            max_nfev=40,
        )
        return np.append(best.x, start[n:])

    nearest = drawn[np.argsort(misses(simulator, drawn, goal))[:5]]
    found = [descended(q) for q in nearest]
    at = misses(simulator, found, goal)
    polished = minimize(
        lambda moved: misses(simulator, np.append(moved, start[n:])[None], goal)[0],
        np.clip(found[at.argmin()][:n], lower, upper),
        method="Nelder-Mead",
        bounds=list(zip(lower, upper, strict=True)),
    )
    return min(at.min(), polished.fun)


@pytest.fixture(scope="module", params=KINDS)
def proven(request):
    """A simulator of a kind of goals, trials, and what is proven of them."""
    simulator = Simulator(problem(request.param), threads=1)
    starts, goals = simulator.sample(np.random.default_rng(1), 24)
    return simulator, starts, goals, *prove_steps(simulator, starts, goals)


class TestBounds:
    def test_no_search_reaches_the_goal_in_fewer_steps(self, proven):
        simulator, starts, goals, bounds, _, _ = proven
        rng = np.random.default_rng(2)
        rows, sooner, later = np.flatnonzero(bounds > 1)[:8], [], []
        for row in rows:
            sought = simulator, starts[row], goals[row]
            sooner.append(least_miss(*sought, bounds[row] - 1, rng))
            later.append(least_miss(*sought, bounds[row] + 1, rng))
        assert min(sooner) > 1
        assert np.mean(np.array(later) <= 1) >= 0.75

    def test_descent_from_many_configurations(self, proven):
        simulator, starts, goals, bounds, _, _ = proven
        tolerances = np.full(len(starts), simulator.task.tolerance)
        free = simulator.without_moving_bodies()
        found = solve_within(free, starts, goals, bounds - 1, tolerances, starts, 600)
        assert len(found.owner) == 0

    def test_witnesses_attain_them(self, proven):
        simulator, starts, goals, bounds, tight, witnesses = proven
        assert tight.mean() > 0.8
        for row in np.flatnonzero(tight & (bounds <= 64)):
            assert steps_between(simulator, starts[row], witnesses[row]) <= bounds[row] + 1e-6
            assert misses(simulator, witnesses[row][None], goals[row])[0] <= 1 + 1e-7

    def test_they_are_not_vacuous(self, proven):
        simulator, starts, goals, bounds, _, _ = proven
        q, owner = simulator.world.configurations_at(goals, 64)
        steps = np.ceil(steps_between(simulator, starts[owner], q) - 1e-9)
        nearest = np.full(len(starts), np.inf)
        np.minimum.at(nearest, owner, steps)
        ratios = (bounds / nearest)[np.isfinite(nearest) & (bounds <= 64)]
        assert len(ratios) > 12
        assert ratios.mean() > 0.75

    def test_a_configuration_is_bounded_joint_by_joint(self):
        simulator = Simulator(problem("configuration", tolerance=10.0), threads=1)
        drawn_in = Simulator(problem("configuration"), threads=1)
        starts, goals = drawn_in.sample(np.random.default_rng(3), 40)
        moved = np.abs(goals[:, 3:8] - starts[:, :5]) - 0.15
        exact = np.ceil(moved / simulator.step_limit - 1e-9).max(axis=1)
        bounds, tight, _ = prove_steps(simulator, starts, goals)
        np.testing.assert_array_equal(bounds, np.fmax(exact, 1))
        assert tight.all()

    def test_joints_that_do_not_move_must_be_there(self):
        simulator = Simulator(problem("configuration"), threads=1)
        starts, goals = simulator.sample(np.random.default_rng(3), 3)
        starts[1:, 5] += [0.1, 0.2]
        assert (prove_steps(simulator, starts, goals)[0] > 64).tolist() == [False, False, True]

    def test_contact_at_the_goal_counts(self):
        # A configuration in contact, whose surroundings are all in contact.
        oracle = Oracle(problem("configuration", tolerance=0.02), threads=1)
        oracle_goal = replace(oracle.simulator.task.goal, rotation_tolerance=0.005)
        oracle = Oracle(oracle.simulator.problem.replace(goal=oracle_goal), threads=1)
        simulator = oracle.simulator
        rng, arm = np.random.default_rng(4), simulator.arm
        q = rng.uniform(arm.lower, arm.upper, (400, arm.n_joints))
        q[:, 5] = 0.0
        touching = q[simulator.world.in_contact(q)][:6]
        known = oracle.solve_batch(np.zeros(6), simulator.world.reached(touching))
        assert not known.reachable.any()
        shut = known.steps_lower_bound > 64
        assert shut.any()
        assert all("out of reach: proven" in reason for reason in known.reasons[shut])


WAYS = {
    "held": {"hold": 4},
    "slow": {"speed": 0.05},
    "held and slow": {"hold": 3, "speed": 0.1},
    "three": {"sequence": 3},
    "three held": {"sequence": 3, "hold": 2},
    "swaying": {"motion": SWAY},
    "three swaying": {"sequence": 3, "motion": SWAY},
}
CASES = [
    *((kind, {}) for kind in KINDS),
    *(("position", WAYS[way]) for way in WAYS),
    *(("pose", WAYS[way]) for way in ("held and slow", "three", "swaying")),
    *(("configuration", WAYS[way]) for way in ("held", "three")),
]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case[0]} {' '.join(case[1])}")
def known(request):
    """An oracle, trials, and what it knows about them."""
    kind, way = request.param
    changes = {"horizon": 120} if "sequence" in way else {}
    oracle = Oracle(problem(kind, **way).replace(**changes), threads=1)
    starts, goals = oracle.simulator.sample(np.random.default_rng(5), 10)
    return oracle, starts, goals, oracle.solve_batch(starts, goals)


class TestMotions:
    def test_most_goals_are_reached_in_few_more_steps_than_proven(self, known):
        oracle, _, _, solutions = known
        assert solutions.reachable.mean() >= 0.7
        assert (solutions.steps >= solutions.steps_lower_bound)[solutions.reachable].all()
        ratio = (solutions.steps / solutions.steps_lower_bound)[solutions.reachable]
        assert ratio.mean() < (5 if oracle.simulator.task.goal.sequence > 1 else 1.6)

    def test_the_reference_agrees(self, known):
        oracle, starts, goals, solutions = known
        assert_reference_agrees(oracle, starts[:4], goals[:4], solutions)

    def test_hurried_motions_do_not_beat_bounds(self, known):
        """Steps are left out, joined or changed: what still succeeds takes no fewer than proven."""
        oracle, starts, goals, solutions = known
        simulator, rng = oracle.simulator, np.random.default_rng(6)
        tried, rows = [], np.repeat(np.flatnonzero(solutions.reachable), 60)
        for number, row in enumerate(rows):
            actions, steps = solutions.actions[row].copy(), solutions.steps[row]
            for gone in rng.choice(steps, min(number % 4, steps), replace=False):
                actions[gone:-1] = actions[gone + 1 :] + 0.5 * actions[gone]
            actions += (number % 3) * 0.05 * rng.normal(size=actions.shape)
            tried.append(actions)
        outcome = simulator.rollout_actions(np.array(tried), starts[rows], goals[rows])
        assert outcome.success.mean() > 0.02
        least = solutions.steps_lower_bound[rows]
        assert (outcome.steps >= least)[outcome.success].all()

    def test_they_do_not_depend_on_other_trials(self, known):
        oracle, starts, goals, solutions = known
        alone = oracle.solve_batch(starts[3], goals[3])
        assert_identical(solutions, alone, slice(3, 4))


class TestGoalsThatMove:
    def test_no_search_meets_them_earlier(self):
        simulator = Simulator(problem(motion=SWAY), threads=1)
        starts, goals = simulator.sample(np.random.default_rng(7), 8)
        (stage,) = stages_of(simulator, starts, goals)
        bounds, _, _ = prove_steps(simulator, starts, stage.targets)
        rng = np.random.default_rng(8)
        assert (bounds > 4).sum() > 4
        for row in np.flatnonzero(bounds <= 64):
            for steps in {max(bounds[row] - 1, 1), rng.integers(1, max(bounds[row], 2))}:
                goal = stage.targets[row, steps]
                missed = least_miss(simulator, starts[row], goal, int(steps), rng) > 1
                assert missed or steps >= bounds[row]

    def test_they_are_where_the_simulator_has_them(self):
        simulator = Simulator(problem("pose", motion=SWAY), threads=1)
        starts, goals = simulator.sample(np.random.default_rng(9), 5)
        (stage,) = stages_of(simulator, starts, goals)
        episodes = simulator.reset(starts, goals)
        for step in range(20):
            np.testing.assert_allclose(episodes.goal, stage.targets[:, step], rtol=0, atol=0)
            simulator.step(episodes, np.zeros((5, 6)))
