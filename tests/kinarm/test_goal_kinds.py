"""Goals beyond standing points, beside the reference, for each kind and way of arriving."""

import itertools

import numba
import numpy as np
import pytest

from kinarm.arm_specification import ArmSpecification
from kinarm.errors import KinarmError
from kinarm.kernels.elementary import angle_of
from kinarm.observation_choice import Observation
from kinarm.problem import ReachProblem
from kinarm.scenarios import draw_followers
from kinarm.simulator import Simulator
from tests.helpers.reference import ReferenceSimulator

N, HORIZON = 8, 64

KINDS = {
    "position": {},
    "direction": {"kind": "direction", "rotations": ((0.0, 1.57, 0.0), (0.5, 0.9, 0.0))},
    "pose": {"kind": "pose"},
    "configuration": {"kind": "configuration"},
}

MOTION = {"velocity": [0.0, 0.05, 0.0]}

WAYS = {
    "touched": {},
    "held": {"hold": 3, "speed": 0.2},
    "sequence": {"sequence": 3},
    "held sequence": {"sequence": 2, "hold": 2},
    "moving": {"motion": {"waypoints": [[0.3, 0.0, 0.05, 0.02], [0.6, 0.0, 0.0, 0.0]]}},
    "moving sequence": {"sequence": 2, "motion": MOTION},
}

CASES = [
    pytest.param({**KINDS[kind], **WAYS[way]}, id=f"{kind}, {way}")
    for kind, way in itertools.product(KINDS, WAYS)
    if kind != "configuration" or way not in ("moving", "moving sequence")
]


def simulator_of(goal, **settings):
    reward = {"progress": 2.0, "closer": 0.125, "step": -0.25, "collision": -3.0, "success": 5.0}
    if goal.get("kind"):
        reward["rotation"] = 0.3
    if goal.get("kind") == "pose":
        reward["closer"] = 0.0  # the last joint changes the distance by rounding alone
    # The reference looks at each of these configurations.
    settings = {"tested_configurations": 4, "tolerance": 0.04, "reachable_goals": True, **settings}
    problem = ReachProblem.load("both").replace(
        goal=goal, reward=reward, horizon=HORIZON, **settings
    )
    return Simulator(problem, threads=1)


def actions_to(simulator, starts, goals):
    """Straight ways from goal to goal, with rests, as actions, shape (n, HORIZON, n_actions)."""
    world, task, n = simulator.world, simulator.task, simulator.n_actions
    actions = np.zeros((len(starts), task.horizon, n))
    in_turn = goals[:, None]
    if task.goal.changes:
        in_turn = draw_followers(world, starts, goals)
    for e, (start, wanted) in enumerate(zip(starts, in_turn, strict=True)):
        q, way = start[:n], []
        for goal in wanted:
            found, _ = world.configurations_at(goal[None], 16)
            if not len(found):
                break
            end = found[np.abs(found[:, :n] - q).max(axis=1).argmin(), :n]
            steps = max(1, int(np.ceil((np.abs(end - q) / simulator.step_limit).max())))
            way += [(end - q) / steps / simulator.step_limit] * steps
            way += [np.zeros(n)] * task.goal.hold
            q = end
        way = np.array(way[: task.horizon]).reshape(-1, n)
        actions[e, : len(way)] = way
    return actions


@pytest.mark.parametrize("goal", CASES)
def test_the_reference_agrees(goal):
    compare_with_reference(simulator_of(goal))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_reference_agrees_with_a_plant(kind):
    """Kernels are compiled for each kind that nothing else needs."""
    # Policies see what is measured, and are judged by what is.
    shown = [*Observation().names(kind), "resolved_rate"]
    settings = {"plant": "ur", "tolerance": 0.1, "observation": shown}
    compare_with_reference(simulator_of({**KINDS[kind], "sequence": 2}, **settings))


@pytest.mark.parametrize("parts", [(), ("resolved_rate", "proximity")], ids=["blind", "near"])
def test_configurations_are_those_that_control_reaches(parts):
    """If it reaches any of the first, alone in Python; else the straight way to it is freest."""
    goal, shown = {"kind": "configuration", "rotation_tolerance": 10.0}, Observation()
    seen = [*shown.names("configuration"), *parts]
    simulator = simulator_of(goal, observation=seen, tolerance=0.02, time_step=0.05)
    world, layout = simulator.world, simulator.world.layout

    def control(observations):
        to_go = observations[:, layout.places["joints_error"]][:, : world.n_actions]
        ways = to_go / world.rules.step_limit / 2
        actions = ways / np.maximum(np.abs(ways).max(axis=1, keepdims=True), 1.0)
        layout.turn_away(observations, actions)
        return actions

    def touching(start, end):
        return world.in_contact(start + np.arange(1, 13)[:, None] / 12 * (end - start)).sum()

    starts, goals = simulator.sample(np.random.default_rng(3), 100)
    hurried = simulator.changed(time_step=0.1, horizon=HORIZON // 2)
    reached = hurried.rollout(control, starts, goals).success
    open_goals = goals.copy()
    open_goals[:, 3:] = np.nan
    q, owner = world.configurations_at(open_goals, 16, 256)
    q, owner = q[free := ~world.in_contact(q)], owner[free]
    candidates = np.hstack([goals[owner, :3], q])
    others = hurried.rollout(control, starts[owner], candidates).success
    any_reached = np.zeros(len(goals), dtype=bool)
    np.logical_or.at(any_reached, owner, others)
    assert 0.3 < others.mean() < 0.9
    assert reached[any_reached].mean() > 0.97
    for e in np.flatnonzero(~reached & ~any_reached):
        least = min(touching(starts[e], end) for end in q[owner == e])
        assert touching(starts[e], goals[e, 3:]) <= least


def test_goals_reached_before_count():
    simulator = simulator_of({"kind": "direction", "sequence": 3})
    scenarios = simulator.sample(np.random.default_rng(1), 2)
    episodes = simulator.reset(*scenarios, done=np.array([[1, 2], [0, 0]]))
    np.testing.assert_array_equal(episodes.pursuit.goals_reached, [1, 2])
    np.testing.assert_array_equal(episodes.goal, episodes.pursuit.goals[[0, 1], [1, 2]])


def compare_with_reference(simulator):
    starts, goals = simulator.sample(np.random.default_rng(1), N)
    actions = actions_to(simulator, starts, goals)
    rollouts = simulator.rollout_actions(actions, starts, goals, record=True)
    reference = ReferenceSimulator(simulator)
    episodes = simulator.reset(starts, goals)
    seen = [episodes.observation.copy()]
    told = []
    for step in range(HORIZON):
        told.append(simulator.step(episodes, actions[:, step]))
        seen.append(episodes.observation.copy())
    assert rollouts.success.any()
    for e in range(N):
        table = iter(actions[e])
        expected = reference.rollout(lambda _, table=table: next(table), starts[e], goals[e])
        steps = len(expected.rewards)
        ended = rollouts.success[e], rollouts.collision[e], rollouts.steps[e]
        assert ended == (expected.success, expected.collision, steps)
        close = {"rtol": 0, "atol": 1e-12}
        np.testing.assert_allclose(rollouts.paths[e, : steps + 1], expected.path, **close)
        own = [seen[k][e] for k in range(steps + 1)]
        np.testing.assert_allclose(own, expected.observations, **close)
        rewards = [told[k].reward[e] for k in range(steps)]
        np.testing.assert_allclose(rewards, expected.rewards, **close)
        np.testing.assert_allclose(rollouts.returns[e], expected.rewards.sum(), atol=1e-11)
        np.testing.assert_allclose(rollouts.distance[e], expected.distance, **close)
        if "turn" in simulator.task.goal.told:
            np.testing.assert_allclose(rollouts.turn[e], expected.turn, rtol=0, atol=1e-7)
            np.testing.assert_allclose(told[steps - 1].told["turn"][e], expected.turn, atol=1e-7)
        if "goals_reached" in simulator.task.goal.told:
            assert rollouts.goals_reached[e] == expected.goals_reached
            assert told[steps - 1].told["goals_reached"][e] == expected.goals_reached


@numba.njit
def angles(sines, cosines, filled):
    for i in range(len(sines)):
        filled[i] = angle_of(sines[i], cosines[i])


def test_angles_beside_numpy():
    wide = np.linspace(0.0, np.pi, 200_001)
    small = np.array([0.0, 1e-300, 1e-160, 1e-17, 1e-9, np.pi - 1e-9, np.pi])
    angle = np.concatenate([wide, small])
    sines, cosines = np.maximum(np.sin(angle), 0.0) * 3.0, np.cos(angle) * 3.0
    filled = np.empty(len(angle))
    angles(sines, cosines, filled)
    np.testing.assert_allclose(filled, np.arctan2(sines, cosines), rtol=4e-16, atol=0)


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ({"rotation_tolerance": 0.0}, "rotation_tolerance must be greater than 0"),
        ({"rotations": [[0, 0, 0]]}, "position has no rotations"),
        ({"kind": "configuration", "motion": MOTION}, "configuration does not move"),
        (
            {"kind": "configuration", "sequence": 2, "configurations": [[0] * 6]},
            "sequence of 2 needs two configurations or more",
        ),
    ],
)
def test_bad_goals_are_refused_in_a_line(goal, message):
    with pytest.raises(KinarmError, match=message) as error:
        ReachProblem.load("right").replace(goal=goal)
    assert "\n" not in str(error.value)


def test_rotations_that_an_arm_lacks_are_refused():
    # Five joints do not turn the tool about the axis of its last one.
    goal = {"kind": "pose", "rotations": [[0.0, 0.0, 1.0]], "rotation_tolerance": 1e-4}
    arm = ArmSpecification(actuated=tuple(f"axis_{number}" for number in range(1, 6)))
    with pytest.raises(KinarmError, match="0 of a sample of 64 goals can be reached: arm"):
        simulator_of(goal, arm=arm).sample(np.random.default_rng(0), 1)
