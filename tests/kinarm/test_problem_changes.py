"""Problems with some parts replaced: in Python, and by the options of the commands."""

import dataclasses

import pytest

from kinarm.arm import Arm, ArmSpecification
from kinarm.errors import ArmError, InvalidInputError, ProblemError, UnknownNameError
from kinarm.plant import Plant
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_options import ProblemOptions, say_choices
from kinarm.scene import Scene
from kinarm.simulator import Simulator
from kinarm.task import RewardWeights, Stepping

RIGHT = PROBLEMS["right"]


class TestReplace:
    def test_parts(self):
        both = PROBLEMS["both"].replace(arm="paper_flange", name="flange", horizon=5)
        assert RIGHT.replace(task="both") == PROBLEMS["both"].replace(name="right")
        assert RIGHT.replace(task=both.task).task == both.task
        assert RIGHT.replace(scene=Scene(ground=False)).scene == Scene(ground=False)
        assert RIGHT.replace(scene="left").scene == Scene()
        changed = RIGHT.replace(stepping=Stepping(time_step=0.1), tested_configurations=2)
        assert changed.stepping == Stepping(time_step=0.1, tested_configurations=2)

    def test_parts_as_mappings_beside_settings(self):
        changed = RIGHT.replace(plant={"noise": 0.01}, delay=2)
        assert changed.plant == Plant(noise=0.01, delay=2)
        changed = RIGHT.replace(task={"tolerance": 0.1}, reward={"success": 1.0}, scene="table")
        assert changed.task.reward == RewardWeights(success=1)
        assert changed.task.goal_regions == ("table",)

    def test_changes_are_told_also_if_they_lead_to_defaults(self):
        assert PROBLEMS["both"].changes == []
        assert PROBLEMS["both"].replace(tolerance=0.03).changes == ["task.tolerance = 0.03"]
        ideal = ReachProblem.load("hard-paper").replace(plant="ideal").changes
        assert {"plant.delay = 0", "plant.noise = 0.0"} <= set(ideal)

    def test_arm_as_name_path_specification_or_arm(self, shipped_arms):
        flange = shipped_arms["paper_flange"]
        for source in ("paper_flange", ArmSpecification(source="paper_flange"), flange):
            assert RIGHT.replace(arm=source).arm == ArmSpecification(source="paper_flange")
        by_path = RIGHT.replace(arm=flange.description.path)
        assert by_path.arm.source == str(flange.description.path)
        assert by_path.arm_digest == flange.digest

    def test_arm_keeps_what_it_was_loaded_with(self):
        arm = Arm.load("paper", home=(0.1, 0, 0, 0, 0, 0), actuated=("axis_1",))
        problem = RIGHT.replace(arm=arm)
        assert problem.arm_digest == arm.digest
        assert Simulator(problem).n_actions == 1

    def test_reward_as_weights_or_as_those_that_change(self):
        base = RIGHT.replace(reward=RewardWeights(progress=3, success=4))
        assert base.task.reward == RewardWeights(progress=3, success=4)
        assert base.replace(reward={"success": 5}).task.reward == RewardWeights(
            progress=3, success=5
        )
        assert base.replace(task="left", reward={"step": -1}).task.reward == RewardWeights(step=-1)

    @pytest.mark.parametrize(
        ("overrides", "error", "message"),
        [
            (
                {"horizons": 3},
                UnknownNameError,
                "setting of a problem 'horizons' .did you mean 'horizon'",
            ),
            (
                {"stepping": "fast", "time_step": 0.1},
                InvalidInputError,
                "stepping must be a table, got 'fast'",
            ),
            ({"reward": {"bonus": 1}}, UnknownNameError, "reward term 'bonus'; available: prog"),
            ({"plant": {"noises": 1}}, InvalidInputError, "problem: unknown key 'plant.noises'"),
            ({"scene": Scene(goal_regions=())}, ProblemError, "needs at least one goal region"),
        ],
    )
    def test_bad_values(self, overrides, error, message):
        with pytest.raises(error, match=message):
            RIGHT.replace(**overrides)


class TestArmOfAProblem:
    def test_pinned_problems_compare_without_loading_the_arm(self, monkeypatch):
        first, second = RIGHT.pinned, PROBLEMS["left"].pinned
        monkeypatch.setattr(Arm, "load", None)
        assert first.first_difference(second) == "task.goal_regions[0] is left, not right"
        assert first.digest != second.digest


class TestOptions:
    def test_all_given(self):
        changes = {"arm": "paper_flange", "task": "left", "tolerance": 0.1, "start_spread": 0.2}
        options = ProblemOptions(problem="both", scene="right", **changes)
        assert options.resolve() == PROBLEMS["both"].replace(**changes)

    def test_parts_of_an_arm(self, make_joint, write_robot, tmp_path):
        path = str(write_robot([make_joint("prismatic"), make_joint("prismatic")]))
        problem = ProblemOptions(
            arm=path, tool_frame="link_1", package_dirs=(str(tmp_path),)
        ).resolve()
        assert problem.arm == ArmSpecification(
            source=path, tool_frame="link_1", package_dirs=(str(tmp_path),)
        )
        again = ProblemOptions(tool_frame="link_2").resolve(problem.pinned)
        assert again.arm == dataclasses.replace(problem.arm, tool_frame="link_2")
        with pytest.raises(ArmError, match="no tool frame 'hand'"):
            ProblemOptions(tool_frame="hand").resolve(problem)

    def test_a_scene_alone_brings_its_goals(self):
        problem = ProblemOptions(scene="table").resolve("both")
        assert problem.task.goal_regions == ("table",)
        assert problem.name == "both"

    def test_a_scene_brings_its_goals_also_beside_a_task(self):
        options = ProblemOptions(problem="right", task="both", scene="table")
        assert options.resolve().task.goal_regions == ("table",)

    def test_choices_are_said_once_an_arm(self, make_joint, write_robot, capsys):
        path = str(write_robot([make_joint("prismatic")], tool=None))
        problem = ProblemOptions(arm=path).resolve()
        say_choices([problem, problem, RIGHT])
        assert capsys.readouterr().err == (
            "arm made: tool frame: 'link_1', the last link of the longest chain\n"
            "arm made: no moving link has a collision shape: it touches nothing, ever\n"
        )
