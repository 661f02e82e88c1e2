"""Problems, scenes and tasks: by name, and from files."""

import shutil

import pytest

from kinarm.arm import ArmSpecification
from kinarm.errors import InvalidInputError, OutputError, ProblemError, UnknownNameError
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import (
    find_scene,
    find_task,
    problem_names,
    scene_names,
    shipped_files,
)
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


class TestLoad:
    def test_by_name_object_and_file(self, write):
        assert ReachProblem.load("left") is PROBLEMS["left"]
        assert ReachProblem.load(RIGHT) is RIGHT
        path = write(RIGHT.replace(name="mine").to_toml())
        for source in (path, str(path)):
            assert ReachProblem.load(source) == RIGHT.replace(name="mine")

    def test_unknown_name(self):
        with pytest.raises(
            UnknownNameError,
            match="problem 'up'; available: left, right, both, .*shelf-panda.*, path/to/problem",
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
            ("[task]\nhorizon = 0", "task: horizon must be a whole number of at least 1, got 0"),
            ("[task]\ntolerance = -1", "task: tolerance must be greater than 0 m, got -1"),
            ("[task.reward]\ncollision = 1", "task.reward: .*collision = 1 rewards contact"),
            ('[task]\ngoal_regions = ["up"]', "goal region in task.goal_regions: 'up'"),
            ('[task]\ngoal_regions = ["left", "left"]', "goal_regions names one twice: left, left"),
            ("[stepping]\ntime_step = 0", "stepping: time_step must be finite and above 0 s"),
            ("task = 3", "task must be a table, got 3"),
            ('[arm]\nhome = "zero"', r"arm.home must be a list, each entry a number \[rad or m\]"),
            ('base = "up"', "base must be one of left, right, both, got 'up'"),
            ("[task", r"not a problem file: .* \(at end of document\)"),
            (
                "[task]\nhorizon = 3\nhorizon = 4",
                "not a problem file: Cannot overwrite a value",
            ),
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


class TestShippedProblems:
    @pytest.mark.parametrize("name", shipped_files("problems"))
    def test_each_has_a_name_an_arm_and_a_scene_that_ships(self, name):
        problem = ReachProblem.load(name)
        assert problem.name == name
        assert name == f"{name.rpartition('-')[0]}-{problem.arm.name}"
        scene = find_scene(name.rpartition("-")[0])
        for parts in ("obstacles", "goal_regions"):  # their sizes may suit the arm
            names = [part.name for part in getattr(scene, parts)]
            assert [part.name for part in getattr(problem.scene, parts)] == names

    def test_the_benches_are_the_papers(self):
        assert find_scene("benches") == Scene()

    def test_names(self):
        assert problem_names()[:3] == ("left", "right", "both")
        assert {"shelf-panda", "benches-ur5", "desk-so101", "post-paper"} < set(problem_names())
        assert {"benches", "table", "shelf", "ring", "post", "desk"} <= set(scene_names())


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
        assert find_scene("both") == Scene()
        assert find_scene("shelf-panda") == ReachProblem.load("shelf-panda").scene
        assert find_task("left") == PROBLEMS["left"].task
        path = write('base = "left"\n[task]\nhorizon = 7')
        assert find_task(path) == PROBLEMS["left"].replace(horizon=7).task

    def test_a_task_file(self, write):
        path = write("tolerance = 0.1\nstarts = [[0, 0, 0, 0, 0, 0]]")
        assert find_task(path) == ReachTask(tolerance=0.1, starts=((0,) * 6,))

    def test_parts_of_a_problem_file_are_names_or_files_beside_it(self, write, monkeypatch):
        write(self.BOX, "scene.toml")
        write("horizon = 9", "task.toml")
        path = write('arm = "paper_flange"\nscene = "scene.toml"\ntask = "task.toml"')
        monkeypatch.chdir("/")
        problem = ReachProblem.load(path)
        assert problem.arm == ArmSpecification(source="paper_flange")
        assert problem.task == ReachTask(goal_regions=("top",), horizon=9)
        assert problem.scene.obstacles[0].name == "box"

    def test_unknown_names_list_what_there_is(self):
        with pytest.raises(UnknownNameError, match="scene 'up'; .*both.*shelf, table, path"):
            find_scene("up")
        with pytest.raises(UnknownNameError, match="task 'up'; .*both, .*path/to/task"):
            find_task("up")

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("ground = true", "'goal_regions' is missing"),
            ("[[goal_regions]]\nname = 3", "missing|must be a text"),
            ("ground = ", r"not a scene file: .*\(at end of document"),
            (BOX + "[mount]\nrpy = [0, 0]", "mount.rpy must be a list of 3"),
            (BOX.replace("yaw = 0.5", "yaw = inf"), "yaw"),
        ],
    )
    def test_unusable_scenes_name_file_and_key(self, write, text, message):
        path = write(text)
        with pytest.raises(InvalidInputError, match=message) as caught:
            find_scene(path)
        assert str(caught.value).startswith(f"{path}: ")


class TestGoalsInObstacles:
    """A region all of which lies inside an obstacle is refused; yaw counts."""

    WALL = Obstacle(name="wall", lower=(0.3, -0.5, 0), upper=(0.4, 0.5, 1))

    def problem(self, lower, upper, yaw=0.0):
        wall = Obstacle(name="wall", lower=self.WALL.lower, upper=self.WALL.upper, yaw=yaw)
        region = GoalRegion(name="goal", lower=lower, upper=upper)
        scene = Scene(obstacles=(wall,), goal_regions=(region,))
        return ReachProblem(name="made", scene=scene, task=ReachTask())

    @pytest.mark.parametrize(
        ("lower", "upper", "yaw"),
        [
            ((0.32, -0.2, 0.5), (0.38, 0.2, 0.6), 0.0),
            ((0.3, -0.5, 0.5), (0.4, 0.5, 0.5), 0.0),
            ((0.15, -0.04, 0.5), (0.55, 0.04, 0.6), 1.5707963267948966),
        ],
    )
    def test_inside(self, lower, upper, yaw):
        with pytest.raises(ProblemError, match="goal region 'goal' lies inside obstacle 'wall'"):
            self.problem(lower, upper, yaw)

    @pytest.mark.parametrize(
        ("lower", "upper", "yaw"),
        [
            ((0.32, -0.2, 0.5), (0.42, 0.2, 0.6), 0.0),
            ((0.3, -0.5, 1.0), (0.4, 0.5, 1.0), 0.0),
            ((0.32, -0.2, 0.5), (0.38, 0.2, 0.6), 1.5707963267948966),
        ],
    )
    def test_partly_or_on_it_or_beside_it_when_it_is_turned(self, lower, upper, yaw):
        assert self.problem(lower, upper, yaw).task.goal_regions == ("goal",)
