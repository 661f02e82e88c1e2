"""Separating planes against Coal's distances."""

import numpy as np
from configurations import pair_distances, random_configurations
from numba import njit

from kinarm.contact_shapes import PLANE, WITH_HALFSPACE
from kinarm.kernels.kinematics import POSE, forward_kinematics, place_bodies
from kinarm.kernels.planes import (
    EVERYDAY,
    FINE,
    height_above,
    propose,
    separate,
)
from kinarm.kernels.rough_bounds import axes_apart, axis_above, ball_gap, place_axes


@njit
def heights(
    chain, shapes, configurations, balls, axes, slim, proposed, separated, again, coarse, touching
):
    """Distances of balls and of capsules, and heights of these above proposed planes.

    Then those of bodies: above planes as proposed; as bettered, told, anew and coarsely.
    And 1 where bodies are said to touch.
    """
    poses = np.empty((configurations.shape[1] + 1 + len(shapes.placed), POSE))
    place_bodies(shapes.placed, poses)
    ends = np.empty((len(shapes.around), 6))
    plane, relative, simplex = np.empty((1, PLANE)), np.empty((1, POSE)), np.empty((4, 3))
    for i in range(len(configurations)):
        forward_kinematics(chain, configurations, i, poses)
        place_axes(shapes, poses, ends)
        for pair in range(shapes.travel.shape[1]):
            balls[i, pair] = ball_gap(shapes, pair, poses)
            axes[i, pair] = axes_apart(shapes, pair, poses, ends)
            propose(shapes, pair, poses, plane, 0)
            slim[i, pair] = axis_above(shapes, pair, poses, ends, plane, 0)
            proposed[i, pair] = height_above(shapes, pair, EVERYDAY, poses, plane, 0)
            separated[i, pair] = height_above(shapes, pair, FINE, poses, plane, 0)
            if shapes.pairs[pair, 0] != WITH_HALFSPACE:
                found = separate(shapes, pair, poses, relative, simplex, plane)
                separated[i, pair], touching[i, pair] = found
            again[i, pair] = height_above(shapes, pair, FINE, poses, plane, 0)
            coarse[i, pair] = height_above(shapes, pair, EVERYDAY, poses, plane, 0)


def test_heights_are_no_more_than_the_distance_and_bettered_planes_tight(any_simulator):
    configurations = random_configurations(any_simulator, 21, 500)
    shapes = any_simulator.world.contact_model.shapes
    tested = shapes.travel.shape[1]
    found = np.zeros((8, len(configurations), tested))
    heights(any_simulator.arm.chain, shapes, configurations, *found)
    exact = pair_distances(any_simulator.world, configurations)
    balls, axes, slim, proposed, separated, again, coarse, touching = found
    assert (found[:7] <= np.fmax(exact, 0) + 1e-6).all()
    assert (exact[touching > 0] < -9e-7).all()
    known = np.isfinite(shapes.excess[shapes.proxies[:tested, FINE]]).all(axis=1)
    deep = (exact < -3e-4) & known & (shapes.pairs[:tested, 0] != WITH_HALFSPACE)
    assert touching[deep].mean() > 0.99
    np.testing.assert_allclose(separated, again, rtol=0, atol=1e-12)
    apart = exact > 1e-3
    missing = (exact - separated)[apart]
    loose = 0.0 if shapes.exact.all() else 2e-3
    assert (missing <= 0.021 * exact[apart] + 2e-6 + loose).all()
    assert (coarse <= separated + 1e-12).all()
    for rough in (balls, axes, slim):
        assert (rough[exact > 0.5] > 0).mean() > 0.5
    assert (slim > 0)[apart].mean() > 0.8
    if shapes.exact.all():
        assert (proposed >= 0.99 * exact)[apart].mean() > 0.97
