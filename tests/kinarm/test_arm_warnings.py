"""What makes the description of an arm doubtful."""

from kinarm.arm import Arm
from kinarm.contact_statistics import arm_warnings, contact_on_bare_ground


def warnings_of(path):
    return arm_warnings(contact_on_bare_ground(Arm.load(path)))


class TestWarnings:
    BALL = '<sphere radius="0.05"/>'

    def test_an_arm_without_shapes_never_touches(self, make_joint, make_collision, write_robot):
        base = {0: make_collision(self.BALL)}
        path = write_robot([make_joint(), make_joint(axis="0 1 0")], base)
        (line,) = warnings_of(path)
        assert "no moving link has a collision shape" in line

    def test_pairs_that_touch_at_home_are_named(self, make_joint, make_collision, write_robot):
        near = [make_joint(xyz="0.01 0 0.02", axis="0 1 0") for _ in range(4)]
        shapes = {link: make_collision(self.BALL, xyz="0.3 0 0") for link in range(5)}
        (line,) = warnings_of(write_robot(near, shapes))
        # All six pairs but those of neighbours, each once.
        assert line.startswith("never tested for contact, since they touch at home: link_0 and")
        assert line.count(" and link_") == 3
        assert ", and 3 more;" in line
        one = {0: shapes[0], 2: shapes[2]}
        (line,) = warnings_of(write_robot(near, one))
        assert "home: link_0 and link_2; an arm file" in line

    def test_absurd_velocity_limits_are_named(self, make_joint, make_collision, write_robot):
        limit = '<limit lower="-1" upper="1" velocity="{}" effort="0"/>'
        joints = [make_joint(limit=limit.format(speed), axis="0 1 0") for speed in (30, 62.8)]
        path = write_robot(joints, {2: make_collision(self.BALL)})
        assert warnings_of(path) == ["velocity limits that no arm reaches: joint_2 63 rad/s"]

    def test_a_sound_arm_has_none(self, make_joint, make_collision, write_robot):
        shapes = {link: make_collision(self.BALL) for link in range(3)}
        joints = [make_joint(xyz="0.2 0 0", axis="0 1 0") for _ in range(2)]
        assert warnings_of(write_robot(joints, shapes)) == []
