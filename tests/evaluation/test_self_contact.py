"""Self-contact with hulls and with meshes: the warning, and that to follow it helps."""

import re

import numpy as np
import pytest

from kinarm import Arm
from kinarm.contact_statistics import contact_on_bare_ground
from kinarm.evaluation.arm_facts import MUCH, SelfContact

HOOK = np.array([(0, 0, 0.05), (0.06, 0.06, 0.4)]), np.array([(0, 0, 0.34), (0.4, 0.06, 0.4)])
"""Two bars that make a hook."""


def write_bars(path, bars):
    """A mesh of boxes, each by its lower and upper corner."""
    lines, first = [], 1
    faces = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    for low, high in bars:
        ends = list(zip(low, high, strict=True))
        lines += [f"v {x} {y} {z}" for x in ends[0] for y in ends[1] for z in ends[2]]
        for face in faces:
            a, b, c, d = (first + int(word) - 1 for word in face.split())
            lines += [f"f {a} {b} {c}", f"f {a} {c} {d}"]
        first += 8
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def hooked(write_robot, make_joint, make_collision):
    """An arm that carries a hook, whose hollow the hand swings through."""
    joints = [
        make_joint(axis="0 1 0"),
        make_joint(axis="0 1 0", xyz="0 0 0.4"),
        make_joint(axis="0 1 0", xyz="0.4 0 0"),
    ]
    shapes = {
        1: make_collision('<mesh filename="hook.obj"/>'),
        3: make_collision('<sphere radius="0.02"/>', xyz="0 0 -0.2"),
    }
    path = write_robot(joints, shapes, tool="0 0 -0.2")
    write_bars(path.with_name("hook.obj"), HOOK)
    return path


def inside(points, low, high):
    nearest = np.clip(points, low, high)
    return np.linalg.norm(points - nearest, axis=1) <= 0.02


def test_meshes_are_taken_as_they_are(hooked):
    """The ball against the two bars, by hand."""
    contact = contact_on_bare_ground(Arm.load(hooked))
    found = SelfContact(contact)
    q = found._configurations
    bend, total = q[:, 1], q[:, 1] + q[:, 2]
    ball = np.stack(
        [
            0.4 * np.cos(bend) - 0.2 * np.sin(total),
            0 * bend,
            0.4 - 0.4 * np.sin(bend) - 0.2 * np.cos(total),
        ],
        axis=1,
    )
    touching = np.any([inside(ball, low, high) for low, high in HOOK], axis=0)
    # A ball within a bar does not touch its surface; none fits.
    np.testing.assert_array_equal(found.meshes, touching)
    assert not (found.meshes & ~found.simulated).any()


def test_what_the_warning_proposes_ends_it(hooked):
    warning = SelfContact(contact_on_bare_ground(Arm.load(hooked))).warning()
    shares = re.findall(r"([\d.]+)%", warning)
    assert float(shares[0]) - float(shares[1]) > 100 * MUCH
    link, count = re.search(r"pieces = \{ (\w+) = (\d+) \}", warning).groups()
    assert link == "link_1"
    mended = contact_on_bare_ground(Arm.load(hooked, pieces={link: int(count)}))
    assert SelfContact(mended).warning() is None
    assert not SelfContact(mended).meshes.all()


def test_primitives_need_no_pieces(shipped_arms):
    contact = contact_on_bare_ground(shipped_arms["paper"])
    found = SelfContact(contact, 200)
    np.testing.assert_array_equal(found.simulated, found.meshes)
    assert found.warning() is None
