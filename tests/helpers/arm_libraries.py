"""Libraries of arms that answer as ``ur_rtde`` and LeRobot do, without an arm."""

from types import SimpleNamespace


class FakeRTDE:
    """Both interfaces of ``ur_rtde`` 1.6 to one arm, which obeys at once."""

    def __init__(self, q):
        self.q, self.connected, self.stopped, self.accepts = list(q), True, False, True
        self.calls = []

    def modules(self):
        """What stands in for the two modules."""
        receive = {
            "getActualQ": lambda: list(self.q),
            "isConnected": lambda: self.connected,
            "isProtectiveStopped": lambda: self.stopped,
            "isEmergencyStopped": lambda: False,
            "disconnect": lambda: self.calls.append("receive off"),
        }
        control = {
            "servoJ": self.servo,
            "servoStop": lambda a=10.0: self.calls.append("servoStop"),
            "stopScript": lambda: self.calls.append("stopScript"),
            "disconnect": lambda: self.calls.append("control off"),
        }
        return {
            "rtde_receive": SimpleNamespace(
                RTDEReceiveInterface=lambda host: SimpleNamespace(**receive)
            ),
            "rtde_control": SimpleNamespace(
                RTDEControlInterface=lambda host: SimpleNamespace(**control)
            ),
        }

    def servo(self, q, speed, acceleration, time, lookahead_time, gain):
        assert len(q) == 6
        assert all(type(value) is float for value in (*q, speed, acceleration, time))
        assert 0.03 <= lookahead_time <= 0.2
        assert 100 <= gain <= 2000
        if self.accepts:
            self.q = list(q)
        return self.accepts


class FakeSO101:
    """A follower of LeRobot 0.6 with encoders of 4096 steps."""

    ranges = ((700, 3400), (800, 3200), (900, 3100), (800, 3300), (0, 4095))
    names = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")

    def __init__(self, config):
        assert config.use_degrees
        self.config, self.is_connected, self.is_calibrated = config, False, True
        self.steps = {
            name: 0.5 * sum(held) for name, held in zip(self.names, self.ranges, strict=True)
        }
        self.middles = dict(self.steps)

    def connect(self, calibrate=True):
        assert not calibrate
        self.is_connected = True

    def disconnect(self):
        assert not self.config.disable_torque_on_disconnect
        self.is_connected = False

    def get_observation(self):
        if not self.is_connected:
            raise ConnectionError("SO101Follower is not connected")
        degrees = {
            f"{name}.pos": (step - self.middles[name]) * 360 / 4095
            for name, step in self.steps.items()
        }
        return {**degrees, "gripper.pos": 12.0}

    def send_action(self, action):
        assert set(action) == {f"{name}.pos" for name in self.names}
        for key, value in action.items():
            name = key.removesuffix(".pos")
            self.steps[name] = value * 4095 / 360 + self.middles[name]
        return action


def fake_lerobot():
    """What stands in for ``lerobot.robots.so_follower``."""
    return SimpleNamespace(
        SO101FollowerConfig=lambda **settings: SimpleNamespace(**settings), SO101Follower=FakeSO101
    )
