"""Pictures: what is where, in light and shadow, held against formulas."""

import math
from dataclasses import astuple

import numpy as np
import pytest

from kinarm.arm import Arm
from kinarm.collision import Contact
from kinarm.contact_pairs import body_names
from kinarm.errors import InvalidInputError
from kinarm.problem import ReachProblem
from kinarm.viewer import Camera, Renderer

pytest.importorskip("raylib")

CAMERAS = (
    Camera((-2.3, -1.8, 1.7), (0.1, 0.0, 0.3)),
    Camera((0.4, 2.5, 0.4), (0.0, 0.0, 0.4), 45.0),
    Camera((0.3, 0.0, 3.0), (0.3, 0.0, 0.0), 60.0),  # straight down
)
GOAL = np.array([0.22, -0.64, 0.325])
BENT = np.deg2rad([-73.8, 36.6, 22.8, -10.4, -52.4, 0.0])
HOME = np.zeros(6)


@pytest.fixture(scope="module")
def renderer():
    return Renderer("right", width=240, height=180)


def pixel(camera, size, point):
    """Column and row at which a pinhole camera sees a point, by angles to its axes."""
    width, height = size
    position, target, angle = (np.array(part, dtype=float) for part in astuple(camera))
    ahead = (target - position) / math.dist(target, position)
    above = [1.0, 0, 0] if abs(ahead[2]) > 0.999 else [0, 0, 1.0]
    right = np.cross(ahead, above) / np.linalg.norm(np.cross(ahead, above))
    ray = np.asarray(point) - position
    scale = height / 2 / math.tan(math.radians(angle) / 2) / (ray @ ahead)
    up = ray @ np.cross(right, ahead)
    return np.array([width / 2 + scale * (ray @ right), height / 2 - scale * up])


class TestWhereThingsAre:
    @pytest.mark.parametrize("camera", CAMERAS)
    def test_cube_is_where_a_pinhole_camera_sees_it(self, camera):
        size = (400, 300)
        renderer = Renderer("right", width=size[0], height=size[1], camera=camera)
        for goal in ((0.3, -0.6, 0.325), (-0.2, -0.7, 0.325), (0.5, -0.5, 0.8)):
            picture = renderer.render(HOME, goal).astype(int)
            green = (picture[..., 1] > picture[..., 0] + 60).nonzero()
            seen = np.array([green[1].mean(), green[0].mean()]) + 0.5
            np.testing.assert_allclose(seen, pixel(camera, size, goal), atol=2.5)

    @pytest.mark.parametrize("configuration", [HOME, BENT])
    def test_the_way_ends_at_the_tool(self, configuration):
        arm, camera, size = Arm.load("paper"), CAMERAS[0], (480, 360)
        tool = arm.tool_position(configuration)
        renderer = Renderer("right", width=size[0], height=size[1], camera=camera)
        trace = tool + np.linspace(0, 1, 30)[:, None] * [0, 0, 0.2]
        plain = renderer.render(configuration, GOAL).astype(int)
        traced = renderer.render(configuration, GOAL, trace=trace, outcome="truncated").astype(int)
        changed = np.argwhere((traced[..., 0] > 200) & (np.abs(traced - plain).max(axis=2) > 40))
        lowest = changed[changed[:, 0].argmax()]
        np.testing.assert_allclose(lowest[::-1] + 0.5, pixel(camera, size, tool), atol=6)


class TestOutcomes:
    def test_contact_flashes_and_the_link_glows(self, renderer):
        point = np.array([0.2, -0.5, 0.5])
        link = body_names(Arm.load("paper"))[3]
        contact = Contact(HOME, (link, "right bench"), point)
        plain = renderer.render(HOME, GOAL, outcome="collision").astype(int)
        flashed = renderer.render(HOME, GOAL, outcome="collision", contact=contact).astype(int)
        row, column = pixel(renderer.camera, (240, 180), point).astype(int)[::-1]
        assert flashed[row, column, 0] - flashed[row, column, 2] > 50
        changed = (np.abs(flashed - plain).max(axis=2) > 5).sum()
        focal = 90 / math.tan(math.radians(15))
        ball = math.pi * (focal * 0.0375 / math.dist(point, renderer.camera.position)) ** 2
        assert changed > 3 * ball


class TestCamera:
    def test_stands_on_the_side_of_the_goals(self):
        left, right = (Camera.of_replays(ReachProblem.load(name)) for name in ("left", "right"))
        assert left.position[1] > 0 > right.position[1]
        assert left.position[0] == right.position[0] < 0

    @pytest.mark.parametrize(
        ("camera", "message"),
        [
            (("above", (0, 0, 0)), "position must be a list of 3, each a number .m., got 'above'"),
            (((1, 2, 3), (0, 0, math.nan)), "target must be finite"),
            (((1, 2, 3), (1, 2, 3)), "position and target are the same"),
            (((1, 2, 3), (0, 0, 0), 180), "field_of_view must be between 0 and 180 degrees"),
        ],
    )
    def test_bad_ones_are_refused(self, camera, message):
        with pytest.raises(InvalidInputError, match=message):
            Camera(*camera)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"configuration": np.zeros(5)}, "configuration must have shape"),
        ({"goal": [0, 0, math.inf]}, "goal must be finite"),
        ({"trace": np.zeros((3, 2))}, "trace must have shape"),
        ({"outcome": "lost"}, "available: success, collision, truncated"),
    ],
)
def test_bad_input(renderer, changes, message):
    with pytest.raises(InvalidInputError, match=message):
        renderer.render(**{"configuration": HOME, "goal": GOAL, **changes})
