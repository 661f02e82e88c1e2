"""Plans: what they reach and keep, their files, and what refuses them."""

import csv
import json
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from configurations import pair_distances

from kinarm.bodies import Body
from kinarm.body_motion import BodyMotion
from kinarm.errors import InvalidInputError, NoPathError
from kinarm.goals import GoalSpecification
from kinarm.policies import Plan, plan
from kinarm.problem import PROBLEMS
from kinarm.recording import record_path
from kinarm.scene import PAPER_BENCHES, Obstacle, RandomBodies, Scene
from kinarm.simulator import Simulator
from kinarm.world import World

WALL = Obstacle(name="wall", lower=(0.35, -0.06, 0.0), upper=(0.8, 0.06, 0.9))
START, END = np.array([-0.9, 0.3, 0, 0, 0.2, 0.7]), np.array([0.9, 0.3, 0, 0, 0.2, -2.0])


@pytest.fixture(scope="module")
def walled():
    """The default arm with a wall before it."""
    return PROBLEMS["both"].replace(scene=Scene(obstacles=(*PAPER_BENCHES, WALL)))


@pytest.fixture(scope="module")
def made(walled):
    return plan(walled, START, END, margin=0.01)


def dense(planned, rate=1000.0):
    times = planned.times(rate)
    return times, [planned.trajectory.at(times, derivative) for derivative in range(4)]


def test_it_moves_all_joints_around_the_wall_and_keeps_everything(walled, made):
    assert len(made.waypoints) > 2
    times, (q, *derivatives) = dense(made)
    np.testing.assert_allclose(q[[0, -1]], [START, END], rtol=0, atol=1e-12)
    for derivative, limit in zip(derivatives, made.limits, strict=True):
        assert (np.abs(derivative) <= limit * (1 + 1e-9)).all()
    assert pair_distances(World(walled), q[::4]).min() > 0.01
    assert times[-1] == made.duration
    tested = len(World(walled).contact_model.pair_names)
    assert f"{tested} tested pairs of bodies come within 0.01 m" in made.proven


def test_the_same_plan_again(walled, made):
    again = plan(walled, START.tolist(), END, margin=0.01)
    np.testing.assert_array_equal(again.waypoints, made.waypoints)
    assert again.duration == made.duration


def test_slower_and_gentler(walled, made):
    slow = plan(walled, START, END, margin=0.01, speed=0.2)
    np.testing.assert_allclose(slow.limits.velocity, 0.2 * made.limits.velocity)
    gentle = plan(walled, START, END, margin=0.01, acceleration=[1.0], jerk=np.full(6, 10.0))
    assert slow.duration > made.duration
    for planned in (slow, gentle):
        _, (_, *derivatives) = dense(planned)
        for derivative, limit in zip(derivatives, planned.limits, strict=True):
            assert (np.abs(derivative) <= limit * (1 + 1e-9)).all()


@pytest.mark.parametrize(
    ("kind", "target"),
    [
        ("position", [0.4, -0.5, 0.4]),
        ("direction", [0.4, -0.4, 0.25, 0, -1, 0]),
        ("pose", [0.4, -0.4, 0.45, 0.1, 0.3, -1.0]),
    ],
)
def test_tools_reach_what_they_should(kind, target):
    planned = plan("both", None, target, goal_kind=kind)
    arm = PROBLEMS["both"].load_arm()
    np.testing.assert_array_equal(planned.waypoints[0], arm.home)
    end = planned.waypoints[-1]
    (pose,) = World("both").poses(end[None])
    np.testing.assert_allclose(pose[:3, 3], target[:3], atol=1e-6)
    if kind == "position":
        assert end[5] == arm.home[5]
    elif kind == "direction":
        np.testing.assert_allclose(pose[:3, 0], target[3:], atol=1e-5)
    else:
        np.testing.assert_allclose(pose[:3, :3], pin.rpy.rpyToMatrix(*target[3:]), atol=1e-5)
    back = plan("both", target, end, start_kind=kind)
    (pose,) = World("both").poses(back.waypoints[:1])
    np.testing.assert_allclose(pose[:3, 3], target[:3], atol=1e-6)


def test_joints_that_tasks_hold_still_bring_the_tool_to_a_position():
    held = replace(PROBLEMS["both"].arm, actuated=("axis_1", "axis_2", "axis_3"))
    far = [0.39, -0.79, 0.62]  # where only a bent wrist brings the tool
    planned = plan(PROBLEMS["both"].replace(arm=held), None, far, goal_kind="position")
    (pose,) = World("both").poses(planned.waypoints[-1:])
    np.testing.assert_allclose(pose[:3, 3], far, atol=1e-6)
    assert planned.waypoints[-1, 5] == 0.0


def test_files_hold_the_same_motion(made, tmp_path):
    made.save_csv(tmp_path / "m.csv", 50)
    made.save_json(tmp_path / "m.json", 50)
    with (tmp_path / "m.csv").open() as file:
        rows = list(csv.DictReader(file))
    ros, (times, (q, v, a, _)) = json.loads((tmp_path / "m.json").read_text()), dense(made, 50.0)
    assert ros["joint_names"] == [f"axis_{k}" for k in range(1, 7)]
    assert len(rows) == len(ros["points"]) == len(times)
    for row, point, *values in zip(rows, ros["points"], times, q, v, a, strict=True):
        since = point["time_from_start"]
        assert since["sec"] + 1e-9 * since["nanosec"] == pytest.approx(values[0], abs=1e-9)
        assert float(row["time"]) == values[0]
        for part, value in zip(
            ("positions", "velocities", "accelerations"), values[1:], strict=True
        ):
            columns = [float(row[f"{name}_{part}"]) for name in ros["joint_names"]]
            np.testing.assert_array_equal(columns, value)
        for part, value in zip(
            ("positions", "velocities", "accelerations"), values[1:], strict=True
        ):
            np.testing.assert_array_equal(point[part], value)


def test_recordings_are_tested_once_more(made):
    recording = made.recording()
    assert recording.outcome == "success"
    np.testing.assert_allclose(recording.states[[0, -1]], [START, END], atol=1e-12)
    assert recording.steps == pytest.approx(made.duration / 0.02, abs=1)


def test_recordings_do_not_cut_corners_in_long_steps(walled):
    planned = plan(walled.replace(time_step=0.1), START, END, seed=3)
    assert planned.recording().outcome == "success"
    # With a state for each tenth of a second, the arm would move straight into the wall.
    coarse = planned.trajectory.at(planned.times(10.0))
    assert record_path(planned.problem, coarse).outcome == "collision"


def test_random_bodies_are_those_of_the_episode():
    bodies = RandomBodies(
        name="box",
        shape="box",
        count=(3, 3),
        smallest=(0.1, 0.1, 0.1),
        largest=(0.1, 0.1, 0.1),
        lower=(0.2, -0.6, 0.2),
        upper=(0.7, 0.6, 0.8),
    )
    problem = PROBLEMS["both"].replace(scene=Scene(random_bodies=(bodies,)))
    simulator = Simulator(problem)
    starts, goals = simulator.sample(np.random.default_rng(4), 6)
    for start, goal in zip(starts, goals, strict=True):
        planned = plan(problem, start, goal, goal_kind="position", samples=2000)
        world = simulator.world.in_scene(start, goal)
        assert not world.in_contact(dense(planned, 200.0)[1][0]).any()
        assert planned.recording().outcome == "success"


def test_a_start_may_be_any_configuration_that_keeps_the_margin():
    pose = [-0.316, 0.133, 0.198, 1.127, 0.814, 1.378]  # the nearest one to home is too close
    margin, world = 0.03, World("both")
    planned = plan("both", pose, START, start_kind="pose", margin=margin)
    np.testing.assert_allclose(world.poses(planned.waypoints[0])[:3, 3], pose[:3], atol=1e-6)
    assert pair_distances(world, dense(planned, 200.0)[1][0]).min() > margin
    nearest = world.inverse_kinematics(world.poses(planned.waypoints[0]), free=True)
    assert pair_distances(world, nearest.configurations[:1]).min() < margin


def test_random_bodies_are_those_of_episodes_with_listed_configurations():
    size, place = (0.1, 0.1, 0.1), {"lower": (0.2, -0.6, 0.2), "upper": (0.7, 0.6, 0.8)}
    bodies = RandomBodies(name="box", shape="box", smallest=size, largest=size, **place)
    listed = tuple(tuple(0.4 * q) for q in np.random.default_rng(2).normal(size=(20, 6)))
    goal = GoalSpecification(kind="configuration", configurations=listed)
    problem = PROBLEMS["both"].replace(scene=Scene(random_bodies=(bodies,)), goal=goal)
    world = World(problem)
    for row in world.reached(listed)[:6]:
        planned = plan(problem, None, row[3:])
        np.testing.assert_array_equal(planned.goal, row[:3])
        episode = world.in_scene(planned.waypoints[0], row)
        assert not episode.in_contact(dense(planned, 200.0)[1][0]).any()


def test_random_bodies_that_touch_the_start_are_named():
    size = {"smallest": (0.4, 0.4, 0.4), "largest": (0.4, 0.4, 0.4)}
    place = {"lower": (-0.2, -0.2, 0.5), "upper": (0.2, 0.2, 0.9)}
    box = RandomBodies(name="box", shape="box", count=(1, 1), **size, **place)
    problem = PROBLEMS["both"].replace(scene=Scene(random_bodies=(box,)))
    with pytest.raises(InvalidInputError, match="start is in contact: .* touches box 1"):
        plan(problem, START, END)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"goal": [3, 0, 0], "goal_kind": "position"}, "goal is out of reach"),
        ({"goal": [0.4, 0.65, 0.28], "goal_kind": "position"}, "goal is in contact"),
        ({"goal": [0, 1.9, 0, 0, 0, 0]}, "goal is in contact: .* touches ground"),
        ({"start": [0, 1.9, 0, 0, 0, 0]}, "start is in contact: .* touches ground"),
        ({"goal": np.zeros(5)}, "goal must have shape"),
        ({"start": None, "start_kind": "pose"}, "no start is given, of which start_kind is 'pose'"),
        ({"goal": np.full(6, 9.0)}, "goal lies outside the limits: axis_1 at 9"),
        ({"margin": 0.5}, "start is closer to contact than 0.5 m"),
        ({"margin": -0.1}, "margin must not be negative"),
        ({"speed": 1.5}, "speed must lie in"),
        ({"jerk": [1, 2]}, "jerk must be one number or 6, got 2"),
    ],
)
def test_refusals_say_what_is_wrong(given, words):
    asked = {"problem": "both", "start": START, "goal": END} | given
    with pytest.raises(InvalidInputError, match=words) as caught:
        plan(**asked)
    assert "\n" not in str(caught.value)


def test_bodies_that_move_are_refused(walled):
    moving = Body(
        name="cart",
        shape="box",
        size=(0.1, 0.1, 0.1),
        position=(0.9, 0, 0.5),
        motion=BodyMotion(velocity=(0.1, 0, 0)),
    )
    scene = Scene(obstacles=(moving,))
    with pytest.raises(InvalidInputError, match="no time at which it begins, and cart"):
        plan(walled.replace(scene=scene), START, END)


def test_no_path_is_a_failure_not_bad_input(walled):
    with pytest.raises(NoPathError, match="no path found with 3 samples") as caught:
        plan(walled, START, END, samples=3, margin=0.03)
    assert caught.value.exit_status == 1


def test_it_tells_its_size(made):
    assert isinstance(made, Plan)
    assert repr(made) == f"Plan({len(made.waypoints)} waypoints, {made.duration:.3f} s)"
