"""Configurations at which contact is tested, and how deep it is there."""

import numpy as np
import pinocchio as pin


def random_configurations(simulator, seed, count):
    arm = simulator.arm
    return np.random.default_rng(seed).uniform(arm.lower, arm.upper, (count, arm.n_joints))


def contact_boundary(simulator, seed, count, halvings=34):
    """Pairs of configurations, free and touching, that are closer than 1e-9 to each other."""
    judge = simulator.world.contact_model.in_contact
    candidates = random_configurations(simulator, seed, 8 * count)
    touching = judge(candidates)
    n = min(count, touching.sum(), (~touching).sum())
    free, hit = candidates[~touching][:n], candidates[touching][:n]
    for _ in range(halvings):
        middle = (free + hit) / 2
        touches = judge(middle)[:, None]
        free, hit = np.where(touches, free, middle), np.where(touches, middle, hit)
    return free, hit


def substeps(world, starts, ends):
    """Ends of the parts of steps, at which they are tested, shape (n, n_parts, n_joints)."""
    shares = np.arange(1, world.rules.parts + 1)[:, None] / world.rules.parts
    ways = starts[:, None] + shares * (ends - starts)[:, None]
    ways[:, -1] = ends
    return ways


def pair_distances(world, configurations):
    """Distances of all tested pairs as Coal finds them, shape (n, n_pairs) [m]."""
    model, geometry = world.arm.model, world.contact_model.geometry
    data, geometry_data = model.createData(), geometry.createData()
    found = []
    for q in configurations:
        pin.computeDistances(model, data, geometry, geometry_data, q)
        found.append([result.min_distance for result in geometry_data.distanceResults])
    return np.reshape(found, (-1, len(geometry.collisionPairs)))


def depths(simulator, configurations):
    """How deep the deepest pair overlaps, according to Coal; less than 0 if nothing touches [m]."""
    return -pair_distances(simulator.world, configurations).min(axis=1)


def jittered(configurations, seed):
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-10, -2, (len(configurations), 1))
    return configurations + size * rng.normal(size=configurations.shape)
