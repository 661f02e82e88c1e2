"""What the machine attains, and where time goes."""

import time

import numpy as np
import pytest

from kinarm.errors import MissingExtraError
from kinarm.evaluation.measurements import limits, robots
from kinarm.evaluation.measurements.attainable import (
    CHAINS,
    attainable_operations,
    multiply_and_add,
)
from kinarm.evaluation.measurements.shares import time_shares
from kinarm.kernels.lanes import LANES
from kinarm.problem import PROBLEMS
from kinarm.simulator import Simulator


def test_kernel_multiplies_and_adds_in_every_lane():
    space = np.zeros((2 + CHAINS, LANES))
    space[0], space[1] = 0.5, 3.0
    space[2:] = np.arange(CHAINS * LANES, dtype=float).reshape(CHAINS, LANES)
    expected = space[2:].copy()
    multiply_and_add(10, space)
    for _ in range(10):
        expected = expected * 0.5 + 3.0
    assert np.array_equal(space[2:], expected)
    assert attainable_operations(10) == 10 * 2 * expected.size


def test_rates_are_measured_on_one_thread_and_the_threads_stay(monkeypatch, train_novice):
    monkeypatch.setattr(limits, "BATCH", 6)
    monkeypatch.setattr(limits, "TURNS", 100)
    simulator, threads = Simulator("left", threads=3), []
    roll = simulator.rollout
    monkeypatch.setattr(
        simulator, "rollout", lambda *a: threads.append(simulator.threads) or roll(*a)
    )
    found = limits.measure_attainable(simulator, train_novice("left"), 1)
    assert set(threads) == {1}
    assert simulator.threads == 3
    assert all(0 < rate["median"] <= rate["best"] for rate in found.values())


def test_share_is_what_the_operations_of_the_steps_take(monkeypatch):
    monkeypatch.setattr(limits, "measure_operations", lambda _: {"total": 2000.0})
    monkeypatch.setattr(limits, "measure_shares", lambda _: {})
    attainable = {
        "operations_per_second": {"median": 50e9},
        "steps_per_second": {"median": 5e6},
    }
    assert limits.measure_limits("x", None, attainable)["share_of_attainable"] == 0.2


def test_time_is_shared_out_by_module():
    def run():
        Simulator("right", threads=1)
        time.sleep(0.2)

    shares = time_shares(run)
    assert sum(shares.values()) == pytest.approx(1)
    assert shares["Python"] > 0.2
    assert all(share >= 0.03 for name, share in shares.items() if name != "everything else")


def test_iterations_of_learners_are_told(monkeypatch, train_novice):
    monkeypatch.setattr(limits, "BATCH", 6)
    monkeypatch.setattr(limits, "PROFILED_ITERATIONS", 1)
    monkeypatch.setattr("kinarm.policies.learners.find_spec", lambda name: None)
    found = limits.measure_shares(train_novice("left"))
    assert list(found) == [
        "rollouts of 6 episodes",
        "iteration of ARS, `paper`",
        "iteration of ARS, `tuned`",
    ]
    assert "compiled kernels" in found["iteration of ARS, `tuned`"]


class TestRobots:
    def test_left_out_without_the_package(self, monkeypatch):
        monkeypatch.setattr(robots, "PACKAGE", "no-such-package")
        robots.novice.cache_clear()
        robots.robot_problem.cache_clear()
        (row,) = robots.measure_robots(1)
        assert "pip install 'kinarm[robots]'" in row["skipped"]

    def test_left_out_where_the_package_is_incomplete(self, monkeypatch):
        monkeypatch.setattr(robots.metadata, "files", lambda _: ["robots/README.md"])
        with pytest.raises(MissingExtraError, match="example-robot-data"):
            robots.robots_folder()

    def test_novices_are_trained_for_their_robot(self, monkeypatch):
        monkeypatch.setattr(robots, "robot_problem", PROBLEMS.get)
        monkeypatch.setattr(robots, "TRAINING_ITERATIONS", 2)
        made = robots.novice.__wrapped__("left").provenance
        assert made.problem.name == "left"
        assert made.config["iterations"] == 2

    def test_rows_name_their_arm(self, monkeypatch, train_novice):
        monkeypatch.setattr(robots, "ROBOT_BATCH", 6)
        monkeypatch.setattr(robots, "novice", lambda name: train_novice("right"))
        rows = robots.measure_robots(1)
        assert {row["arm"] for row in rows} == set(robots.ROBOTS)
        assert {row["batch"] for row in rows} == {6}

    def test_joints_of_a_hand_are_fixed(self, tmp_path):
        urdf = tmp_path / "arm.urdf"
        urdf.write_text(
            '<robot name="a"><joint name="one" type="revolute"/>'
            '<joint name="two" type="prismatic"><mimic joint="one"/></joint></robot>'
        )
        made = robots._with_fixed_joints(urdf, ("two",), tmp_path / "made.urdf").read_text()
        assert '<joint name="one" type="revolute"' in made
        assert '<joint name="two" type="fixed"' in made
        assert "mimic" not in made

    @pytest.mark.parametrize(("name", "joints"), [("ur5", 6), ("panda", 7)])
    def test_robots_are_those_of_the_package(self, name, joints):
        try:
            problem = robots.robot_problem(name)
        except MissingExtraError as error:
            pytest.skip(str(error))
        assert Simulator(problem).arm.n_joints == joints
        assert problem.task == PROBLEMS["right"].task
