"""Problems: found, changed, compared, and written and read without loss."""

import dataclasses
import json
import math
import pickle
import shutil
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kinarm.arm import Arm, ArmSpecification
from kinarm.errors import (
    ArmError,
    InvalidInputError,
    KinarmError,
    OutputError,
    ProblemError,
    UnknownNameError,
)
from kinarm.problem import PROBLEMS, ReachProblem, Stepping
from kinarm.problem_options import ProblemOptions
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.simulator import Simulator
from kinarm.task import ReachTask, RewardWeights
from kinarm.world import World

RIGHT = PROBLEMS["right"]

texts = st.text(min_size=1, max_size=12)
numbers = st.floats(-1e6, 1e6)
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
    named = draw(st.lists(st.sampled_from([r.name for r in regions]), min_size=1, unique=True))
    weights = st.lists(lengths, min_size=len(named), max_size=len(named))
    task = ReachTask(
        goal_regions=named,
        goal_weights=draw(st.just([]) | weights),
        tolerance=draw(lengths),
        horizon=draw(st.integers(1, 10**9)),
        start_spread=draw(st.floats(0, 1)),
        reward=draw(rewards),
    )
    parts = {"arm": draw(arms), "stepping": draw(steppings)}
    return ReachProblem(name=draw(texts), scene=scene, task=task, **parts)


@pytest.fixture
def write(tmp_path):
    """Write a problem file and return its path."""

    def write_file(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write_file


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

    def test_shown_in_one_line(self):
        shown = repr(PROBLEMS["both"])
        assert shown == "ReachProblem('both', arm 'paper', goals left and right)"

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


class TestLoad:
    def test_by_name_object_and_file(self, write):
        assert ReachProblem.load("left") is PROBLEMS["left"]
        assert ReachProblem.load(RIGHT) is RIGHT
        path = write(RIGHT.replace(name="mine").to_toml())
        for source in (path, str(path)):
            assert ReachProblem.load(source) == RIGHT.replace(name="mine")

    def test_unknown_name(self):
        with pytest.raises(
            UnknownNameError, match="problem 'up'; available: left, right, both, path/to/problem"
        ):
            ReachProblem.load("up")

    @pytest.mark.parametrize("name", ["gone.toml", "folder/gone", "gone/mine.toml"])
    def test_missing_file(self, tmp_path, name):
        with pytest.raises(InvalidInputError, match="cannot read problem .*gone.*No such file"):
            ReachProblem.load(tmp_path / name)

    def test_name_of_a_file_in_the_current_folder(self, write, monkeypatch, tmp_path):
        write("", "plain")
        monkeypatch.chdir(tmp_path)
        assert ReachProblem.load("plain").name == "plain"


class TestFile:
    def test_what_is_left_out_is_that_of_the_base(self, write):
        assert ReachProblem.load(write("")) == RIGHT.replace(name="mine")
        based = ReachProblem.load(write('base = "both"\n[task]\ntolerance = 0.01'))
        assert based == PROBLEMS["both"].replace(name="mine", tolerance=0.01)

    def test_tables_are_merged_key_by_key_and_lists_replaced(self, write):
        path = write(
            """
            name = "post"
            [arm]
            source = "paper_flange"
            [[scene.obstacles]]
            name = "post"
            lower = [0.4, 0, 0]
            upper = [0.45, 0.05, 1]
            [task]
            goal_regions = ["right", "left"]
            goal_weights = [1, 3]
            [task.reward]
            success = 2
            [stepping]
            tested_configurations = 8
            """
        )
        post = Obstacle(name="post", lower=(0.4, 0, 0), upper=(0.45, 0.05, 1))
        assert ReachProblem.load(path) == RIGHT.replace(
            name="post",
            arm="paper_flange",
            scene=Scene(obstacles=(post,)),
            task=ReachTask(
                goal_regions=("right", "left"),
                goal_weights=(1, 3),
                reward=RewardWeights(success=2),
            ),
            tested_configurations=8,
        )

    def test_relative_paths_start_at_the_folder_of_the_file(
        self, write, shipped_arms, tmp_path, monkeypatch
    ):
        shutil.copy(shipped_arms["paper"].urdf_path, tmp_path / "robot.urdf")
        path = write('[arm]\nsource = "robot.urdf"\npackage_dirs = ["meshes"]')
        monkeypatch.chdir("/")
        problem = ReachProblem.load(path)
        assert problem.arm.source == str((tmp_path / "robot.urdf").resolve())
        assert problem.arm.package_dirs == (str((tmp_path / "meshes").resolve()),)
        assert problem.arm.name == "robot"
        assert World(problem).arm.digest == shipped_arms["paper"].digest

    def test_missing_robot_is_named_with_its_folder(self, write, tmp_path):
        problem = ReachProblem.load(write('[arm]\nsource = "robot.urdf"'))
        with pytest.raises(ArmError, match=f"URDF '{tmp_path.resolve()}/robot.urdf' does not"):
            World(problem)

    def test_saved_and_loaded(self, tmp_path):
        problem = PROBLEMS["both"].replace(arm="lrmate200ic_5l", name="long").pinned
        problem.save(tmp_path / "long.toml")
        assert ReachProblem.load(tmp_path / "long.toml") == problem
        with pytest.raises(OutputError, match="cannot write"):
            problem.save(tmp_path / "gone" / "long.toml")

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("[task]\nhorizons = 3", "unknown key 'task.horizons'; available: .*horizon"),
            ("horizon = 3", "unknown key 'horizon'; available: name, arm, scene, task, stepping"),
            ("[arm]\nn_actuated = 5", "unknown key 'arm.n_actuated'"),
            ('[task]\ntolerance = "5 cm"', r"task.tolerance must be a number \[m\], got '5 cm'"),
            ("[task]\nhorizon = 2.5", "task.horizon must be a whole number, got 2.5"),
            ("[task]\nhorizon = true", "task.horizon must be a whole number, got True"),
            ("[task]\nhorizon = 0", "task: horizon must be a whole number of at least 1, got 0"),
            ("[task]\ntolerance = -1", "task: tolerance must be greater than 0 m, got -1"),
            ("[task]\ntolerance = nan", "task: tolerance must be greater than 0 m, got nan"),
            (f"[task]\ntolerance = 1{400 * '0'}", "task.tolerance must be a number"),
            ("[task.reward]\ncollision = 1", "task.reward: .*collision = 1 rewards contact"),
            ('[task]\ngoal_regions = "left"', "task.goal_regions must be a list, each .* a text"),
            ('[task]\ngoal_regions = ["up"]', "goal region in task.goal_regions: 'up'"),
            ('[task]\ngoal_regions = ["left", "left"]', "goal_regions names one twice: left, left"),
            ("[stepping]\ntime_step = 0", "stepping: time_step must be finite and above 0 s"),
            ("task = 3", "task must be a table, got 3"),
            ("name = 3", "name must be a text, got 3"),
            ('[arm]\nhome = "zero"', r"arm.home must be a list, each entry a number \[rad or m\]"),
            ('base = "up"', "base must be one of left, right, both, got 'up'"),
            ('base = ["up"]', "base must be one of left, right, both"),
            ("[task", "not a problem file: "),
            ("[task]\nhorizon = 3\nhorizon = 4", "not a problem file: "),
            ("a = " + "[" * 5000, "not a problem file: "),
            (
                '[[scene.obstacles]]\nname = "post"\nlower = [0, 0, 0]',
                r"'scene.obstacles\[0\].upper' is missing: Opposite corners",
            ),
            (
                '[[scene.obstacles]]\nname = "post"\nlower = [0, 0]\nupper = [1, 1, 1]',
                r"scene.obstacles\[0\].lower must be a list of 3, each a number \[m\]",
            ),
            (
                '[[scene.goal_regions]]\nname = "right"\nlower = [0, 0, 1]\nupper = [1, 0, 1]',
                r"scene.goal_regions\[0\]: goal region 'right' is empty",
            ),
            (
                2
                * '[[scene.goal_regions]]\nname = "right"\nlower = [0, 0, 1]\nupper = [1, 1, 1]\n',
                "scene: two goal regions are called 'right'",
            ),
            (
                2 * '[[scene.obstacles]]\nname = "box"\nlower = [0, 0, 0]\nupper = [1, 1, 1]\n',
                "scene: two obstacles are called 'box'",
            ),
        ],
    )
    def test_bad_content_is_one_line_that_names_file_key_and_what_is_expected(
        self, write, text, message
    ):
        path = write(text)
        with pytest.raises(InvalidInputError, match=message) as caught:
            ReachProblem.load(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("content", [b"\xff\xfe", b"\x00", bytes(range(256))])
    def test_binary_content(self, tmp_path, content):
        path = tmp_path / "mine.toml"
        path.write_bytes(content)
        with pytest.raises(InvalidInputError, match=f"{path}: not a problem file: "):
            ReachProblem.load(path)

    def test_folder(self, tmp_path):
        with pytest.raises(InvalidInputError, match="cannot read problem .*directory"):
            ReachProblem.load(tmp_path)


class TestRoundTrip:
    @settings(max_examples=80)
    @given(problems())
    def test_json_and_toml_are_without_loss(self, problem):
        text = json.dumps(problem.to_json())
        assert ReachProblem.from_json(json.loads(text)) == problem
        assert ReachProblem.from_json(tomllib.loads(problem.to_toml())) == problem

    @pytest.mark.parametrize("name", ['"', "\\", "\n\t", "é漢🤖", "\x7f", "\x00", "[a.b]", "#"])
    def test_names_of_all_kinds(self, name):
        box = Obstacle(name=name, lower=(0, 0, 0), upper=(1, 1, 1))
        problem = RIGHT.replace(name=name, scene=Scene(obstacles=(box,)))
        assert ReachProblem.from_json(tomllib.loads(problem.to_toml())) == problem

    def test_a_scene_without_obstacles_stays_without(self, tmp_path):
        empty = RIGHT.replace(scene=Scene(obstacles=()), name="empty")
        empty.save(tmp_path / "empty.toml")
        assert ReachProblem.load(tmp_path / "empty.toml").scene.obstacles == ()

    def test_entries_that_are_no_table(self):
        with pytest.raises(InvalidInputError, match="here: it must be a table, got 3"):
            ReachProblem.from_json(3, "here")
        with pytest.raises(InvalidInputError, match="problem: 'name' is missing"):
            ReachProblem.from_json({})


OTHER_REGION = GoalRegion(name="right", lower=(-0.5, -0.75, 0.4), upper=(0.5, -0.55, 0.4))
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
    "scene.goal_regions[0].lower[2]": {"scene": Scene(goal_regions=(OTHER_REGION,))},
    "arm": {"arm": "paper_flange"},
}


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

    def test_the_same_problem_of_another_name(self):
        other = RIGHT.replace(name="other", arm=ArmSpecification(home=(0,) * 6)).pinned
        assert RIGHT.first_difference(other) is None
        RIGHT.check_same(other, "it")


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

    def test_task_and_scene_of_a_file(self, write):
        path = write("[task]\nhorizon = 7\n[scene]\nground = false")
        assert RIGHT.replace(task=path).task.horizon == 7
        assert not RIGHT.replace(scene=str(path)).scene.ground

    def test_fields_of_task_and_stepping_by_their_names(self):
        changed = RIGHT.replace(
            goal_regions=("left", "right"),
            goal_weights=(1, 2),
            tolerance=0.1,
            horizon=5,
            start_spread=0.3,
            time_step=0.1,
            tested_configurations=7,
        )
        assert changed.task == ReachTask(
            goal_regions=("left", "right"),
            goal_weights=(1, 2),
            tolerance=0.1,
            horizon=5,
            start_spread=0.3,
        )
        assert changed.stepping == Stepping(time_step=0.1, tested_configurations=7)

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

    def test_the_original_stays(self):
        RIGHT.replace(tolerance=0.3, reward={"success": 3})
        assert RIGHT.task == ReachTask(goal_regions=("right",))

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
            ({"task": "up"}, UnknownNameError, "problem 'up'"),
            ({"scene": "up"}, UnknownNameError, "problem 'up'"),
            ({"scene": Scene(goal_regions=())}, UnknownNameError, "goal_regions: 'right'"),
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
