"""Tasks that list the configurations where episodes start."""

import numpy as np
import pytest
from scipy import stats

from kinarm.errors import InvalidInputError, ProblemError
from kinarm.problem import PROBLEMS
from kinarm.scene import Obstacle, Scene
from kinarm.simulator import Simulator

LISTED = ((0.0,) * 6, (0.5, 0.1, 0.0, 0.0, 0.0, 0.0), (-0.5, 0.0, 0.2, 0.0, 0.0, 0.0))
RIGHT = PROBLEMS["right"]


def test_each_is_drawn_as_often_as_the_others():
    starts, _ = Simulator(RIGHT.replace(starts=LISTED)).sample(np.random.default_rng(3), 6000)
    counts = [int((starts == listed).all(axis=1).sum()) for listed in LISTED]
    assert sum(counts) == 6000
    assert stats.chisquare(counts).pvalue > 1e-4


def test_those_near_the_goal_are_not_drawn_for_it():
    """The second one reaches every goal of a region as large as the tolerance."""
    simulator = Simulator(RIGHT.replace(starts=LISTED, tolerance=0.5))
    starts, goals = simulator.sample(np.random.default_rng(4), 500)
    tools = np.array([simulator.arm.tool_position(start) for start in starts])
    assert (np.linalg.norm(tools - goals, axis=1) > 0.5).all()
    assert {tuple(start) for start in starts} <= {*LISTED}


def test_where_none_is_far_from_the_goal_there_is_nothing_to_draw():
    simulator = Simulator(RIGHT.replace(starts=LISTED[:1], tolerance=3.0))
    with pytest.raises(ProblemError, match=r"from task\.starts; in the last one the tool already"):
        simulator.sample(np.random.default_rng(5), 1)


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ((0.0,) * 5, r"task.starts\[1\] must have shape \(6\), got \(5,\)"),
        ((9.0, *[0.0] * 5), r"task.starts\[1\] lies outside the limits: \[9.0, 0.0"),
    ],
)
def test_those_that_no_arm_can_take_are_refused(start, words):
    with pytest.raises((InvalidInputError, ProblemError), match=words):
        Simulator(RIGHT.replace(starts=(LISTED[0], start)))


def test_those_in_contact_are_refused():
    arm = Simulator(RIGHT).arm
    x, y, z = arm.tool_position(LISTED[0])
    crate = Obstacle(
        name="crate", lower=(x - 0.05, y - 0.05, z - 0.05), upper=(x + 0.05, y + 0.05, z + 0.05)
    )
    scene = Scene(obstacles=(crate,), goal_regions=RIGHT.scene.goal_regions)
    with pytest.raises(ProblemError, match=r"task.starts\[0\] is in contact: .* touches crate"):
        Simulator(RIGHT.replace(starts=LISTED[:1], scene=scene))
