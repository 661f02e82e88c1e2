"""Problems, scenes and tasks: by name, and from files."""

import shutil
from contextlib import nullcontext

import pytest

from kinarm._files import shipped_files
from kinarm.arm import ArmSpecification
from kinarm.errors import InvalidInputError, OutputError, ProblemError, UnknownNameError
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import find_scene
from kinarm.scene import GoalRegion, Obstacle, Scene
from kinarm.task import ReachTask, RewardWeights
from kinarm.world import World

RIGHT = PROBLEMS["right"]


@pytest.fixture
def write(tmp_path):
    """Write a problem file and return its path."""

    def write_file(text, name="mine.toml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write_file


def test_problems_are_loaded_by_name_object_and_file(write, monkeypatch, tmp_path):
    assert ReachProblem.load("left") is PROBLEMS["left"]
    assert ReachProblem.load(RIGHT) is RIGHT
    path = write(RIGHT.replace(name="mine").to_toml(), "plain")
    monkeypatch.chdir(tmp_path)
    for source in (path, str(path), "plain"):
        assert ReachProblem.load(source) == RIGHT.replace(name="mine")


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
        shutil.copy(shipped_arms["paper"].description.path, tmp_path / "robot.urdf")
        path = write('[arm]\nsource = "robot.urdf"\npackage_dirs = ["meshes"]')
        monkeypatch.chdir("/")
        problem = ReachProblem.load(path)
        assert problem.arm.source == str((tmp_path / "robot.urdf").resolve())
        assert problem.arm.package_dirs == (str((tmp_path / "meshes").resolve()),)
        assert problem.arm.name == "robot"
        assert World(problem).arm.digest == shipped_arms["paper"].digest

    def test_saved_and_loaded(self, tmp_path):
        problem = PROBLEMS["both"].replace(arm="lrmate200ic_5l", name="long").pinned
        problem.save(tmp_path / "long.toml")
        assert ReachProblem.load(tmp_path / "long.toml") == problem
        with pytest.raises(OutputError, match="cannot write"):
            problem.save(tmp_path / "gone" / "long.toml")

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("[task]\nhorizons = 3", "unknown key 'task.horizons' .did you mean 'horizon'"),
            ('[task]\ntolerance = "5 cm"', r"task.tolerance must be a number \[m\], got '5 cm'"),
            ("[task.reward]\ncollision = 1", "task.reward: .*collision = 1 rewards contact"),
            (
                '[[scene.obstacles]]\nname = "post"\nlower = [0, 0, 0]',
                r"'scene.obstacles\[0\].upper' is missing: Opposite corners",
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


class TestShippedProblems:
    @pytest.mark.parametrize("name", shipped_files("problems"))
    def test_each_has_a_name_an_arm_and_a_scene_that_ships(self, name):
        problem = ReachProblem.load(name)
        assert problem.name == name
        assert name == f"{name.rpartition('-')[0]}-{problem.arm.name}"
        if name.partition("-")[0] in ("crossing", "hard", "obstacles", "pose"):
            return  # these are named by what is asked
        scene = find_scene(name.rpartition("-")[0])
        for parts in ("obstacles", "goal_regions"):  # their sizes may suit the arm
            names = [part.name for part in getattr(scene, parts)]
            assert [part.name for part in getattr(problem.scene, parts)] == names


class TestScenesAndTasks:
    BOX = (
        '[[obstacles]]\nname = "box"\nlower = [0.4, 0, 0]\nupper = [0.5, 0.1, 0.2]\nyaw = 0.5\n'
        '[[goal_regions]]\nname = "top"\nlower = [0.4, 0, 0.25]\nupper = [0.5, 0.1, 0.3]\n'
    )

    def test_a_scene_file_has_only_what_it_says(self, write):
        scene = find_scene(write(self.BOX + "[mount]\nposition = [0, 0, 0.5]"))
        assert [box.name for box in scene.obstacles] == ["box"]
        assert scene.obstacles[0].yaw == 0.5
        assert scene.mount.position == (0, 0, 0.5)
        assert find_scene(write(self.BOX[self.BOX.index("[[goal") :])).obstacles == ()

    def test_of_a_problem_by_name_or_file(self, write):
        assert find_scene("both") == find_scene("benches") == Scene()
        assert find_scene("shelf-panda") == ReachProblem.load("shelf-panda").scene
        path = write('base = "left"\n[task]\nhorizon = 7')
        assert PROBLEMS["both"].replace(task=path).task == PROBLEMS["left"].replace(horizon=7).task

    def test_parts_of_a_problem_file_are_names_or_files_beside_it(self, write, monkeypatch):
        write(self.BOX, "scene.toml")
        write('scene = "scene.toml"\n[task]\nhorizon = 9', "other.toml")
        path = write('arm = "paper_flange"\nscene = "scene.toml"\ntask = "other.toml"')
        monkeypatch.chdir("/")
        problem = ReachProblem.load(path)
        assert problem.arm == ArmSpecification(source="paper_flange")
        assert problem.task == ReachTask(goal_regions=("top",), horizon=9)
        assert problem.scene.obstacles[0].name == "box"

    @pytest.mark.parametrize(
        ("find", "message"),
        [
            (ReachProblem.load, "problem 'up'; available: left, right, both, .*shelf-panda"),
            (find_scene, "scene 'up'; .*both.*shelf, table, path"),
            (lambda name: PROBLEMS["both"].replace(task=name), "problem 'up'; available: left, "),
        ],
    )
    def test_unknown_names_list_what_there_is(self, find, message):
        with pytest.raises(UnknownNameError, match=message):
            find("up")

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("ground = true", "'goal_regions' is missing"),
            (BOX.replace("yaw = 0.5", "yaw = inf"), "yaw"),
            ('name = "mine"\n' + BOX, "unknown key 'name'"),
        ],
    )
    def test_unusable_scenes_name_file_and_key(self, write, text, message):
        path = write(text)
        with pytest.raises(InvalidInputError, match=message) as caught:
            find_scene(path)
        assert str(caught.value).startswith(f"{path}: ")


QUARTER = 1.5707963267948966


@pytest.mark.parametrize(
    ("lower", "upper", "yaw", "inside"),
    [
        ((0.32, -0.2, 0.5), (0.38, 0.2, 0.6), 0.0, True),
        ((0.15, -0.04, 0.5), (0.55, 0.04, 0.6), QUARTER, True),
        ((0.32, -0.2, 0.5), (0.42, 0.2, 0.6), 0.0, False),
        ((0.32, -0.2, 0.5), (0.38, 0.2, 0.6), QUARTER, False),
    ],
)
def test_goals_that_all_lie_inside_an_obstacle_are_refused(lower, upper, yaw, inside):
    wall = Obstacle(name="wall", lower=(0.3, -0.5, 0), upper=(0.4, 0.5, 1), yaw=yaw)
    region = GoalRegion(name="goal", lower=lower, upper=upper)
    scene = Scene(obstacles=(wall,), goal_regions=(region,))
    told = pytest.raises(ProblemError, match="goal region 'goal' lies inside obstacle 'wall'")
    with told if inside else nullcontext():
        ReachProblem(name="made", scene=scene, task=ReachTask())
