"""A ROS 2 node that runs a policy: put it beside arm_policy.py, in a folder of kinarm-export.

``python ros2_node.py 0.4 -0.5 0.3`` brings the tool to a goal [m], which may go on as the contract
says. It needs ROS 2 and NumPy; it has no shield, and was not tried on hardware.
"""

import sys

import numpy as np
import rclpy
from arm_policy import ArmPolicy, from_readings, observe
from builtin_interfaces.msg import Duration
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

SPEED = 0.2
"""Share of the speed of the training."""

TOPIC = "/joint_trajectory_controller/joint_trajectory"

STALE = 0.2
"""Age at which readings are no longer believed [s]."""

TURNS = {
    "direction": ("direction_error", lambda error: 2.0 * np.arcsin(np.linalg.norm(error) / 2.0)),
    "pose": ("rotation_error", lambda error: 4.0 * np.arcsin(np.linalg.norm(error) / 2.0)),
    "configuration": ("joints_error", lambda error: np.abs(error).max()),
}
"""What the rest of a goal is missed by, and how far that is [rad or m], by the goal's kind."""


class PolicyNode(Node):
    """Subscribes to joint states, and publishes a command a step until the goal is reached."""

    def __init__(self, goal):
        super().__init__("kinarm_policy")
        self.policy, self.goal = ArmPolicy(feedback="commanded"), goal
        self.names = [joint["name"] for joint in self.policy.contract["joints"]]
        self.readings, self.read_at, self.reached = None, None, False
        self.period = self.policy.contract["time_step"] / SPEED
        self.create_subscription(JointState, "joint_states", self.read, 1)
        self.publisher = self.create_publisher(JointTrajectory, TOPIC, 1)
        self.create_timer(self.period, self.step)

    def read(self, message):
        """Take in joint states, whose order is the publisher's."""
        places = dict(zip(message.name, message.position))  # noqa: B905
        if places.keys() >= set(self.names):
            self.readings = [places[name] for name in self.names]
            self.read_at = self.get_clock().now()

    def step(self):
        """Command the next step, unless there is no fresh reading."""
        if self.readings is None or self.reached:
            return
        age = (self.get_clock().now() - self.read_at).nanoseconds * 1e-9
        if age > STALE:
            self.get_logger().error(f"joint states are {age:.2f} s old: stopped")
            self.policy.reset()
            return
        distance, turn = self.missing()
        wanted = self.policy.contract["goal"]
        if distance <= wanted["tolerance"] and turn <= wanted["rotation_tolerance"]:
            self.reached = True
            self.get_logger().info(f"reached, {distance:.3f} m from the goal")
            return
        command = self.policy.command(self.readings, self.goal)
        seconds, part = divmod(self.period, 1.0)
        point = JointTrajectoryPoint(
            positions=command.tolist(),
            time_from_start=Duration(sec=int(seconds), nanosec=round(part * 1e9)),
        )
        self.publisher.publish(JointTrajectory(joint_names=self.names, points=[point]))

    def missing(self):
        """Distance of the tool from the goal [m], and how far it is turned from it [rad or m]."""
        joints = from_readings(self.policy.arm, np.array(self.readings))
        name, turn = TURNS.get(self.policy.contract["goal"]["kind"], ("goal", lambda _: 0.0))
        shown = ["goal_minus_tool", name]
        error = observe(np, self.policy.arm, shown, joints, joints, np.array(self.goal))
        return np.linalg.norm(error[:3]), turn(error[3:])


if __name__ == "__main__":
    rclpy.init()
    node = PolicyNode([float(word) for word in sys.argv[1:]])
    while rclpy.ok() and not node.reached:
        rclpy.spin_once(node)
    rclpy.shutdown()
