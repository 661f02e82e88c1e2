"""The page of an arm in a real browser: contact as Coal has it, sliders, keys, small screens."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from kinarm.arm import Arm
from kinarm.bodies import Body
from kinarm.collision import ContactModel
from kinarm.contact_pairs import make_verdicts_reliable
from kinarm.scene import Obstacle, Scene
from kinarm.viewer import arm_page

ARMS = ("paper", "ur5")
CLOSE, CLOSE_IF_ROUND = 1e-6, 2e-6
"""Distances within which verdicts may differ; those of Coal from cylinders err by 1e-6 [m]."""

TURNED = Obstacle(name="turned", lower=(0.25, -0.1, 0.0), upper=(0.4, 0.1, 0.2), yaw=0.6)
WALL = Body(name="wall", shape="halfspace", position=(-0.6, 0.0, 0.0), rpy=(0.1, 1.5, 0.0))
SCENE = Scene(obstacles=(*Scene().obstacles, TURNED, WALL))
POSES = """(q) => {
    kinarm.set(q);
    return [q.map((_, k) => kinarm.pose(`axis_${k + 1}`)), kinarm.state.tool];
}"""
CONTACTS = "(qs) => qs.map((q) => kinarm.contacts(q).map(([a, b]) => [a, b]))"


class PairChecker:
    """Coal's verdict on each pair."""

    def __init__(self, model):
        self.model, self.data = model, model.arm.model.createData()
        self.geometry_data = make_verdicts_reliable(model.geometry.createData())
        self.pairs = [(pair.first, pair.second) for pair in model.geometry.collisionPairs]

    def touching(self, configuration):
        geometry, data = self.model.geometry, self.geometry_data
        pin.updateGeometryPlacements(self.model.arm.model, self.data, geometry, data, configuration)
        found = (pin.computeCollision(geometry, data, k) for k in range(len(self.pairs)))
        return {pair for pair, touches in zip(self.pairs, found, strict=True) if touches}

    def doubt(self, pair):
        shapes = [self.model.geometry.geometryObjects[body].geometry for body in pair]
        return CLOSE_IF_ROUND if any(isinstance(s, coal.Cylinder) for s in shapes) else CLOSE

    def distance(self, configuration, pair):
        geometry, data = self.model.geometry, self.geometry_data
        pin.updateGeometryPlacements(self.model.arm.model, self.data, geometry, data, configuration)
        return pin.computeDistance(geometry, data, self.pairs.index(pair)).min_distance


@pytest.fixture(scope="module", params=ARMS)
def name(request):
    """An arm; tests of one run one after the other."""
    if request.param != "paper":
        pytest.importorskip("trimesh")
    return request.param


def arm_file(folder, arm):
    arm_page(arm, folder / "arm.html", scene=SCENE)
    return folder / "arm.html"


@pytest.fixture(scope="module")
def page(visit, tmp_path_factory, name):
    """Its page, with obstacles around it."""
    with visit(arm_file(tmp_path_factory.mktemp(name), name)) as opened:
        yield opened


@pytest.fixture(scope="module")
def paper_page(visit, tmp_path_factory):
    with visit(arm_file(tmp_path_factory.mktemp("page"), "paper")) as opened:
        yield opened


@pytest.fixture
def watched(paper_page):
    """The page of the arm ``paper``, at home."""
    paper_page.tell("kinarm.set([0, 0, 0, 0, 0, 0])")
    paper_page.tell("document.activeElement.blur()")
    return paper_page


def near_contact(arm, coal_pairs, rng, count):
    """Configurations on both sides of where something starts to touch, some 1e-6 m from it."""
    found = []
    while len(found) < count:
        ends = rng.uniform(arm.lower, arm.upper, (2, arm.n_joints))
        first, second = (bool(coal_pairs.touching(end)) for end in ends)
        if first == second:
            continue
        low, high = 0.0, 1.0
        while high - low > 1e-12:
            middle = (low + high) / 2
            q = ends[0] + middle * (ends[1] - ends[0])
            low, high = (middle, high) if bool(coal_pairs.touching(q)) == first else (low, middle)
        length = np.abs(ends[1] - ends[0]).sum()
        for step in (3e-6, 3e-5, 1e-3):
            found += [
                ends[0] + (low + way * step / length) * (ends[1] - ends[0]) for way in (-1, 1)
            ]
    return np.clip(found, arm.lower, arm.upper)


def test_contacts_are_those_of_coal(page, name):
    arm = Arm.load(name)
    coal_pairs, rng = PairChecker(ContactModel.build(arm, SCENE)), np.random.default_rng(0)
    anywhere = rng.uniform(arm.lower, arm.upper, (400, arm.n_joints))
    configurations = np.concatenate([anywhere, near_contact(arm, coal_pairs, rng, 240)])
    found = page.page.evaluate(CONTACTS, configurations.tolist())
    touched = 0
    for q, seen in zip(configurations, found, strict=True):
        expected, told = coal_pairs.touching(q), {tuple(pair) for pair in seen}
        touched += bool(expected)
        for pair in expected ^ told:
            assert abs(coal_pairs.distance(q, pair)) < coal_pairs.doubt(pair), (name, pair, q)
    assert 120 < touched < len(configurations) - 120


def test_contact_points_lie_in_both_bodies(page, name):
    """A tiny ball about the point touches both, as Coal sees it."""
    arm = Arm.load(name)
    model = ContactModel.build(arm, SCENE)
    coal_pairs = PairChecker(model)
    rng = np.random.default_rng(1)
    ball, checked = coal.Sphere(1e-6), 0
    for q in rng.uniform(arm.lower, arm.upper, (100, arm.n_joints)):
        contacts = page.page.evaluate("(q) => kinarm.contacts(q)", q.tolist())
        coal_pairs.touching(q)
        for first, second, point in contacts:
            for body in (first, second):
                shape, place = (
                    model.geometry.geometryObjects[body],
                    coal_pairs.geometry_data.oMg[body],
                )
                result = coal.CollisionResult()
                there = coal.Transform3s(place.rotation, place.translation)
                ball_there = coal.Transform3s(np.eye(3), np.array(point))
                request = coal.CollisionRequest()
                coal.collide(shape.geometry, there, ball, ball_there, request, result)
                assert result.isCollision(), (shape.name, point)
                checked += 1
    assert checked > 30


def test_poses_are_those_of_pinocchio(page, name):
    arm = Arm.load(name)
    data = arm.model.createData()
    for q in np.random.default_rng(2).uniform(arm.lower, arm.upper, (5, arm.n_joints)):
        poses, tool = page.page.evaluate(POSES, q.tolist())
        pin.forwardKinematics(arm.model, data, q)
        for joint, pose in enumerate(poses, start=1):
            found = np.array(pose).reshape(4, 4).T
            np.testing.assert_allclose(found, data.oMi[joint].homogeneous, rtol=0, atol=1e-6)
        np.testing.assert_allclose(tool, arm.tool_position(q), rtol=0, atol=1e-6)


def test_nothing_is_fetched_and_nothing_fails(page):
    page.tell("kinarm.set(kinarm.state.configuration.map(() => 0.2))")
    assert len(page.requests) == 1
    assert page.complaints == []
    assert page.tell("kinarm.census()")["triangles"] > 5000


def test_sliders_stay_within_limits(watched):
    arm = Arm.load("paper")
    watched.tell("kinarm.set([9, -9, 9, -9, 9, -9])")
    configuration = watched.state["configuration"]
    expected = np.where(np.arange(6) % 2, arm.lower, arm.upper)
    np.testing.assert_array_equal(configuration, expected)
    shown = watched.page.locator("#joints output").all_inner_texts()
    assert shown == [f"{np.rad2deg(value):.1f}°" for value in expected]
    slider = watched.page.locator("#joints input").nth(1)
    slider.fill("0.5")
    assert watched.state["configuration"][1] == 0.5


def test_contact_is_told_and_goes(watched):
    text = watched.page.locator
    assert text("#verdict").inner_text() == "Free"
    watched.tell("kinarm.set([0, 2.3, 0, 0, 0, 0])")
    names = [" touches ".join(pair) for pair in watched.state["touching"]]
    assert names
    assert text("#verdict").inner_text() == "Contact"
    assert names[0] in text("#touching").inner_text()
    assert text("#spoken").inner_text() == names[0]
    watched.page.click("#home")
    assert watched.state["touching"] == []
    assert watched.state["configuration"] == [0] * 6
    assert text("#touching").inner_text() == ""


def test_collision_shapes_are_switched_on(watched):
    watched.tell("drawn = true; kinarm.set(kinarm.state.configuration)")
    watched.page.wait_for_timeout(100)
    before = watched.page.locator("#stage").screenshot()
    watched.page.click("#shapes")
    assert watched.state["shapes"]
    watched.page.wait_for_timeout(100)
    assert watched.page.locator("#stage").screenshot() != before
    watched.page.click("#shapes")
    assert not watched.state["shapes"]
    watched.tell("drawn = false")


def test_keys(watched):
    press = watched.page.keyboard.press
    for key, joint, value in (
        ("ArrowDown", 0, 0.0),
        ("ArrowDown", 1, 0.0),
        ("ArrowRight", 1, np.deg2rad(1)),
        ("Shift+ArrowLeft", 1, np.deg2rad(-9)),
        ("ArrowUp", 1, np.deg2rad(-9)),
        ("End", 0, Arm.load("paper").upper[0]),
        ("h", 0, 0.0),
    ):
        press(key)
        assert watched.state["configuration"][joint] == pytest.approx(value), key
    for key, what, value in (("c", "shapes", True), ("t", "theme", "dark")):
        before = watched.state[what]
        press(key)
        assert watched.state[what] == value != before
        press(key)
    press("?")
    assert watched.page.locator("#keys").is_visible()
    press("?")


@pytest.mark.parametrize("size", [(390, 844), (844, 390), (320, 568)])
def test_a_phone_shows_everything(watched, size):
    watched.page.set_viewport_size({"width": size[0], "height": size[1]})
    watched.tell("kinarm.set([0, 2.3, 0, 0, 0, 0])")
    watched.check_fit(size, "#card", "#dock")
    watched.page.locator("#joints input").last.scroll_into_view_if_needed()
    assert watched.page.locator("#joints input").last.is_visible()
    watched.page.set_viewport_size({"width": 800, "height": 600})
