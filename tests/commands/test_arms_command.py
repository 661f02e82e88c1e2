"""``kinarm-arms``: the table of arms, and what is known of one."""

import re

import pytest
from known_arms import INSTALLED
from refusals import check_refused

from kinarm import arm_names
from kinarm.arm_specification import ArmFile


@pytest.fixture(autouse=True)
def wide(monkeypatch):
    monkeypatch.setenv("COLUMNS", "250")


def rows(answer):
    """The lines of a table by their first word."""
    head, *lines = answer.out.splitlines()
    assert head.split()[0] == "arm"
    return {line.split()[0]: line for line in lines}


@INSTALLED
def test_table(run):
    answer = run("kinarm-arms")
    assert (answer.status, answer.err) == (0, "")
    table = rows(answer)
    assert list(table) == list(arm_names())
    for name, line in table.items():
        file = ArmFile.of(name)
        assert all(part in line for part in (file.title, file.licence, file.origin, " yes"))
    assert re.search(
        r"FANUC LR Mate 200iC with a tool of 0.15 m +6 +5 +1.26 +350 to 450", table["paper"]
    )


def test_without_the_extra_rows_say_so_and_what_to_install(run, monkeypatch):
    from importlib import metadata

    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    answer = run("kinarm-arms", "list")
    assert answer.status == 0
    assert answer.err == (
        "not installed: part of example-robot-data; pip install 'kinarm[robots]'\n"
    )
    table = rows(answer)
    assert list(table) == list(arm_names())
    assert table["ur5"].split()[-1] == "no"
    assert "Universal Robots UR5" in table["ur5"]
    assert table["paper"].split()[-1] == "yes"
    check_refused(run("kinarm-arms", "show", "ur5"), "pip install 'kinarm[robots]'")


def test_show(run):
    answer = run("kinarm-arms", "show", "paper")
    assert (answer.status, answer.err) == (0, "")
    for line in (
        "  FANUC LR Mate 200iC with a tool of 0.15 m",
        "  axis_2: -60 to 140 deg, 350 deg/s",
        "  axis_6: -360 to 360 deg, 720 deg/s; not actuated, stays at home",
        "  shoulder: capsule",
        "  base and shoulder: neighbours",
        "  elbow and hand: proven never to touch",
        "pairs that are tested (16), and how often they touch",
    ):
        assert line in answer.out.splitlines(), answer.out
    often = r"^  hand and ground: at \d+\.\d% of 2000 random configurations$"
    assert re.search(often, answer.out, re.M)


def test_show_of_an_own_urdf(run, make_joint, make_collision, write_robot):
    extra = (
        '<link name="jaw"/><joint name="bite" type="prismatic"><parent link="link_1"/>'
        '<child link="jaw"/><limit lower="0" upper="0.1" velocity="1" effort="0"/></joint>'
    )
    shapes = dict.fromkeys((0, 2), make_collision('<sphere radius="0.9"/>'))
    path = write_robot([make_joint("prismatic"), make_joint()], shapes, tool=None, extra=extra)
    answer = run("kinarm-arms", "show", path, "--tool-frame", "link_2")
    assert (answer.status, answer.err) == (0, "")
    assert "  bite at 0" in answer.out
    assert "  joint_1: -2 to 2 m, 3 m/s" in answer.out
    assert "  joints that do not carry the tool are held: bite" in answer.out
    assert "  never tested for contact, since they touch at home: link_0 and link_2" in answer.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["show"], ["ARM"]),
        (["show", "nobody"], ["'nobody'", "panda"]),
        (["show", "missing.urdf"], ["missing.urdf", "does not exist"]),
        (["show", "paper", "--tool-frame", "hook"], ["'hook'", "hand"]),
    ],
)
def test_refusals(run, arguments, words):
    check_refused(run("kinarm-arms", *arguments), *words)
