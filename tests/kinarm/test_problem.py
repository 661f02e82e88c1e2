"""Problems: found, changed, compared, and written and read without loss."""

import dataclasses
import json
import pickle
import shutil
import tomllib

import pytest
from random_scenes import CLUTTER, random_scene, swinging

from kinarm.arm import ArmSpecification
from kinarm.errors import KinarmError, UnknownNameError
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.scene import PAPER_BENCHES, GoalRegion, Mount, Scene
from kinarm.task import ReachTask, RewardWeights, Stepping

RIGHT = PROBLEMS["right"]


class TestPapersProblems:
    def test_three(self):
        assert list(PROBLEMS) == ["left", "right", "both"]
        for name, problem in PROBLEMS.items():
            assert problem.name == name
            assert problem.arm == ArmSpecification()
            assert problem.scene == Scene()
            assert problem.stepping == Stepping(time_step=0.02, tested_configurations=0)
            expected = ("left", "right") if name == "both" else (name,)
            assert problem.task == ReachTask(goal_regions=expected)

    def test_goal_regions_have_to_exist(self):
        with pytest.raises(UnknownNameError, match="task.goal_regions: 'up'; available: right, l"):
            ReachProblem(name="up", task=ReachTask(goal_regions=("up",)))

    def test_impossible_steps(self):
        for changes in (
            {"time_step": 0},
            {"tested_configurations": 33},
            {"tested_configurations": -1},
        ):
            with pytest.raises(KinarmError, match=next(iter(changes))):
                RIGHT.replace(**changes)


OTHER_REGION = GoalRegion(name="right", lower=(-0.5, -0.75, 0.4), upper=(0.5, -0.55, 0.4))
TURNED = (dataclasses.replace(PAPER_BENCHES[0], yaw=0.1), PAPER_BENCHES[1])
BODIES = (*PAPER_BENCHES, *random_scene(4, 12, moving=6).obstacles)
DRAWN = (CLUTTER, swinging(0.3))
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
    "stepping.shield": {"shield": True},
    "stepping.time_step": {"time_step": 0.01},
    "stepping.tested_configurations": {"tested_configurations": 5},
    "scene.ground": {"scene": Scene(ground=False)},
    "scene.cube_edge": {"scene": Scene(cube_edge=0.1)},
    "scene.obstacles[1].name": {"scene": Scene(obstacles=Scene().obstacles[:1])},
    "scene.obstacles[0].name": {"scene": Scene(obstacles=())},
    "scene.mount.position[0]": {"scene": Scene(mount=Mount(position=(0.1, 0, 0)))},
    "scene.obstacles[0].yaw": {"scene": Scene(obstacles=TURNED)},
    "scene.obstacles[2].name": {"scene": Scene(obstacles=BODIES)},
    "scene.random_bodies[0].name": {"scene": Scene(random_bodies=DRAWN)},
    "scene.seed": {"scene": Scene(seed=1)},
    "task.reachable_goals": {"reachable_goals": True},
    "task.starts[0][0]": {"starts": ((0.1, 0, 0, 0, 0, 0),)},
    "scene.goal_regions[0].lower[2]": {"scene": Scene(goal_regions=(OTHER_REGION,))},
    "arm": {"arm": "paper_flange"},
    "plant.delay[0]": {"plant": "hard"},
}


GOALS = ("task.goal_regions", "task.goal_weights")
"""Where problems may differ of which one covers the other."""


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_json_and_toml_are_without_loss(changes):
    problem = RIGHT.replace(**changes, name="é")
    copy = pickle.loads(pickle.dumps(problem))
    assert (copy, copy.digest) == (problem, problem.digest)
    assert ReachProblem.from_json(json.loads(json.dumps(problem.to_json()))) == problem
    assert ReachProblem.from_json(tomllib.loads(problem.to_toml())) == problem


class TestDigest:
    def test_ignores_whether_the_arm_is_pinned_and_where_it_lies(self, shipped_arms, tmp_path):
        shutil.copy(shipped_arms["paper"].description.path, tmp_path / "paper.urdf")
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
        # A weight of rotation needs another kind of goal.
        assert missing == ["task.reward.rotation", "task.reward.allow_perverse"]

    def test_is_the_same_everywhere(self):
        """Policies and documents that exist name these."""
        found = {name: each.replace(tested_configurations=4) for name, each in PROBLEMS.items()}
        assert {name: each.digest for name, each in found.items()} == DIGESTS


DIGESTS = {"left": "f2f15f20aef49890", "right": "8691666825bbd7d7", "both": "8f68bea5ffa4997d"}


class TestComparison:
    @pytest.mark.parametrize(("field", "changes"), CHANGES.items())
    def test_first_difference_names_the_field(self, field, changes):
        difference = RIGHT.first_difference(RIGHT.replace(**changes))
        assert difference.startswith(f"{field} is ")

    @pytest.mark.parametrize(
        ("changes", "difference"),
        [
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
