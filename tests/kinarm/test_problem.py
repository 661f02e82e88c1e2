"""Problems: found, changed, compared, and written and read without loss."""

import dataclasses
import json
import math
import pickle
import shutil
import tomllib

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from kinarm.arm import ArmSpecification
from kinarm.errors import (
    InvalidInputError,
    ProblemError,
    UnknownNameError,
)
from kinarm.problem import PROBLEMS, ReachProblem, Stepping
from kinarm.scene import PAPER_BENCHES, GoalRegion, Mount, Obstacle, Scene
from kinarm.task import ReachTask, RewardWeights

RIGHT = PROBLEMS["right"]

texts = st.text(min_size=1, max_size=12)
numbers = st.floats(-9e5, 9e5)
lengths = st.floats(1e-6, 1e3)
points = st.tuples(numbers, numbers, numbers)


def corners(least):
    """Opposite corners of boxes whose edges have at least some length."""
    edges = st.floats(least, 1e3).map(lambda edge: edge if edge > 1e-3 else 0.0)

    def upper(lower):
        return st.tuples(st.just(lower), st.tuples(*(edges.map(low.__add__) for low in lower)))

    return points.flatmap(upper)


def boxes(kind):
    made = st.builds(
        lambda name, ends: kind(name=name, lower=ends[0], upper=ends[1]), texts, corners(1e-2)
    )
    return st.lists(made, max_size=3, unique_by=lambda box: box.name).map(tuple)


rewards = st.builds(
    RewardWeights,
    progress=numbers,
    closer=numbers,
    step=numbers,
    collision=numbers,
    success=numbers,
    allow_perverse=st.just(value=True),
)
arms = st.builds(
    ArmSpecification,
    source=st.sampled_from(["paper", "paper_flange", "lrmate200ic_5l"]),
    actuated=st.none() | st.just(("axis_1", "axis_2")),
    home=st.none() | st.tuples(*[st.floats(-1, 1)] * 6),
    velocity_limits=st.none() | st.tuples(*[lengths] * 6),
    digest=st.none() | st.just("0123456789abcdef"),
)
steppings = st.builds(Stepping, time_step=lengths, tested_configurations=st.integers(1, 32))


@st.composite
def problems(draw):
    """Problems of all kinds; their arms are not loaded."""
    regions = draw(boxes(GoalRegion).filter(bool))
    scene = Scene(
        ground=draw(st.booleans()),
        cube_edge=draw(st.floats(0, 10)),
        obstacles=draw(boxes(Obstacle)),
        goal_regions=regions,
    )
    assume(not any(map(scene.obstacle_around, regions)))
    named = draw(st.lists(st.sampled_from([r.name for r in regions]), min_size=1, unique=True))
    weights = st.lists(lengths, min_size=len(named), max_size=len(named))
    task = ReachTask(
        goal_regions=named,
        goal_weights=draw(st.just([]) | weights),
        tolerance=draw(lengths),
        horizon=draw(st.integers(1, 10**6)),
        start_spread=draw(st.floats(0, 1)),
        reward=draw(rewards),
    )
    parts = {"arm": draw(arms), "stepping": draw(steppings)}
    return ReachProblem(name=draw(texts), scene=scene, task=task, **parts)


class TestPapersProblems:
    def test_three(self):
        assert list(PROBLEMS) == ["left", "right", "both"]
        for name, problem in PROBLEMS.items():
            assert problem.name == name
            assert problem.arm == ArmSpecification()
            assert problem.scene == Scene()
            assert problem.stepping == Stepping(time_step=0.02, tested_configurations=4)
            expected = ("left", "right") if name == "both" else (name,)
            assert problem.task == ReachTask(goal_regions=expected)

    def test_frozen_hashable_and_picklable(self):
        with pytest.raises(dataclasses.FrozenInstanceError):
            RIGHT.name = "other"
        assert hash(RIGHT) == hash(RIGHT.replace())
        copy = pickle.loads(pickle.dumps(RIGHT))
        assert (copy, copy.digest) == (RIGHT, RIGHT.digest)

    def test_goal_regions_have_to_exist(self):
        with pytest.raises(UnknownNameError, match="task.goal_regions: 'up'; available: right, l"):
            ReachProblem(name="up", task=ReachTask(goal_regions=("up",)))

    @pytest.mark.parametrize("time_step", [0, -0.02, math.nan, math.inf])
    def test_bad_time_step(self, time_step):
        with pytest.raises(ProblemError, match="time_step must be finite and above 0 s"):
            RIGHT.replace(time_step=time_step)

    @pytest.mark.parametrize("count", [0, -1, 33, 2.5])
    def test_bad_number_of_tested_configurations(self, count):
        with pytest.raises(InvalidInputError, match="tested_configurations must be"):
            RIGHT.replace(tested_configurations=count)


class TestRoundTrip:
    @settings(max_examples=80)
    @given(problems())
    def test_json_and_toml_are_without_loss(self, problem):
        text = json.dumps(problem.to_json())
        assert ReachProblem.from_json(json.loads(text)) == problem
        assert ReachProblem.from_json(tomllib.loads(problem.to_toml())) == problem

    def test_a_scene_without_obstacles_stays_without(self, tmp_path):
        empty = RIGHT.replace(scene=Scene(obstacles=()), name="empty")
        empty.save(tmp_path / "empty.toml")
        assert ReachProblem.load(tmp_path / "empty.toml").scene.obstacles == ()


OTHER_REGION = GoalRegion(name="right", lower=(-0.5, -0.75, 0.4), upper=(0.5, -0.55, 0.4))
TURNED = (dataclasses.replace(PAPER_BENCHES[0], yaw=0.1), PAPER_BENCHES[1])
CHANGES = {
    "task.goal_regions[0]": {"task": "left"},
    "task.goal_regions[1]": {"goal_regions": ("right", "left")},
    "task.goal_weights[0]": {"goal_weights": (2,)},
    "task.tolerance": {"tolerance": 0.03},
    "task.horizon": {"horizon": 65},
    "task.start_spread": {"start_spread": 0.5},
    "task.reward.progress": {"reward": {"progress": 2}},
    "task.reward.closer": {"reward": {"closer": 2}},
    "task.reward.step": {"reward": {"step": 2}},
    "task.reward.collision": {"reward": {"collision": -2}},
    "task.reward.success": {"reward": {"success": 2}},
    "stepping.time_step": {"time_step": 0.01},
    "stepping.tested_configurations": {"tested_configurations": 5},
    "scene.ground": {"scene": Scene(ground=False)},
    "scene.cube_edge": {"scene": Scene(cube_edge=0.1)},
    "scene.obstacles[1].name": {"scene": Scene(obstacles=Scene().obstacles[:1])},
    "scene.obstacles[0].name": {"scene": Scene(obstacles=())},
    "scene.mount.position[0]": {"scene": Scene(mount=Mount(position=(0.1, 0, 0)))},
    "scene.obstacles[0].yaw": {"scene": Scene(obstacles=TURNED)},
    "task.starts[0][0]": {"starts": ((0.1, 0, 0, 0, 0, 0),)},
    "scene.goal_regions[0].lower[2]": {"scene": Scene(goal_regions=(OTHER_REGION,))},
    "arm": {"arm": "paper_flange"},
}


GOALS = ("task.goal_regions", "task.goal_weights")
"""Where problems may differ of which one covers the other."""


class TestDigest:
    def test_ignores_the_name(self):
        assert RIGHT.replace(name="other").digest == RIGHT.digest

    def test_ignores_whether_the_arm_is_pinned_and_where_it_lies(self, shipped_arms, tmp_path):
        shutil.copy(shipped_arms["paper"].urdf_path, tmp_path / "paper.urdf")
        assert RIGHT.pinned.digest == RIGHT.digest
        assert RIGHT.replace(arm=tmp_path / "paper.urdf").digest == RIGHT.digest

    def test_ignores_how_numbers_are_spelt(self):
        first = RIGHT.replace(tolerance=1, time_step=1, reward={"step": -0.0})
        second = RIGHT.replace(tolerance=1.0, time_step=1.0, reward={"step": 0})
        assert first.digest == second.digest

    def test_differs_with_every_other_field(self):
        digests = {RIGHT.replace(**changes).digest for changes in CHANGES.values()}
        assert len(digests) == len(CHANGES)
        assert RIGHT.digest not in digests

    def test_every_field_is_among_those_changes(self):
        """A new field has to be added above, and then counts."""
        fields = [
            *(f"task.reward.{item.name}" for item in dataclasses.fields(RewardWeights)),
            *(f"task.{item.name}" for item in dataclasses.fields(ReachTask)),
            *(f"stepping.{item.name}" for item in dataclasses.fields(Stepping)),
            *(f"scene.{item.name}" for item in dataclasses.fields(Scene)),
        ]
        missing = [
            name for name in fields if not any(changed.startswith(name) for changed in CHANGES)
        ]
        assert missing == ["task.reward.allow_perverse"]

    def test_is_the_same_everywhere(self):
        """Policies and documents that exist name these."""
        assert {name: problem.digest for name, problem in PROBLEMS.items()} == DIGESTS


DIGESTS = {"left": "f2f15f20aef49890", "right": "8691666825bbd7d7", "both": "8f68bea5ffa4997d"}


class TestComparison:
    @pytest.mark.parametrize(("field", "changes"), CHANGES.items())
    def test_first_difference_names_the_field(self, field, changes):
        other = RIGHT.replace(**changes)
        difference = RIGHT.first_difference(other)
        assert difference.startswith(f"{field} is ")
        assert (difference is None) == (RIGHT.digest == other.digest)
        with pytest.raises(ProblemError) as caught:
            RIGHT.check_same(other, "policy 'a.npz'")
        assert str(caught.value) == f"policy 'a.npz' is of another problem: {difference}"

    @pytest.mark.parametrize(
        ("changes", "difference"),
        [
            ({"tolerance": 0.03}, "task.tolerance is 0.03, not 0.05"),
            ({"goal_weights": (2,)}, "task.goal_weights[0] is 2.0, not missing"),
            ({"arm": "paper_flange"}, "arm is 'paper_flange', not 'paper'"),
            (
                {"arm": ArmSpecification(home=(0.1, 0, 0, 0, 0, 0))},
                "arm is another version of 'paper', not 'paper'",
            ),
        ],
    )
    def test_the_own_value_comes_last(self, changes, difference):
        assert RIGHT.first_difference(RIGHT.replace(**changes)) == difference

    def test_a_problem_covers_those_with_a_part_of_its_goals(self):
        both = PROBLEMS["both"]
        assert both.covers(both)
        assert both.covers(RIGHT)
        assert both.covers(PROBLEMS["left"])
        assert both.replace(goal_weights=(1, 2)).covers(RIGHT.replace(name="other"))
        assert not RIGHT.covers(both)
        assert not RIGHT.covers(PROBLEMS["left"])

    @pytest.mark.parametrize("field", [each for each in CHANGES if not each.startswith(GOALS)])
    def test_a_problem_covers_none_that_differs_in_something_else(self, field):
        assert not RIGHT.covers(RIGHT.replace(**CHANGES[field]))

    def test_the_same_problem_of_another_name(self):
        other = RIGHT.replace(name="other", arm=ArmSpecification(home=(0,) * 6)).pinned
        assert RIGHT.first_difference(other) is None
        RIGHT.check_same(other, "it")
