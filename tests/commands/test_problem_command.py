"""``kinarm-problem``: list, show and check."""

import pytest
from refusals import check_refused

from kinarm.evaluation.problem_check import check_problem
from kinarm.problem import PROBLEMS, ReachProblem
from kinarm.problem_files import problem_names
from kinarm.world import World

FAR = """
[[goal_regions]]
name = "near"
lower = [0.3, -0.3, 0.4]
upper = [0.5, 0.3, 0.6]
[[goal_regions]]
name = "far"
lower = [3.0, -0.3, 0.4]
upper = [3.2, 0.3, 0.6]
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write_file(text, name="mine.toml"):
        (tmp_path / name).write_text(text)
        return name

    return write_file


@pytest.mark.parametrize("words", [(), ("list",)])
def test_list_names_every_problem(run, words, monkeypatch):
    monkeypatch.setenv("COLUMNS", "250")
    answer = run("kinarm-problem", *words)
    assert (answer.status, answer.err) == (0, "")
    head, *lines = answer.out.splitlines()
    assert head.split()[:4] == ["problem", "arm", "obstacles", "goals"]
    assert [line.split()[0] for line in lines] == list(problem_names())


def test_show_prints_what_can_be_read_again(run, write):
    answer = run("kinarm-problem", "show", "both", "--arm", "paper_flange", "--scene", "post")
    assert (answer.status, answer.err) == (0, "")
    shown = ReachProblem.load(write(answer.out))
    expected = PROBLEMS["both"].replace(arm="paper_flange", scene="post")
    assert shown == expected


def test_check_of_the_papers_third_task(run):
    answer = run("kinarm-problem", "check", "both", "--trials", 20)
    assert (answer.status, answer.err) == (0, "")
    assert "reached 100.0 % (86.1..100.0), out of reach 0.0 %" in answer.out
    assert "mirror   yes: arm and obstacles are their own image" in answer.out
    assert "at home nothing touches" in answer.out


def test_check_says_what_is_out_of_reach(run, write):
    path = write(f'arm = "paper"\nscene = "{write(FAR, "scene.toml")}"\n')
    answer = run("kinarm-problem", "check", path, "--trials", 30)
    assert (answer.status, answer.err) == (0, "")
    check = check_problem(World(path), trials=30)
    assert str(check) in answer.out
    assert check.undecided.value == 0
    assert check.reached.value + check.out_of_reach.value == pytest.approx(1)
    assert 0.2 < check.out_of_reach.value < 0.8


def test_a_bad_file_is_refused_by_whatever_reads_it(run, write, tmp_path):
    path = write("[[scene.obstacles]\n")
    check_refused(run("kinarm-problem", "check", path), "line 1, column 18")
    training = run("kinarm-train", "ars", "--out", "x.npz", "--problem", path)
    check_refused(training, "line 1, column 18")
    assert [file.name for file in tmp_path.iterdir()] == ["mine.toml"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "nothing"], ["'nothing'", "shelf-panda"]),
        (["show", "--tool-frame", "hook"], ["'hook'"]),
        (["import", "pairs"], ["--arm", "--out"]),
        (["import", "pairs", "--arm", "paper", "--out", "made"], ["pairs", "no folder"]),
    ],
)
def test_bad_usage(run, write, tmp_path, arguments, words):
    check_refused(run("kinarm-problem", *arguments), *words)
    assert list(tmp_path.iterdir()) == []


class TestImport:
    BOX = (
        "  - id: box\n    primitives: [{type: box, dimensions: [0.1, 0.1, 0.1]}]\n"
        "    primitive_poses: [{position: [%s, 0, 0.5], orientation: [0, 0, 0, 1]}]\n"
    )

    @pytest.fixture
    def pairs(self, write, tmp_path):
        """A folder with two pairs; in the second one the arm touches the box."""
        pytest.importorskip("yaml")
        arm = PROBLEMS["right"].load_arm()
        joints = "".join(
            f"  - {{joint_name: {name}, position: {at}}}\n"
            for name, at in zip(arm.joint_names, (arm.home + 0.3).tolist(), strict=True)
        )
        (tmp_path / "pairs").mkdir()
        names = ", ".join(arm.joint_names)
        start = f"{{name: [{names}], position: {arm.home.tolist()}}}"
        for number, place in ((1, 2.0), (2, 0.1)):
            write(f"world:\n  collision_objects:\n{self.BOX % place}", f"pairs/scene{number}.yaml")
            write(
                f"start_state:\n  joint_state: {start}\n"
                f"goal_constraints:\n- joint_constraints:\n{joints}",
                f"pairs/request{number}.yaml",
            )
        return tmp_path / "pairs"

    def test_folder(self, run, pairs):
        answer = run("kinarm-problem", "import", "pairs", "--arm", "paper", "--out", "made")
        assert (answer.status, answer.err) == (0, "")
        first, second, summary = answer.out.splitlines()
        assert first == "made/scene1.toml: start free, goal free"
        assert "made/scene2.toml: start " in second
        assert second.endswith(" touches box")
        assert summary == "start and goal are free in 1 of 2 problems"
        problem = ReachProblem.load("made/scene1.toml")
        assert [body.name for body in problem.scene.obstacles] == ["box"]
        assert run("kinarm-problem", "check", "made/scene1.toml", "--trials", 1).status == 0
        again = run("kinarm-problem", "import", "pairs", "--arm", "paper", "--out", "made")
        check_refused(again, "made/scene1.toml", "exists", "--overwrite")
        touching = run("kinarm-problem", "check", "made/scene2.toml")
        check_refused(touching, "task.starts[0] is in contact", "touches box")

    def test_one_pair_with_a_mount(self, run, pairs):
        files = "pairs/scene1.yaml", "pairs/request2.yaml"
        where = "--position", 1, 0, 0.5, "--rpy", 0, 0, 1.5
        answer = run("kinarm-problem", "import", *files, "--arm", "paper", "--out", ".", *where)
        assert answer.status == 0
        mount = ReachProblem.load("scene1.toml").scene.mount
        assert (mount.position, mount.rpy) == ((1.0, 0.0, 0.5), (0.0, 0.0, 1.5))

    def test_nothing_is_written_if_one_file_is_bad(self, run, pairs, tmp_path):
        (pairs / "request2.yaml").unlink()
        answer = run("kinarm-problem", "import", "pairs", "--arm", "paper", "--out", "made")
        check_refused(answer, "request2.yaml", "No such file")
        assert not list(tmp_path.glob("**/*.toml"))
