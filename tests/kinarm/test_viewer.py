"""Pages: what they hold, that they are reproducible, and what they refuse; and meshes."""

import json
import re
import struct
from dataclasses import replace

import numpy as np
import pytest
import umsgpack
from drawings import unpacked, volume

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, OutputError
from kinarm.recording import record_rollouts
from kinarm.scene import GoalRegion, Obstacle, Scene, rotation_matrix
from kinarm.viewer import replay_page
from kinarm.viewer.meshes import Mesh, box, capsule, cylinder, lathe, tube
from kinarm.viewer.parts import obstacle_meshes
from kinarm.viewer.visual_shapes import arm_parts


def waving(simulator, count=3, seed=0):
    """Recordings of random motions."""
    rng = np.random.default_rng(seed)
    starts, goals = simulator.sample(np.random.default_rng(0), count)
    actions = rng.uniform(-1, 1, (count, simulator.task.horizon, simulator.n_actions))
    rollouts = simulator.rollout_actions(actions, starts, goals, record=True)
    return record_rollouts(simulator, rollouts, f"wave-{seed}")


@pytest.fixture(scope="module")
def recordings(simulator):
    return waving(simulator)


def changed(recording, **changes):
    """A recording as if another problem had been faced."""
    return replace(recording, problem=recording.problem.replace(**changes))


def commands(page):
    content, at = unpacked(page, "scene"), 0
    while at < len(content):
        (length,) = struct.unpack_from("<I", content, at)
        yield umsgpack.unpackb(content[at + 4 : at + 4 + length])
        at += 4 + length


def test_the_same_recordings_give_the_same_page_which_needs_nothing_else(recordings):
    html = replay_page(recordings).html
    assert html == replay_page(list(recordings)).html
    assert "default-src 'none'" in html
    assert re.findall(r'(?:src|href)="(?!data:)[^"]*"', html) == []
    assert len(html.encode()) < 1_000_000


def test_states_are_there_to_the_last_bit(recordings, simulator):
    trials = json.loads(unpacked(replay_page(recordings), "page"))
    assert [trial["trial"] for trial in trials["trials"]] == [0, 1, 2]
    for trial, recording in zip(trials["trials"], recordings, strict=True):
        assert np.array(trial["runs"][0]["states"]).tobytes() == recording.states.tobytes()
        assert trial["runs"][0]["distances"] == recording.distances.tolist()
    assert trials["tool"] == simulator.arm.chain.tool.tolist()


def test_obstacles_need_no_goals(recordings):
    """Where goals lie on one, a slab covers it; a post is a box alone."""
    post = Obstacle(name="post", lower=(0.3, 0.2, 0.1), upper=(0.35, 0.25, 0.6))
    scene = Scene(obstacles=(post, *Scene().obstacles[:1]))
    page = replay_page(changed(recordings[0], scene=scene))
    paths = {command["path"] for command in commands(page)}
    obstacles = {path for path in paths if "obstacles" in path}
    assert obstacles == {f"/meshcat/obstacles/{part}" for part in ("0/body", "1/body", "1/top")}
    assert {"/meshcat/floor", "/meshcat/goal/cube", "/meshcat/trials/0/run"} <= paths
    bare = Scene(obstacles=(), ground=False)
    page = replay_page(changed(recordings[0], scene=bare))
    paths = {command["path"] for command in commands(page)}
    assert not any("obstacles" in path or "floor" in path for path in paths)


def test_names_are_escaped(recordings):
    page = replay_page(replace(recordings[0], policy="</script><b>&"))
    assert "<title>&lt;/script&gt;&lt;b&gt;&amp; · kinarm replay</title>" in page.html
    assert "</script><b>" not in page.html


def test_it_is_written_or_that_is_said(recordings, tmp_path):
    page = replay_page(recordings, tmp_path / "made.html")
    assert (tmp_path / "made.html").read_text(encoding="utf-8") == page.html
    assert re.fullmatch(r"HtmlPage\(0\.\d MB of HTML\)", repr(page))
    assert page._repr_html_().startswith('<iframe srcdoc="&lt;!DOCTYPE html&gt;')
    with pytest.raises(OutputError):
        replay_page(recordings, tmp_path)


def test_what_cannot_share_a_page(recordings, simulators):
    foreign = waving(simulators["paper_flange"])
    elsewhere = changed(recordings[1], scene=Scene(ground=False))
    for runs, more, message in (
        ([], {}, "no recording"),
        ([*recordings, *foreign], {}, "different arms: 'paper' .* 'paper_flange'"),
        ([recordings[0], elsewhere], {}, "different scenes"),
        (recordings, {"ghosts": recordings[::-1]}, "cannot be compared"),
        (recordings, {"groups": ["fell", "fell"]}, "a group for each recording: 2 for 3"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            replay_page(runs, **more)


def test_any_arm_can_be_drawn(any_simulator):
    page = replay_page(waving(any_simulator))
    drawn = [command for command in commands(page) if command["type"] == "set_object"]
    assert sum("/arm/" in command["path"] for command in drawn) >= 4
    joints = {part.joint for part in arm_parts(any_simulator.arm)}
    assert joints <= set(range(any_simulator.arm.n_joints + 1))


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (box((1, 2, 3)), 6.0),
        (capsule(1.0, 0.2), np.pi * 0.04 + np.pi * 0.032 / 3),
        (capsule(0.0, 1.0), 4 * np.pi / 3),
        (cylinder(2.0, 0.5), np.pi / 2),
        (lathe([(0, 1), (3, 0)]), np.pi),
        (tube([(0, 0, 0), (1, 0, 0), (2, 0, 0)], 0.1, 64), 2 * np.pi * 0.01),
    ],
)
def test_meshes_enclose_their_volume(mesh, expected):
    """Closed and with their outside out; curves are polygons, hence 3 %."""
    assert volume(mesh) == pytest.approx(expected, rel=0.03)


def test_an_arm_that_is_mounted_elsewhere_looks_the_same():
    """The base moves along; nothing else in the joints' frames changes."""
    arm, rotation = Arm.load("paper"), rotation_matrix((0.0, 0.1, 0.5))
    placed = arm.placed((0.1, 0.2, 0.3), rotation)
    for one, other in zip(arm_parts(arm), arm_parts(placed), strict=True):
        expected = one.mesh.vertices
        if one.joint == 0:
            expected = expected @ rotation.T + (0.1, 0.2, 0.3)
        np.testing.assert_allclose(other.mesh.vertices, expected, atol=1e-12)


def test_boxes_are_turned():
    """About the vertical through their centre; goals over a turned one make it a bench."""
    region = GoalRegion(name="over", lower=(0.4, 0.75, 0.52), upper=(0.6, 0.85, 0.52))
    turned = Obstacle(name="a", lower=(0.1, 0.3, 0.0), upper=(0.9, 0.5, 0.5), yaw=np.pi / 2)
    scene = Scene(obstacles=(turned,), goal_regions=(replace(region, lower=(0.4, 0.7, 0.52)),))
    ((body, top),) = obstacle_meshes(scene)
    np.testing.assert_allclose(top.vertices.min(axis=0), (0.4, 0.0, 0.48), atol=1e-9)
    np.testing.assert_allclose(top.vertices.max(axis=0), (0.6, 0.8, 0.5), atol=1e-9)
    aside = replace(region, lower=(0.7, 0.3, 0.52), upper=(0.9, 0.5, 0.52))
    assert len(obstacle_meshes(replace(scene, goal_regions=(aside,)))[0]) == 1
    assert volume(body) > 0


def test_corners_are_where_the_parts_of_the_arm_have_them(recordings):
    """In single precision."""
    drawn = []
    for command in commands(replay_page(recordings)):
        if command.get("path", "").startswith("/meshcat/arm") and "object" in command:
            (shape,) = command["object"]["geometries"]
            positions = shape["data"]["attributes"]["position"]["array"].data
            drawn.append(np.frombuffer(positions, "<f4").reshape(-1, 3))
    by_joint = {}
    for part in arm_parts(Arm.load("paper")):
        by_joint.setdefault((part.joint, part.finish), []).append(part.mesh)
    for vertices, meshes in zip(drawn, by_joint.values(), strict=True):
        np.testing.assert_allclose(vertices, Mesh.joined(meshes).vertices, atol=1e-6)
