"""The oracle with other arms and scenes: detours, slides and shapes of other kinds."""

import numpy as np
import pytest
from known_arms import INSTALLED
from proofs import assert_identical, assert_reference_agrees, drawn, replayed
from scipy.optimize import minimize

from kinarm.arm import Arm
from kinarm.policies import Oracle
from kinarm.problem import PROBLEMS
from kinarm.scene import PAPER_BENCHES, Obstacle, Scene

HORIZON, TOLERANCE = 64, 0.05


@pytest.fixture(scope="module")
def posts(make_joint, make_collision, write_robot):
    """Oracles with and without two posts, which a stretched arm cannot pass, and a trial.

    The outer link has to fold in before the first post, turn, and unfold after the second.
    """
    limit = '<limit lower="-3" upper="3" velocity="8" effort="0"/>'
    bar = make_collision(
        '<capsule radius="0.02" length="0.35"/>', xyz="0.2 0 0", rpy="0 1.5707963267948966 0"
    )
    joints = [make_joint(xyz="0 0 0.4", limit=limit), make_joint(xyz="0.3 0 0", limit=limit)]
    arm = Arm.load(write_robot(joints, {2: bar}, tool="0.4 0 0"))
    obstacles = []
    for name, angle in (("left post", 0.9), ("right post", -0.9)):
        x, y = 0.5 * np.cos(angle), 0.5 * np.sin(angle)
        lower, upper = (x - 0.03, y - 0.03, 0.0), (x + 0.03, y + 0.03, 1.0)
        obstacles.append(Obstacle(name=name, lower=lower, upper=upper))
    problem = PROBLEMS["left"].replace(arm=arm, tolerance=0.02)
    among, without = (
        Oracle(problem.replace(scene=Scene(obstacles=placed)), threads=1)
        for placed in (tuple(obstacles), PAPER_BENCHES[1:])
    )
    return among, without, np.array([-1.2, 0.0]), arm.tool_position([1.2, 0.0])


@INSTALLED
def test_goals_beyond_a_stretched_arm_are_proven_out_of_reach():
    """At the edge of its reach an arm of seven joints has many postures; a ball holds them all."""
    oracle = Oracle(PROBLEMS["both"].replace(arm="xarm7"), threads=1)
    arm, shoulder = oracle.simulator.arm, np.array([0, 0, 0.267])

    def shortness(q):
        return -np.linalg.norm(arm.tool_position(q) - shoulder)

    guesses = np.random.default_rng(2).uniform(arm.lower, arm.upper, (12, 7))
    within = list(zip(arm.lower, arm.upper, strict=True))
    reach = -min(minimize(shortness, guess, bounds=within).fun for guess in guesses)
    angles = np.linspace(-2.5, 2.5, 6)
    outward = np.stack([np.cos(angles), np.sin(angles), np.full(6, 0.3)], axis=1)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    known = oracle.solve_batch(arm.home, shoulder + (reach + TOLERANCE + 0.003) * outward)
    assert (known.steps_lower_bound == HORIZON + 1).all()
    assert known.proof_complete.all()
    near = oracle.solve_batch(arm.home, shoulder + (reach + TOLERANCE - 0.003) * outward)
    assert (near.steps_lower_bound <= HORIZON).all()


class TestOtherWorlds:
    def test_posts_force_a_detour(self, posts):
        among, without, start, goal = posts
        free, detour = without.solve_batch(start, goal), among.solve_batch(start, goal)
        assert free.steps == free.steps_lower_bound
        assert detour.reachable
        assert detour.steps > free.steps + 6
        assert detour.steps_lower_bound >= free.steps_lower_bound
        assert np.nanmax(np.abs(detour.paths[0, :, 1])) > 1.5
        episode = replayed(among.simulator, start, goal, detour.actions[0])
        assert episode.success
        assert len(episode.rewards) == detour.steps
        assert "right post" in replayed(among.simulator, start, goal, free.actions[0]).contact

    def test_detours_do_not_depend_on_other_trials(self, posts):
        among, _, start, goal = posts
        alone = among.solve_batch([start], [goal])
        starts = np.array([start * [-1, 1], start, start + np.array([0.0, 0.1]), start])
        together = among.solve_batch(starts, [goal * [1, -1, 1], goal, goal, goal])
        for row in (1, 3):
            assert_identical(together, alone, slice(row, row + 1))

    def test_arm_with_a_slide(self, make_joint, make_collision, write_robot):
        # A column that lifts two links, which turn in the horizontal plane: 0.016 m a step.
        lift = '<limit lower="0.35" upper="1" velocity="0.8" effort="0"/>'
        turn = '<limit lower="-3" upper="3" velocity="4" effort="0"/>'
        bar = make_collision(
            '<capsule radius="0.03" length="0.3"/>', xyz="0.2 0 0", rpy="0 1.5707963267948966 0"
        )
        joints = [
            make_joint("prismatic", xyz="0 0 0", limit=lift),
            make_joint(xyz="0 0 0", limit=turn),
            make_joint(xyz="0.4 0 0", limit=turn),
        ]
        arm = Arm.load(write_robot(joints, {2: bar, 3: bar}, tool="0.4 0 -0.02"))
        assert arm.n_actuated == 3
        oracle = Oracle(PROBLEMS["both"].replace(arm=arm), threads=1)
        starts, goals = drawn(oracle.simulator, 13, 60)
        known = oracle.solve_batch(starts, goals)
        assert known.reachable.mean() > 0.7
        lowering = np.abs(starts[:, 0] - 0.02 - goals[:, 2]) - TOLERANCE
        lifts = np.ceil(np.fmax(lowering, 0) / 0.016 - 1e-9)
        assert (known.steps_lower_bound >= np.fmin(lifts, HORIZON + 1)).all()
        assert (known.steps_lower_bound == lifts).any()
        assert_reference_agrees(oracle, starts, goals, known)
        assert (known.steps >= known.steps_lower_bound)[known.reachable].all()

    def test_far_and_long_motions_are_not_called_impossible(self, make_joint, write_robot):
        """Far from zero each step of a slide rounds up: after 10 000, it is 6e-9 m ahead."""
        unit = np.spacing(9000.0)
        # A step of 0.1 m and 0.6 units in the last place of 9000, at a rate of 1 / s.
        step = np.round(0.1 / unit) * unit + 0.6 * unit
        limit = f'<limit lower="-1e4" upper="1e4" velocity="{float(step)!r}" effort="0"/>'
        path = write_robot([make_joint("prismatic", axis="1 0 0", limit=limit)], tool="0 0 0")
        problem = PROBLEMS["left"].replace(
            arm=Arm.load(path),
            scene=Scene(obstacles=(), ground=False),
            time_step=1.0,
            horizon=10_000,
            tolerance=0.01,
        )
        oracle, start = Oracle(problem, threads=1), np.array([8300.0])
        far = np.array([[9999.0, 0.0, 0.0]])
        path = oracle.simulator.rollout_actions(
            np.ones((1, 10_000, 1)), start[None], far, record=True
        ).paths[0, :, 0]
        ahead = path[-1] - (start + 10_000 * step)
        assert ahead > 3e-9
        goal = problem.load_arm().tool_position(path[-1:]) + np.array([0.01 - 1e-11, 0.0, 0.0])
        assert oracle.solve_batch(start, goal).steps_lower_bound <= 10_000

    @pytest.mark.parametrize("name", ["sliding", "mesh"])
    def test_arms_of_other_shapes(self, simulators, name):
        oracle = Oracle(simulators[name].problem, threads=1)
        starts, goals = drawn(oracle.simulator, 14, 12)
        known = oracle.solve_batch(starts, goals)
        assert_reference_agrees(oracle, starts, goals, known)
