"""Bad input: one line on standard error, exit status 2, nothing else printed, nothing lost."""

import os

import pytest
from refusals import check_refused

from kinarm import arm_names

ARMS = ", ".join(arm_names())

LIMITS = '<limit lower="-1" upper="1" velocity="1" effort="0"/>'


def robot(joint: str, tool: str = "tool0") -> str:
    """A robot with one interesting joint and a tool."""
    return (
        '<robot name="made" version="1.2"><link name="base"/><link name="a"/>'
        f'<link name="{tool}"/>{joint}<joint name="mount" type="fixed"><parent link="a"/>'
        f'<child link="{tool}"/><origin xyz="0.1 0 0"/></joint></robot>'
    )


def joint(kind: str, limits: str = LIMITS) -> str:
    return (
        f'<joint name="turn" type="{kind}"><parent link="base"/><child link="a"/>'
        f'<origin xyz="0 0 0.5"/><axis xyz="0 0 1"/>{limits}</joint>'
    )


BACK = '<joint name="back" type="fixed"><parent link="a"/><child link="base"/></joint>'

UNUSABLE_ROBOTS = {
    "malformed": ("<robot", "urdf"),
    "empty": ("", "urdf"),
    "no xml": ("hello", "urdf"),
    "floating base": (robot(joint("floating", "")), "fixed"),
    "no speed": (robot(joint("continuous", "")), "velocity"),
    "loop": (robot(joint("revolute")).replace("</robot>", f"{BACK}</robot>"), "loop"),
    "no limits": (robot(joint("revolute", "")), "urdf"),
    "no velocity limit": (robot(joint("revolute", LIMITS.replace('velocity="1"', ""))), "urdf"),
    "no joint": (robot(joint("fixed", "")), "urdf"),
}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--task", "upwards"], ["'upwards'", "left, right, both"]),
        (["--arm", "nobody"], ["'nobody'", ARMS, "path/to/robot.urdf, path/to/arm.toml"]),
        (["--arm", "missing.urdf"], ["missing.urdf"]),
        (["--arm", ""], []),
        (["--policy", "nobody"], ["'nobody'", "random, zero"]),
        (["--policy", "nobody.npz"], ["nobody.npz", "No such file"]),
        (["--policy", ""], []),
        (["--trials", "0"], ["trials", "at least 1, got 0"]),
        (["--trials", "-3"], ["trials", "-3"]),
        (["--trials", "many"], ["--trials", "'many'"]),
        (["--trials", "2.5"], ["--trials"]),
        (["--seed", "-1"], ["seed", "at least 0, got -1"]),
        (["--upwards"], ["--upwards"]),
        (["stray"], ["stray"]),
        (["--json", "--markdown"], ["exclude each other"]),
    ],
)
def test_eval_refuses(run, arguments, words):
    check_refused(run("kinarm-eval", "--policy", "zero", "--trials", "2", *arguments), *words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--task", "upwards"], ["'upwards'", "left, right, both"]),
        (["--problem", "gone.toml"], ["gone.toml", "No such file"]),
        (["--recipe", "nothing"], ["'nothing'", "paper, tuned"]),
        (["--arm", "nobody"], ["'nobody'", ARMS]),
        (["--arm", "missing.urdf"], ["missing.urdf"]),
        (["--seed", "-1"], ["seed", "at least 0, got -1"]),
        (["--iterations", "0"], ["iterations", "at least 1, got 0"]),
        (["--directions", "many"], ["--directions", "'many'"]),
        (["--top-directions", "25"], ["top_directions", "24"]),
        (["--noise", "0"], ["noise", "greater than 0"]),
        (["--noise", "nan"], ["--noise", "finite"]),
        (["--step-size", "-1"], ["step_size"]),
        (["--reward-success", "inf"], ["--reward-success"]),
        (["--reward-collision", "2"], ["collision", "other sign"]),
        (["--reward-success", "-1"], ["success", "other sign"]),
        (["--tolerance", "0"], ["tolerance", "greater than 0"]),
        (["--tensorboard", "logs"], ["--tensorboard"]),
        (["--start-spread", "1.5"], ["start_spread", "1.5"]),
        (["--sharing", "all"], ["--sharing", "'all'"]),
        (["--resume"], ["nothing to resume"]),
        (["--upwards"], ["--upwards"]),
    ],
)
def test_train_refuses(run, tmp_path, arguments, words):
    answer = run("kinarm-train", "ars", "--out", tmp_path / "p.npz", *arguments)
    check_refused(answer, *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--task", "upwards"], ["'upwards'", "left, right, both"]),
        (["--recipe", "nothing"], ["'nothing'", "paper, tuned"]),
        (["--arm", "missing.urdf"], ["missing.urdf"]),
        (["--iterations", "0"], ["iterations", "at least 1, got 0"]),
        (["--batch-size", "300"], ["batch_size", "2000 steps"]),
        (["--net-arch", "0"], ["net_arch"]),
        (["--net-arch", "wide"], ["--net-arch", "'wide'"]),
        (["--learning-rate", "0"], ["learning_rate", "greater than 0"]),
        (["--learning-rate", "nan"], ["--learning-rate", "finite"]),
        (["--gamma", "2"], ["gamma", "[0, 1]"]),
        (["--training-tolerance", "-1"], ["training_tolerance"]),
        (["--start-spread", "1.5"], ["start_spread", "1.5"]),
        (["--directions", "3"], ["--directions"]),
        (["--resume"], ["nothing to resume"]),
    ],
)
def test_train_ppo_refuses(run, tmp_path, arguments, words):
    pytest.importorskip("stable_baselines3")
    paths = ("--out", tmp_path / "p.npz", "--tensorboard", tmp_path / "logs")
    answer = run("kinarm-train", "ppo", *paths, *arguments)
    check_refused(answer, *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("kinarm-train ars --out p.npz --recepie tuned", "--recepie tuned; did you mean --recipe?"),
        ("kinarm-train ars --out p.npz --what=5", "--what=5 (see kinarm-train ars --help)"),
        ("kinarm-problem check --trails=5", "did you mean --trials? (see kinarm-problem check "),
        ("kinarm-eval --polcy zero", "did you mean --policy? (see kinarm-eval --help)"),
    ],
)
def test_an_unknown_option_is_refused_with_the_help_that_lists_it(run, words, told):
    program, *arguments = words.split()
    check_refused(run(program, *arguments), "unrecognized arguments: --", told)


@pytest.mark.parametrize("arguments", [[], ["nobody"], ["ars"], ["ppo"]])
def test_train_needs_a_learner_and_a_file(run, arguments):
    check_refused(run("kinarm-train", *arguments))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--policy", "nobody"], ["'nobody'"]),
        (["--policy", "nobody.npz"], ["nobody.npz"]),
        (["--repetitions", "0"], ["repetitions", "at least 1"]),
        (["--upwards"], ["--upwards"]),
    ],
)
def test_bench_refuses(run, arguments, words):
    check_refused(run("kinarm-bench", *arguments), *words)


@pytest.mark.parametrize("case", UNUSABLE_ROBOTS)
def test_unusable_robots_are_refused(run, tmp_path, case):
    content, word = UNUSABLE_ROBOTS[case]
    path = tmp_path / "robot.urdf"
    path.write_text(content)
    check_refused(run("kinarm-eval", "--arm", path), word)


def test_a_robot_that_always_touches_the_ground_is_refused(run, tmp_path):
    ball = '<collision><geometry><sphere radius="1"/></geometry></collision>'
    content = (
        '<robot name="made" version="1.2"><link name="base"/><link name="a"/>'
        f'<link name="b">{ball}</link><link name="tool0"/>{joint("revolute")}'
        f'<joint name="tip" type="revolute"><parent link="a"/><child link="b"/>'
        f'<axis xyz="0 1 0"/>{LIMITS}</joint><joint name="mount" type="fixed">'
        '<parent link="b"/><child link="tool0"/><origin xyz="0.1 0 0"/></joint></robot>'
    )
    path = tmp_path / "robot.urdf"
    path.write_text(content)
    answer = run("kinarm-eval", "--policy", "random", "--arm", path)
    check_refused(answer, "no contact-free start", "b touches")


@pytest.mark.parametrize("option", ["--out", "--report"])
def test_an_output_folder_that_cannot_be_made_is_refused(run, tmp_path, option):
    (tmp_path / "file").write_text("mine")
    for out in (tmp_path / "file", tmp_path / "file" / "deep"):
        answer = run("kinarm-eval", "--policy", "zero", "--trials", 1, option, out)
        check_refused(answer, "file")
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    ("option", "name"),
    [
        ("--out", "evaluation.json"),
        ("--out", "final_distance.png"),
        ("--out", "final_distance.svg"),
        ("--report", "index.html"),
    ],
)
def test_results_that_cannot_be_written_are_refused(run, tmp_path, option, name):
    (tmp_path / name).mkdir()
    arguments = ("--policy", "zero", "--task", "left", "--trials", 1, option, tmp_path)
    check_refused(run("kinarm-eval", *arguments), str(tmp_path))


@pytest.mark.parametrize("out", ["p.txt", "p", "file/p.npz"])
def test_a_policy_that_cannot_be_written_is_refused_before_training(run, tmp_path, out):
    (tmp_path / "file").write_text("mine")
    answer = run("kinarm-train", "ars", "--iterations", 1, "--out", tmp_path / out)
    check_refused(answer, out.split("/")[0])
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")  # noqa: PTH110
@pytest.mark.parametrize(("extra", "unbuffered"), [((), "1"), (("--json",), "")])
def test_a_full_disk_is_reported_in_one_line(run_outside, extra, unbuffered, monkeypatch):
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    arguments = ("--policy", "zero", "--task", "left", "--trials", 1, *extra)
    with open("/dev/full", "w") as full:  # noqa: PTH123
        answer = run_outside("kinarm-eval", *arguments, stdout=full)
    assert answer.status in (1, 2)
    assert len(answer.err.splitlines()) == 1, answer.err
