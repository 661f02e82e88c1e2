"""What touches in the playground, in a real browser, is what touches for Coal."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from random_policies import policy_for

from kinarm.arm import Arm
from kinarm.bodies import Body
from kinarm.collision import ContactModel
from kinarm.contact_pairs import make_verdicts_reliable
from kinarm.evaluation.replay import page_policy
from kinarm.problem import PROBLEMS
from kinarm.scene import Obstacle, Scene
from kinarm.viewer.pages import play_page
from kinarm.world import World

ARMS = ("paper", "ur5")
CLOSE, CLOSE_IF_ROUND = 1e-6, 2e-6
"""Distances within which verdicts may differ; those of Coal from cylinders err by 1e-6 [m]."""

TURNED = Obstacle(name="turned", lower=(0.25, -0.1, 0.0), upper=(0.4, 0.1, 0.2), yaw=0.6)
WALL = Body(name="wall", shape="halfspace", position=(-0.6, 0.0, 0.0), rpy=(0.1, 1.5, 0.0))
SCENE = Scene(obstacles=(*Scene().obstacles, TURNED, WALL))
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


@pytest.fixture(scope="module")
def page(visit, tmp_path_factory, name):
    """A playground of it, with obstacles around it."""
    world = World(PROBLEMS["both"].replace(arm=name, scene=SCENE))
    player = page_policy("random", policy_for(world.problem), world)
    made = play_page(world, [player], world.arm.home[None], np.array([[0.3, -0.65, 0.325]]))
    file = tmp_path_factory.mktemp(name) / "play.html"
    made.save(file)
    with visit(file) as opened:
        yield opened


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
    coal_pairs, rng = (
        PairChecker(ContactModel.build(arm, SCENE, loose=True)),
        np.random.default_rng(0),
    )
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
    model = ContactModel.build(arm, SCENE, loose=True)
    coal_pairs = PairChecker(model)
    rng = np.random.default_rng(1)
    ball, checked = coal.Sphere(1e-6), 0
    for q in rng.uniform(arm.lower, arm.upper, (100, arm.n_joints)):
        contacts = page.page.evaluate("(q) => kinarm.contacts(q)", q.tolist())
        coal_pairs.touching(q)
        for first, second, point, _ in contacts:
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
