"""Problems with some parts replaced: in Python, and by the options of the commands."""

import dataclasses
import math

import pytest

from kinarm.arm import Arm, ArmSpecification
from kinarm.errors import ArmError, InvalidInputError, KinarmError, ProblemError, UnknownNameError
from kinarm.problem import PROBLEMS, Stepping
from kinarm.problem_options import ProblemOptions, say_choices
from kinarm.scene import Scene
from kinarm.simulator import Simulator
from kinarm.task import ReachTask, RewardWeights

RIGHT = PROBLEMS["right"]


class TestReplace:
    def test_nothing(self):
        assert RIGHT.replace() == RIGHT
        assert RIGHT.replace(tolerance=None, arm=None, reward=None) == RIGHT

    def test_parts(self):
        both = PROBLEMS["both"].replace(arm="paper_flange", name="flange", horizon=5)
        assert RIGHT.replace(task="both") == PROBLEMS["both"].replace(name="right")
        assert RIGHT.replace(task=both.task).task == both.task
        assert RIGHT.replace(scene=Scene(ground=False)).scene == Scene(ground=False)
        assert RIGHT.replace(scene="left").scene == Scene()
        stepping = Stepping(time_step=0.1)
        assert RIGHT.replace(stepping=stepping).stepping == stepping
        assert RIGHT.replace(stepping=stepping, tested_configurations=2).stepping == Stepping(
            time_step=0.1, tested_configurations=2
        )

    def test_arm_as_name_path_specification_or_arm(self, shipped_arms):
        flange = shipped_arms["paper_flange"]
        for source in ("paper_flange", ArmSpecification(source="paper_flange"), flange):
            assert RIGHT.replace(arm=source).arm == ArmSpecification(source="paper_flange")
        by_path = RIGHT.replace(arm=flange.urdf_path)
        assert by_path.arm.source == str(flange.urdf_path)
        assert by_path.arm_digest == flange.digest

    def test_arm_keeps_what_it_was_loaded_with(self):
        arm = Arm.load("paper", home=(0.1, 0, 0, 0, 0, 0), actuated=("axis_1",))
        problem = RIGHT.replace(arm=arm)
        assert problem.arm_digest == arm.digest
        assert Simulator(problem).n_actions == 1

    def test_task_and_scene_of_a_file(self, tmp_path):
        path = tmp_path / "mine.toml"
        path.write_text("[task]\nhorizon = 7\n[scene]\nground = false")
        assert RIGHT.replace(task=path).task.horizon == 7
        assert not RIGHT.replace(scene=str(path)).scene.ground

    def test_fields_win_over_the_parts_that_hold_them(self):
        assert RIGHT.replace(task="both", tolerance=0.2).task == ReachTask(
            goal_regions=("left", "right"), tolerance=0.2
        )

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
            ({"horizons": 3}, UnknownNameError, "setting of a problem 'horizons'; available: .*"),
            ({"benches": ()}, UnknownNameError, "setting of a problem 'benches'"),
            (
                {"reward": {"bonus": 1}},
                UnknownNameError,
                "reward term 'bonus'; available: progress",
            ),
            ({"reward": {"success": math.nan}}, ProblemError, "success must be finite"),
            ({"reward": {"success": "high"}}, InvalidInputError, "success must be a number"),
            ({"reward": 3}, InvalidInputError, "reward must be a table, got 3"),
            ({"tolerance": "wide"}, InvalidInputError, r"tolerance must be a number \[m\]"),
            ({"arm": "nope"}, UnknownNameError, "arm 'nope'; available: .*paper"),
            ({"task": "up"}, UnknownNameError, "task 'up'"),
            ({"scene": "up"}, UnknownNameError, "scene 'up'"),
            ({"scene": Scene(goal_regions=())}, ProblemError, "needs at least one goal region"),
            ({"goal_regions": ("up",)}, UnknownNameError, "goal_regions: 'up'; available"),
            ({"stepping": 0.1}, InvalidInputError, "stepping must be a table"),
            ({"name": 3}, InvalidInputError, "name must be a text, got 3"),
        ],
    )
    def test_bad_values(self, overrides, error, message):
        with pytest.raises(error, match=message):
            RIGHT.replace(**overrides)


class TestArmOfAProblem:
    def test_a_pinned_problem_wants_the_arm_that_it_had(self):
        pinned = RIGHT.pinned
        assert pinned.arm.digest == Arm.load("paper").digest == RIGHT.arm_digest
        assert Arm.load(pinned.arm).name == "paper"
        changed = RIGHT.replace(arm=dataclasses.replace(pinned.arm, digest="0123456789abcdef"))
        with pytest.raises(ArmError, match="arm 'paper' is another version"):
            Simulator(changed)

    def test_pinned_problems_compare_without_loading_the_arm(self, monkeypatch):
        first, second = RIGHT.pinned, PROBLEMS["left"].pinned
        monkeypatch.setattr(Arm, "load", None)
        assert first.first_difference(second) == "task.goal_regions[0] is left, not right"
        assert first.digest != second.digest


class TestOptions:
    def test_nothing_given_is_the_default(self):
        assert ProblemOptions().resolve() == RIGHT
        assert ProblemOptions().resolve("left") == PROBLEMS["left"]

    def test_all_given(self):
        options = ProblemOptions(
            problem="both",
            arm="paper_flange",
            task="left",
            scene="right",
            tolerance=0.1,
            horizon=5,
            start_spread=0.2,
        )
        assert options.resolve() == PROBLEMS["both"].replace(
            arm="paper_flange", task="left", tolerance=0.1, horizon=5, start_spread=0.2
        )

    def test_a_task_alone_names_the_problem(self):
        assert ProblemOptions(task="left").resolve("both") == PROBLEMS["left"]

    def test_bad_values(self):
        with pytest.raises(UnknownNameError, match="problem 'up'"):
            ProblemOptions(problem="up").resolve()
        with pytest.raises(KinarmError, match="tolerance"):
            ProblemOptions(tolerance=-1).resolve()

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

    def test_choices_are_said_once_an_arm(self, make_joint, write_robot, capsys):
        path = str(write_robot([make_joint("prismatic")], tool=None))
        problem = ProblemOptions(arm=path).resolve()
        say_choices([problem, problem, RIGHT])
        assert capsys.readouterr().err == (
            "arm made: tool frame: 'link_1', the last link of the longest chain\n"
        )
