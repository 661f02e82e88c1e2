"""Proof of contact, held against Coal."""

import numpy as np
import pinocchio as pin
import pytest
from configurations import contact_boundary, depths, random_configurations
from hanging_chain import BASE, LENGTHS, RADIUS, SLAB, tips
from numba import njit

from kinarm.kernels.kinematics import POSE, forward_kinematics, place_bodies
from kinarm.kernels.planes import DEPTH
from kinarm.policies.oracle.kernels.contact_proofs import overlaps
from kinarm.scene import Obstacle

CAPSULE_ARMS = ("lrmate200ic_5l", "paper", "paper_flange")


@njit
def claims_of(chain, shapes, centres, halves, share, poses, jacobian, claimed):
    place_bodies(shapes.placed, poses)
    for i in range(len(centres)):
        forward_kinematics(chain, centres, i, poses)
        claimed[i] = overlaps(True, chain, shapes, poses, halves[i], share, jacobian)


def claims(simulator, centres, halves=None, share=1.0):
    """Which boxes of configurations are claimed to be in contact throughout."""
    n = simulator.n_actions
    if halves is None:
        halves, share = np.ones((len(centres), n)), 0.0
    shapes = simulator.world.contact_model.shapes
    frames = simulator.arm.n_joints + 1 + len(shapes.placed)
    poses, jacobian = np.empty((frames, POSE)), np.empty((3, n))
    claimed = np.empty(len(centres), dtype=bool)
    claims_of(simulator.arm.chain, shapes, centres, halves, share, poses, jacobian, claimed)
    return claimed


def boxes(simulator, seed, count, smallest=-3.0, largest=-0.3):
    """Centres and half-widths of boxes within the limits; the other axes keep their place."""
    rng, arm, n = np.random.default_rng(seed), simulator.arm, simulator.n_actions
    middle = random_configurations(simulator, rng, count)
    width = 10.0 ** rng.uniform(smallest, largest, (count, 1)) * rng.random((count, n))
    lower = np.fmax(middle[:, :n] - width, arm.lower[:n])
    upper = np.fmin(middle[:, :n] + width, arm.upper[:n])
    middle[:, :n] = (lower + upper) / 2
    return middle, (upper - lower) / 2


def within(centre, half, rng, count):
    """Configurations of a box: inside, on its faces and at its corners."""
    n = len(half)
    shares = np.clip(rng.uniform(-2, 2, (count, n)), -1, 1)
    shares[: count // 4] = np.sign(shares[: count // 4])
    inside = np.tile(centre, (count, 1))
    inside[:, :n] += shares * half
    return inside


def certainly_free(simulator, configurations):
    """Which configurations Coal calls free, and measures to be apart.

    Its verdict alone misses about one contact of a capsule and a box in 100 000, at any depth.
    """
    free = np.flatnonzero(~simulator.world.contact_model.in_contact(configurations))
    return free[depths(simulator, configurations[free]) < 0]


def touching_alone(simulator, configurations):
    """Indices of configurations in which a single pair touches, and its kind."""
    model, geometry = simulator.arm.model, simulator.world.contact_model.geometry
    data, geometry_data = model.createData(), geometry.createData()
    kinds = simulator.world.contact_model.shapes.pairs[:, 0]
    alone, kind = [], []
    for index, q in enumerate(configurations):
        pin.computeCollisions(model, data, geometry, geometry_data, q, False)
        pairs = [
            k for k, result in enumerate(geometry_data.collisionResults) if result.isCollision()
        ]
        if len(pairs) == 1:
            alone.append(index)
            kind.append(kinds[pairs[0]])
    return np.array(alone), np.array(kind)


class TestSingleConfigurations:
    def test_never_claims_contact_where_nothing_touches(self, any_simulator):
        configurations = random_configurations(any_simulator, 1, 40_000)
        claimed = claims(any_simulator, configurations)
        assert certainly_free(any_simulator, configurations[claimed]).size == 0

    def test_never_claims_contact_where_something_nearly_touches(self, any_simulator):
        free, hit = contact_boundary(any_simulator, 2, 2000)
        rng = np.random.default_rng(3)
        size = 10.0 ** rng.uniform(-10, -2, (4 * len(free), 1))
        near = np.tile(np.concatenate([free, hit]), (2, 1))
        near += size * rng.normal(size=near.shape)
        near = np.concatenate([free, near])
        claimed = claims(any_simulator, near)
        assert certainly_free(any_simulator, near[claimed]).size == 0

    @pytest.mark.parametrize("name", CAPSULE_ARMS)
    def test_claims_nearly_all_contact_between_capsules(self, simulators, name):
        simulator = simulators[name]
        configurations = random_configurations(simulator, 4, 20_000)
        touching = simulator.world.contact_model.in_contact(configurations)
        assert touching.sum() > 2000
        assert claims(simulator, configurations)[touching].mean() > 0.99

    @pytest.mark.parametrize("name", CAPSULE_ARMS)
    def test_claims_contact_of_every_kind(self, simulators, name):
        simulator = simulators[name]
        configurations = random_configurations(simulator, 5, 6000)
        alone, kinds = touching_alone(simulator, configurations)
        claimed = claims(simulator, configurations[alone])
        for kind in range(3):
            assert (kinds == kind).sum() >= 5
            assert claimed[kinds == kind].mean() > 0.95

    def test_agrees_with_the_proof_of_freedom(self, any_simulator):
        configurations = random_configurations(any_simulator, 6, 20_000)
        free = any_simulator.world.proven(configurations)[1]
        assert not (free & claims(any_simulator, configurations)).any()


class TestShapes:
    def test_meshes_count_by_the_capsules_in_them(self, simulators):
        simulator = simulators["mesh"]
        configurations = random_configurations(simulator, 7, 20_000)
        touching = simulator.world.contact_model.in_contact(configurations)
        n_shapes = simulator.arm.geometry.ngeoms
        assert not simulator.world.contact_model.shapes.exact[:n_shapes].any()
        claimed = claims(simulator, configurations)
        assert not (claimed & ~touching).any()
        assert 0.1 < claimed.sum() / touching.sum() < 0.9

    def test_capsules_beside_other_shapes_do(self, simulators):
        simulator = simulators["sliding"]
        n_shapes = simulator.arm.geometry.ngeoms
        assert simulator.world.contact_model.shapes.exact[:n_shapes].sum() == 2
        assert claims(simulator, random_configurations(simulator, 8, 20_000)).sum() > 20


class TestBoxes:
    @pytest.mark.parametrize("obstacles", [(), (SLAB,)], ids=["ground", "slab"])
    def test_are_claimed_as_long_as_they_cannot_rise(self, hanging, obstacles):
        simulator = hanging(*obstacles)
        halves = np.random.default_rng(16).uniform(0.01, 0.05, (200, 4)) * [0.1, 1, 1, 1]
        halves[::2, 0], halves[0] = 0.0, 0.0
        rise = tips(halves)[:, 1] + LENGTHS.sum()
        centres, level = np.zeros((200, 4)), SLAB.upper[2] * len(obstacles)
        for share, claimed in ((0.99, False), (1.01, True)):
            centres[:, 0] = level + RADIUS + LENGTHS.sum() - share * (rise + DEPTH)
            np.testing.assert_array_equal(claims(simulator, centres, halves), claimed)

    @pytest.mark.parametrize("yaw", [None, 0.0, np.pi / 2])
    def test_are_claimed_as_long_as_they_cannot_leave_sideways(self, hanging, yaw):
        # The tool's ball overlaps that of the base, and a wall as far away, in the same depth.
        (x, y, z), depth = BASE, 2 * RADIUS - BASE[0]
        box = {"lower": (x - RADIUS, y - 1, z - 1), "upper": (x - RADIUS + 2, y + 1, z + 1)}
        simulator = hanging(*([] if yaw is None else [Obstacle(name="wall", yaw=yaw, **box)]))
        halves = np.random.default_rng(17).uniform(0.001, 0.01, (200, 4)) * [0, 1, 1, 1]
        halves *= (depth / np.abs(tips(halves)[:, 0]))[:, None]
        centres = np.tile([z + LENGTHS.sum(), 0, 0, 0], (200, 1))
        for share, claimed in ((0.98, True), (1.02, False)):
            np.testing.assert_array_equal(claims(simulator, centres, halves, share), claimed)

    def test_every_configuration_of_a_claimed_box_touches_something(self, any_simulator):
        centres, halves = boxes(any_simulator, 9, 60_000)
        claimed = np.flatnonzero(claims(any_simulator, centres, halves))
        rng = np.random.default_rng(10)
        tested = np.concatenate(
            [within(centres[i], halves[i], rng, 16) for i in claimed[:4000]]
            or [np.zeros((0, any_simulator.arm.n_joints))]
        )
        assert certainly_free(any_simulator, tested).size == 0
        if any_simulator.world.contact_model.shapes.exact.all():
            assert len(claimed) > 4000

    @pytest.mark.parametrize("name", CAPSULE_ARMS)
    def test_boxes_that_are_barely_claimed_touch_something_throughout(self, simulators, name):
        simulator = simulators[name]
        centres, halves = boxes(simulator, 11, 8000, smallest=-0.7, largest=0.0)
        overlapping = claims(simulator, centres)
        centres, halves = centres[overlapping], halves[overlapping]
        low, high = np.zeros(len(centres)), np.ones(len(centres))
        for _ in range(30):
            middle = (low + high) / 2
            claimed = claims(simulator, centres, halves * middle[:, None])
            low, high = np.where(claimed, middle, low), np.where(claimed, high, middle)
        barely = np.flatnonzero((low > 0) & (high < 1))
        assert len(barely) > 500
        rng = np.random.default_rng(12)
        tested = [within(centres[i], halves[i] * low[i], rng, 32) for i in barely]
        assert certainly_free(simulator, np.concatenate(tested)).size == 0

    @pytest.mark.parametrize("name", CAPSULE_ARMS)
    def test_small_boxes_of_deep_overlap_are_claimed(self, simulators, name):
        simulator = simulators[name]
        configurations = random_configurations(simulator, 13, 4000)
        deep = configurations[depths(simulator, configurations) > 0.03]
        assert len(deep) > 200
        halves = np.full((len(deep), simulator.n_actions), 0.003)
        assert claims(simulator, deep, halves).mean() > 0.9

    def test_a_larger_box_is_never_claimed_sooner(self, simulator):
        centres, halves = boxes(simulator, 14, 20_000)
        small, large = (claims(simulator, centres, halves, share) for share in (0.3, 1.0))
        assert not (large & ~small).any()
        assert (small & ~large).any()
