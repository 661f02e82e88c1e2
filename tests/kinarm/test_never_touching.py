"""Pairs that are proven never to touch: by hand, and held against Coal where they come closest."""

import numpy as np
import pinocchio as pin
import pytest
from known_arms import INSTALLED
from scipy.optimize import minimize

from kinarm import Arm, Simulator
from kinarm.contact_pairs import BEYOND, CLOSE, NEVER_TOUCH
from kinarm.contact_statistics import contact_on_bare_ground

WIDE = '<limit lower="-3.2" upper="3.2" velocity="2" effort="0"/>'
RADIUS, REACH = 0.05, 0.3
"""Of two balls: one at the end of two links in a plane, and one on the base [m]."""


@pytest.fixture(scope="module")
def reasons(write_robot, make_joint, make_collision):
    """Why the two balls are not tested, by the place of the base's and the limits, or None."""

    def load(x, y, *, limits=(WIDE, WIDE), between="", end="0.1 0 0"):
        joints = [
            make_joint(xyz="0 0 0.3", axis="0 0 1", limit=limits[0]),
            make_joint(xyz="0.2 0 0", axis="0 0 1", limit=limits[1]),
            *(make_joint(xyz="0 0 0", axis=axis, limit=WIDE) for axis in between),
        ]
        ball = f'<sphere radius="{RADIUS}"/>'
        shapes = {
            0: make_collision(ball, xyz=f"{x} {y} 0.3"),
            len(joints): make_collision(ball, xyz=end),
        }
        contact = contact_on_bare_ground(Arm.load(write_robot(joints, shapes)))
        return contact.left_out.get(("link_0", f"link_{len(joints)}"))

    return load


@pytest.mark.parametrize(
    ("gap", "reason"), [(2 * CLOSE, NEVER_TOUCH), (CLOSE / 2, None), (-CLOSE, None)]
)
def test_what_stays_apart_is_left_out_and_what_comes_close_is_not(reasons, gap, reason):
    away = REACH + 2 * RADIUS + gap
    assert reasons(0.6 * away, -0.8 * away) == reason


@pytest.mark.parametrize(("beyond", "reason"), [(-0.05, None), (0.1, NEVER_TOUCH)])
def test_joints_may_be_somewhat_beyond_their_limits(reasons, beyond, reason):
    """The arm, nearly straight, meets the other ball only beyond the first joint's limit."""
    limits = [WIDE.replace("3.2", most) for most in ("0.5", "0.01")]
    away = REACH + RADIUS
    angle = 0.5 + BEYOND + 2 * np.arcsin(RADIUS / away) + beyond
    assert reasons(away * np.cos(angle), away * np.sin(angle), limits=limits) == reason


def test_a_bound_that_is_nearly_attained_is_not_too_small(reasons):
    """One joint moves a ball straight at the other, which it meets at the end of its range."""
    limit = WIDE.replace("3.2", "0.15")
    angle = 0.15 + BEYOND + 2 * np.arcsin((2 * RADIUS - CLOSE) / 0.4)
    x, y = 0.2 * np.cos(angle), 0.2 * np.sin(angle)
    assert reasons(x, y, limits=(limit, WIDE), end="0 0 0") is None
    angle += 0.01 + CLOSE / 0.1
    x, y = 0.2 * np.cos(angle), 0.2 * np.sin(angle)
    assert reasons(x, y, limits=(limit, WIDE), end="0 0 0") == NEVER_TOUCH


def test_many_joints_between_are_not_gone_through(reasons):
    far = 3 * REACH
    assert reasons(far, 0.0, between=("1 0 0", "0 1 0")) == NEVER_TOUCH
    assert reasons(far, 0.0, between=("1 0 0", "0 1 0", "1 0 0")) is None


@pytest.mark.parametrize(
    "name",
    ["both", *(pytest.param(arm, marks=INSTALLED) for arm in ("benches-ur5", "desk-so101"))],
)
def test_none_of_them_touches_where_it_comes_closest(name):
    """Coal at random configurations, and from the closest of these on, by another search."""
    simulator = Simulator(name, threads=1)
    contact, arm = simulator.world.contact_model, simulator.arm
    names, shapes = contact.body_names, contact.geometry.copy()
    shapes.removeAllCollisionPairs()
    for pair, reason in contact.left_out.items():
        if reason == NEVER_TOUCH:
            shapes.addCollisionPair(pin.CollisionPair(*map(names.index, pair)))
    assert len(shapes.collisionPairs) > 5
    data, placed = arm.model.createData(), shapes.createData()

    def distances(q):
        pin.computeDistances(arm.model, data, shapes, placed, q)
        return np.array([each.min_distance for each in placed.distanceResults])

    # Joints that are held elsewhere, too, as starts may have them.
    tried = np.random.default_rng(3).uniform(arm.lower, arm.upper, (300, arm.n_joints))
    found = np.array([distances(q) for q in tried])
    bounds = np.stack([arm.lower, arm.upper], axis=1)
    for pair in np.argsort(found.min(axis=0))[:6]:

        def apart(q, pair=pair):
            return distances(q)[pair]

        start = tried[found[:, pair].argmin()]
        closest = minimize(apart, start, method="Nelder-Mead", bounds=bounds)
        assert closest.fun > CLOSE
