"""The ROS 2 node of the docs, beside a fake ``rclpy``: it brings an arm to the goal."""

import ast
import runpy
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from random_policies import policy_for

from kinarm import Arm, ReachProblem
from kinarm.policies import export_policy, load_policy
from kinarm.world import World

NODE = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "ros2_node.py"


class FakeNode:
    """What the node needs of ``rclpy.node.Node``, and an arm that obeys at once."""

    arm: "FakeNode"
    now = 0.0

    def __init__(self, name):
        FakeNode.arm, self.q, self.sent, self.errors = self, np.zeros(6), [], []

    def create_subscription(self, kind, topic, function, depth):
        assert topic == "joint_states"
        self.listener = function

    def create_publisher(self, kind, topic, depth):
        return SimpleNamespace(publish=self.sent.append)

    def create_timer(self, period, function):
        self.timer = function

    def get_clock(self):
        return SimpleNamespace(now=lambda: FakeTime(FakeNode.now))

    def get_logger(self):
        return SimpleNamespace(info=lambda text: None, error=self.errors.append)


class FakeTime(float):
    def __sub__(self, other):
        return SimpleNamespace(nanoseconds=(float(self) - float(other)) * 1e9)


@pytest.fixture
def make(tmp_path, monkeypatch):
    """A node for a policy and a goal."""
    (tmp_path / "out").mkdir()
    shutil.copy(NODE, tmp_path / "out")
    message = lambda **fields: SimpleNamespace(**fields)  # noqa: E731
    modules = {
        "rclpy": SimpleNamespace(),
        "rclpy.node": SimpleNamespace(Node=FakeNode),
        "builtin_interfaces.msg": SimpleNamespace(Duration=message),
        "sensor_msgs.msg": SimpleNamespace(JointState=message),
        "trajectory_msgs.msg": SimpleNamespace(
            JointTrajectory=message, JointTrajectoryPoint=message
        ),
    }
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.syspath_prepend(str(tmp_path / "out"))
    monkeypatch.delitem(sys.modules, "arm_policy", raising=False)

    def made(policy, goal):
        export_policy(policy, tmp_path / "out", onnx=False, overwrite=True)
        return runpy.run_path(str(tmp_path / "out" / NODE.name))["PolicyNode"](goal)

    yield made
    sys.modules.pop("arm_policy", None)


@pytest.fixture
def node(make):
    return make(load_policy("ppo-best-both"), [0.4, -0.5, 0.3])


def say(node, q, at):
    """Publish joint states, in another order."""
    FakeNode.now = at
    node.listener(SimpleNamespace(name=list(reversed(node.names)), position=list(q[::-1])))


def test_is_python_3_9():
    ast.parse(NODE.read_text(), feature_version=(3, 9))


def test_reaches_the_goal(node):
    node.timer()
    assert node.sent == []
    for step in range(64):
        say(node, node.q, 0.1 * step)
        node.timer()
        if node.reached:
            break
        (point,) = node.sent[-1].points
        node.q = np.array(point.positions)
        assert node.sent[-1].joint_names == list(Arm.load("paper").joint_names)
        assert (point.time_from_start.sec, point.time_from_start.nanosec) == (0, 100_000_000)
    assert node.reached
    assert np.linalg.norm(Arm.load("paper").tool_position(node.q) - node.goal) <= 0.05


@pytest.mark.parametrize("kind", ["direction", "pose", "configuration"])
def test_a_tool_that_is_turned_otherwise_has_not_reached(make, kind):
    """The turn is kinarm's own, and decides with the distance."""
    problem = ReachProblem.load("both").replace(goal={"kind": kind})
    world, rng = World(problem), np.random.default_rng(0)
    q = rng.uniform(-0.5, 0.5, (40, 6))
    others = world.reached(q + rng.uniform(-0.12, 0.12, (40, 6)))
    others[:, :3] = world.reached(q)[:, :3]
    expected = world.at_goals(world.reached(q), others)
    assert 0 < expected.sum() < 40
    node = make(policy_for(problem), None)
    for joints, goal, there in zip(q, others.tolist(), expected, strict=True):
        node.goal, node.reached = goal, False
        say(node, joints, 0.0)
        node.timer()
        assert node.reached == there


def test_old_readings_stop_it(node):
    say(node, node.q, 0.0)
    FakeNode.now = 1.0
    node.timer()
    assert node.sent == []
    assert node.errors == ["joint states are 1.00 s old: stopped"]
