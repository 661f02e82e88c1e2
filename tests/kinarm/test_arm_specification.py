"""What says which arm: specifications and arm files."""

import dataclasses

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.arm_specification import AllowedContact, ArmFile, ArmSpecification, arm_names
from kinarm.collision import ContactModel
from kinarm.errors import ArmError, InvalidInputError, UnknownNameError
from kinarm.problem import ReachProblem
from kinarm.problem_options import ProblemOptions
from kinarm.scene import Scene

AXIS_NAMES = tuple(f"axis_{number}" for number in range(1, 7))


def test_is_kept_by_the_arm():
    given = ArmSpecification(source="paper_flange", home=(0.1, 0, 0, 0, 0, 0))
    arm = Arm.load(given, actuated=AXIS_NAMES[:3])
    assert arm.specification == ArmSpecification(
        source="paper_flange", home=(0.1, 0, 0, 0, 0, 0), actuated=AXIS_NAMES[:3]
    )
    assert Arm.load(arm.specification).digest == arm.digest
    assert arm.name == "paper_flange"


def test_pinned_digest_has_to_hold(shipped_arms):
    digest = shipped_arms["paper"].digest
    assert Arm.load("paper", digest=digest).digest == digest
    with pytest.raises(ArmError, match=f"'paper_flange' is another version .*{digest}"):
        Arm.load("paper_flange", digest=digest)


class TestArmFiles:
    """Files that say of an arm what its URDF does not."""

    def write(self, folder, text):
        path = folder / "mine.toml"
        path.write_text(text)
        return path

    def test_every_known_arm_has_one(self):
        names = arm_names()
        assert {"paper", "ur3", "ur5", "ur10", "panda", "xarm7", "z1", "kinova"} < set(names)
        assert {"so100", "so101"} < set(names)
        for name in names:
            file = ArmFile.of(name)
            assert all((file.title, file.licence, file.origin, file.velocities)), name
            for contact in file.arm.allowed_contacts or ():
                assert contact.reason

    def test_an_arm_file_says_what_is_used_and_options_win(self, tmp_path):
        path = self.write(
            tmp_path,
            '[arm]\nsource = "paper"\nvelocity_limits = [1, 1, 1, 1, 1, 1]\n'
            "[arm.limits]\naxis_1 = [-1, 1]\n[arm.held]\naxis_6 = 0.5",
        )
        arm = Arm.load(path, limits={"axis_2": (-0.5, 0.5)}, velocity_limits=[2] * 5)
        np.testing.assert_array_equal(arm.velocity_limits, 2)
        np.testing.assert_array_equal(arm.lower[:2], [-1, -0.5])
        assert arm.n_joints == 5
        assert arm.name == "mine"

    def test_an_offset_is_one_in_the_files_own_tool_frame(self, tmp_path):
        path = self.write(
            tmp_path,
            '[arm]\nsource = "paper"\ntool_frame = "hand"\ntool_offset = [0.0, 0.0, 0.1]',
        )
        wrist, own = Arm.load("paper", tool_frame="wrist"), Arm.load(path, tool_frame="wrist")
        assert own.digest == wrist.digest
        problem = ReachProblem.load("right").replace(arm=str(path))
        chosen = ProblemOptions(tool_frame="wrist").resolve(problem).load_arm()
        assert chosen.digest == wrist.digest
        pointing = ArmSpecification(source="paper", tool_offset=(0.0, 0.0, 0.1))
        chosen = ProblemOptions(tool_frame="wrist").resolve(problem.replace(arm=pointing))
        assert chosen.arm_digest == wrist.digest

    def test_source_and_folders_start_at_the_file(self, tmp_path, shipped_arms, monkeypatch):
        urdf = shipped_arms["paper"].description.path.read_text()
        (tmp_path / "own.urdf").write_text(urdf)
        path = self.write(tmp_path, '[arm]\nsource = "own.urdf"\npackage_dirs = ["meshes"]')
        monkeypatch.chdir("/")
        assert Arm.load(path).digest == shipped_arms["paper"].digest
        assert ArmFile.of(str(path)).arm.package_dirs == (str(tmp_path / "meshes"),)

    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("[arm", r"at end of document"),
            ("title = 3", "title|arm"),
            ("[arm]\nsource = 'other.toml'", "'arm.source' must be a URDF or a known arm"),
            ("[arm]\nsources = 'paper'", "unknown key 'arm.sources'"),
            ("[arm]\nsource = 'paper'\ndigest = '12'", "'arm.digest' is for problem files"),
        ],
    )
    def test_unusable_files_are_refused(self, tmp_path, text, message):
        with pytest.raises((ArmError, InvalidInputError), match=message) as caught:
            Arm.load(self.write(tmp_path, text))
        assert "mine.toml" in str(caught.value)
        assert "\n" not in str(caught.value)


class TestAllowedContacts:
    def test_their_pairs_are_not_tested_and_count_for_the_digest(self, shipped_arms):
        (one, other), *_ = (
            pair
            for pair in ContactModel.build(shipped_arms["paper"], Scene()).pair_names
            if "ground" not in pair and "bench" not in pair[1]
        )
        contact = AllowedContact(links=(one, other), reason="they are soft")
        arm = Arm.load("paper", allowed_contacts=(contact,))
        assert (one, other) not in ContactModel.build(arm, Scene()).pair_names
        assert arm.digest != shipped_arms["paper"].digest
        other_reason = dataclasses.replace(contact, reason="they are small")
        assert Arm.load("paper", allowed_contacts=(other_reason,)).digest == arm.digest

    def test_unknown_links_are_refused(self):
        contact = AllowedContact(links=("gripper", "base"), reason="none")
        with pytest.raises(UnknownNameError, match="link in allowed_contacts of paper.urdf: 'gr"):
            Arm.load("paper", allowed_contacts=(contact,))
