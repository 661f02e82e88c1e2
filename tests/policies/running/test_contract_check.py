"""The check of a contract: errors of all kinds are caught, and none is imagined."""

import re
import warnings

import numpy as np
import pytest
from random_policies import sliding

from docs.measurements.injections import KINDS, FaultyArm, measure
from kinarm import ReachProblem, Scene
from kinarm.errors import InvalidInputError
from kinarm.policies.running.backend import WiredArm
from kinarm.policies.running.check import ContractCheck
from kinarm.policies.running.fake import FakeArm
from kinarm.world import World

POSE = np.array([0.5, 0.9, 1.3, -0.6, -1.1, 0.0])


@pytest.fixture(scope="module")
def world():
    return World("both")


def said(world, reads=np.copy, takes=np.copy, pose=POSE):
    return ContractCheck(
        WiredArm(FaultyArm(world, pose, reads=reads, takes=takes), world), world, pose
    ).run()


def changed(joint, factor=1.0, shift=0.0):
    which = np.arange(6) == joint
    return lambda positions: np.where(which, positions * factor + shift, positions)


@pytest.mark.parametrize(
    ("reads", "takes", "words"),
    [
        (changed(1, -1.0), changed(1, -1.0), "axis_2 reads -0.900, and is at 0.900: its sign"),
        (changed(2, 57.3), np.copy, "axis_3 reads 74.49.* degrees"),
        (changed(0, 1.0, 0.3), np.copy, "axis_1 reads 0.800, and is at 0.500: its offset"),
        (np.copy, changed(3, -1.0), "axis_4 moves by .* when it is told to stay"),
        (np.copy, changed(4, 1.0, 0.2), "axis_5 moves by .* when it is told to stay"),
        (lambda q: q[[0, 2, 1, 3, 4, 5]], np.copy, "axis_2 reads 1.300.* axis_3 is there"),
        (lambda q: np.where(np.arange(6) == 1, 0.9, q), np.copy, "axis_2 .* stale"),
    ],
)
def test_says_what_is_wrong(world, reads, takes, words):
    assert re.search(words, "\n".join(said(world, reads, takes)))


def test_a_pose_of_zero_tells_nothing_of_units(world):
    with warnings.catch_warnings(action="error"):
        (line,) = said(world, changed(0, 1.0, 0.3), np.copy, POSE * [0, 1, 1, 1, 1, 1])
    assert line == "axis_1 reads 0.300, and is at 0.000: its offset, scale or sign"


def test_sign_of_a_command_shows_at_zero(world):
    pose = POSE * [1, 1, 1, 0, 1, 1]
    (line,) = said(world, takes=changed(3, -1.0), pose=pose)
    assert line.startswith("axis_4 is told to move by")
    assert line.endswith("its sign")


def test_what_does_not_show_at_a_pose_is_said(world):
    arm = WiredArm(FakeArm(world, POSE), world)
    assert ContractCheck(arm, world, POSE).unseen() == []
    lines = ContractCheck(arm, world, POSE * [0, 1, 1, 1, 1, 1]).unseen()
    assert lines == ["sign or scale, if wrong both ways, of axis_1"]
    pose = POSE * [0, 1, 1, 1, 1, 1]
    assert said(world, changed(0, -1.0), changed(0, -1.0), pose) == []


@pytest.mark.parametrize("rate", [2.0, 5.0, 10.0])
def test_slow_cycles(rate, make_joint, write_robot):
    """Readings on the way to where a joint is told to be do not count."""
    scene, pose = Scene(obstacles=(), ground=False), np.array([0.5, 0.9, 1.3])
    arm = sliding(make_joint, write_robot)
    world = World(ReachProblem.load("both").replace(arm=arm, scene=scene))
    assert ContractCheck(WiredArm(FakeArm(world, pose), world), world, pose, rate).run() == []


def test_injections():
    found = measure("paper", 160, 60)
    assert len(found["tally"]) == 3 * len(KINDS[:-1]) + 2
    assert (found["missed"], found["imagined"]) == ([], [])


def test_pose_in_contact(world):
    rng, arm = np.random.default_rng(0), world.arm
    q = rng.uniform(arm.lower, arm.upper, (200, 6))
    pose = q[world.in_contact(q)][0]
    with pytest.raises(InvalidInputError, match="too narrow: around it, .* touches"):
        ContractCheck(WiredArm(FakeArm(world, POSE), world), world, pose)
