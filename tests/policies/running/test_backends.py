"""Backends: MuJoCo itself, and those of real arms beside libraries that answer as theirs do."""

import sys

import numpy as np
import pytest
from arm_libraries import FakeRTDE, FakeSO101, fake_lerobot
from known_arms import INSTALLED

from kinarm import ReachProblem, Simulator
from kinarm.errors import InvalidInputError, RunStoppedError
from kinarm.policies import load_policy
from kinarm.policies.running.backend import Backend, WiredArm
from kinarm.policies.running.check import ContractCheck
from kinarm.policies.running.mujoco_arm import MujocoArm
from kinarm.policies.running.run import Run
from kinarm.policies.running.so_arm import SOArm
from kinarm.policies.running.ur import URArm
from kinarm.world import World


@pytest.fixture
def no_waiting(monkeypatch):
    """Arms whose time is not the clock's."""
    clock = {"now": 0.0}
    monkeypatch.setattr(Backend, "now", lambda self: clock["now"])
    monkeypatch.setattr(Backend, "wait", lambda self, until: clock.update(now=until))


class TestMujoco:
    @pytest.fixture(autouse=True)
    def needs(self):
        pytest.importorskip("mujoco")

    @pytest.mark.parametrize("bandwidth", [20.0, 5.0])
    def test_policy_reaches(self, bandwidth):
        simulator = Simulator("both", threads=1).shielded()
        starts, goals = simulator.sample(np.random.default_rng(1), 4)
        arm = WiredArm(MujocoArm(simulator.world, starts[0], bandwidth), simulator.world)
        run = Run(arm, load_policy("ppo-best-both"), simulator, speed=0.5)
        assert [made.outcome for made in run.to_goals(goals)] == ["success"] * 4

    def test_servo_lags_as_a_critically_damped_one(self):
        world = World("both")
        arm = MujocoArm(world, world.arm.home, 5.0)
        arm.connect(0.01)
        arm.command(world.arm.home + 0.1 * (np.arange(6) == 0))
        arm.wait(0.1)
        rate = 2 * np.pi * 5.0 * 0.1
        assert arm.read()[0] == pytest.approx(0.1 * (1 - (1 + rate) * np.exp(-rate)), rel=0.03)

    def test_contact_stops_it(self):
        world = World("both")
        rng, arm = np.random.default_rng(0), world.arm
        q = rng.uniform(arm.lower, arm.upper, (200, 6)) * [1, 1, 1, 1, 1, 0]
        q = q[world.in_contact(q)][0]
        with WiredArm(MujocoArm(world, arm.home), world).connected(50.0) as wired:
            wired.command(q)
            with pytest.raises(RunStoppedError, match="the arm stopped, for .* touches "):
                wired.wait(5.0)


@pytest.mark.usefixtures("no_waiting")
class TestUR:
    @pytest.fixture
    def library(self, monkeypatch):
        fake = FakeRTDE([0.3, -1.2, 1.5, -1.9, -1.6, 0.7])
        for name, module in fake.modules().items():
            monkeypatch.setitem(sys.modules, name, module)
        return fake

    def arm(self, world):
        return WiredArm(URArm("10.0.0.2"), world)

    @INSTALLED
    def test_check_and_lost_connection(self, library):
        world = World(ReachProblem.load("benches-ur5"))
        check = ContractCheck(self.arm(world), world, np.array(library.q), rate=125.0)
        assert check.run() == []
        assert library.calls == ["servoStop", "stopScript", "control off", "receive off"]
        library.accepts = False
        with pytest.raises(RunStoppedError, match="refuses commands"):
            check.run()
        library.connected = False
        with pytest.raises(RunStoppedError, match="the controller does not answer"):
            check.run()
        library.connected, library.stopped = True, True
        with pytest.raises(RunStoppedError, match="its controller has stopped it"):
            check.run()

    def test_library_has_these_functions(self):
        control, receive = map(pytest.importorskip, ("rtde_control", "rtde_receive"))
        for name in ("servoJ", "servoStop", "stopScript", "disconnect"):
            assert callable(getattr(control.RTDEControlInterface, name))
        for name in ("getActualQ", "isConnected", "isProtectiveStopped", "isEmergencyStopped"):
            assert callable(getattr(receive.RTDEReceiveInterface, name))


@pytest.mark.usefixtures("no_waiting")
class TestSO101:
    @pytest.fixture(autouse=True)
    def library(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "lerobot.robots.so_follower", fake_lerobot())

    def test_units(self):
        """A position in radians is the same share of a turn of the encoder."""
        arm = SOArm("/dev/ttyACM0")
        arm.connect(0.02)
        middles = [0.5 * sum(ends) for ends in FakeSO101.ranges]
        np.testing.assert_allclose(arm.read(), np.zeros(5), atol=1e-12)
        told = np.array([0.3, -0.5, 0.2, 1.0, -0.7])
        arm.command(told)
        turned = (np.array(list(arm._robot.steps.values())) - middles) * 2 * np.pi / 4095
        np.testing.assert_allclose(turned, told, atol=1e-12)
        np.testing.assert_allclose(arm.read(), told, atol=1e-12)
        arm.close()
        with pytest.raises(ConnectionError):
            arm.read()

    @INSTALLED
    def test_check(self):
        world = World("desk-so101")
        arm = WiredArm(SOArm("/dev/ttyACM0"), world)
        assert ContractCheck(arm, world, np.zeros(5)).run() == []

    def test_not_calibrated_under_its_name(self):
        for name in ("kinarm", "mine"):
            arm = SOArm("/dev/ttyACM0", name)
            arm._robot.is_calibrated = False
            with pytest.raises(ConnectionError, match=f"lerobot-calibrate with --robot.id={name}$"):
                arm.connect(0.02)

    def test_without_the_library(self, monkeypatch):
        monkeypatch.setitem(sys.modules, "lerobot.robots.so_follower", None)
        with pytest.raises(InvalidInputError, match="lerobot is not installed"):
            SOArm("/dev/ttyACM0")
