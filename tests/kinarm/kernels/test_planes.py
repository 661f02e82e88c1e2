"""Separating planes against Coal's distances."""

import numpy as np
import pinocchio as pin
import pytest
from configurations import random_configurations
from numba import njit

from kinarm.contact_shapes import GROUND, PLANE
from kinarm.kernels.kinematics import POSE, forward_kinematics
from kinarm.kernels.planes import EVERYDAY, FINE, height_above, propose
from kinarm.kernels.separation import separate


@njit
def heights(chain, shapes, configurations, proposed, separated, again, coarse):
    """Heights above planes as proposed; as bettered, told and anew; and so with coarse movers."""
    poses = np.empty((configurations.shape[1] + 1, POSE))
    plane, relative, simplex = np.empty((1, PLANE)), np.empty((4, 3)), np.empty((4, 3))
    for i in range(len(configurations)):
        forward_kinematics(
            chain.prismatic,
            chain.translation,
            chain.rotation,
            chain.axis,
            configurations,
            i,
            poses,
        )
        for pair in range(len(shapes.planes)):
            propose(shapes, pair, poses, plane, 0)
            proposed[i, pair] = height_above(shapes, pair, EVERYDAY, poses, plane, 0)
            separated[i, pair] = height_above(shapes, pair, FINE, poses, plane, 0)
            if shapes.planes[pair, 0] != GROUND:
                separated[i, pair] = separate(shapes, pair, poses, relative, simplex, plane)
            again[i, pair] = height_above(shapes, pair, FINE, poses, plane, 0)
            coarse[i, pair] = height_above(shapes, pair, EVERYDAY, poses, plane, 0)


def distances(simulator, configurations):
    """Distances of all pairs as Coal finds them, shape (n, n_pairs)."""
    model, geometry = simulator.arm.model, simulator.world.contact_model.geometry
    data, geometry_data = model.createData(), geometry.createData()
    found = []
    for q in configurations:
        pin.computeDistances(model, data, geometry, geometry_data, q)
        found.append([result.min_distance for result in geometry_data.distanceResults])
    return np.array(found)


@pytest.fixture
def measured(any_simulator):
    configurations = random_configurations(any_simulator, 21, 1500)
    shapes = any_simulator.world.contact_model.shapes
    found = np.empty((4, len(configurations), len(shapes.planes)))
    heights(any_simulator.arm.chain, shapes, configurations, *found)
    return *found, distances(any_simulator, configurations)


def test_no_height_exceeds_the_distance(measured):
    *found, exact = measured
    for bound in found:
        assert (bound <= np.fmax(exact, 0) + 1e-6).all()


def test_bettered_planes_are_tight(any_simulator, measured):
    _, separated, again, _, exact = measured
    np.testing.assert_allclose(separated, again, rtol=0, atol=1e-12)
    apart = exact > 1e-3
    missing = (exact - separated)[apart]
    loose = 0.0 if any_simulator.world.contact_model.shapes.exact.all() else 2e-3
    assert (missing <= 0.021 * exact[apart] + 2e-6 + loose).all()


def test_proposed_planes_mostly_do(measured):
    proposed, *_, exact = measured
    apart = exact > 0.05
    assert (proposed > 0)[apart].mean() > 0.95


def test_coarse_movers_only_lower_the_height(measured):
    _, separated, _, coarse, _ = measured
    assert (coarse <= separated + 1e-12).all()
