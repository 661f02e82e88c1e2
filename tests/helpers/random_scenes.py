"""Scenes of bodies of every shape, and random bodies."""

from dataclasses import replace

import numpy as np

from kinarm.bodies import SHAPES, Body, RandomBodies
from kinarm.body_motion import BodyMotion
from kinarm.problem import ReachProblem
from kinarm.scene import PAPER_GOALS, Scene

CLUTTER = RandomBodies(
    name="box",
    shape="box",
    count=(2, 5),
    smallest=(0.05, 0.05, 0.1),
    largest=(0.2, 0.2, 0.4),
    near="path",
    lower=(-0.1, -0.1, -0.1),
    upper=(0.1, 0.1, 0.1),
    turned="any",
)
"""Boxes around the way from start to goal."""


def among(name, bodies):
    """A problem whose scene also has random bodies."""
    problem = ReachProblem.load(name)
    return problem.replace(scene=replace(problem.scene, random_bodies=(bodies,)))


def swinging(speed):
    """Two balls that swing through the arm's space at a speed along x and y [m/s]."""
    ways = ((0.5, 0.35, 0.35, 0.0), (1.5, -0.35, -0.35, 0.0), (2.0, 0.0, 0.0, 0.0))
    waypoints = tuple((0.7 * time / speed, *offset) for time, *offset in ways)
    return RandomBodies(
        name="ball",
        shape="sphere",
        count=(2, 2),
        smallest=(0.08,),
        largest=(0.15,),
        near="path",
        lower=(-0.3, -0.3, -0.3),
        upper=(0.3, 0.3, 0.3),
        motion=BodyMotion(waypoints=waypoints, periodic=True),
    )


def random_body(rng, name, shape, reach=0.8, largest=0.2):
    """A body of a shape, somewhere about the base, turned anyhow."""
    angle, distance, turn = rng.uniform(-3, 3), rng.uniform(0.35, reach), rng.normal(size=4)
    position = distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0, 1.5 * reach)
    pose = {"position": position, "quaternion": turn / np.linalg.norm(turn)}
    if shape == "halfspace":
        # Below the base, or behind a wall that leans.
        pose = {"position": (-0.9, 0.0, 0.0), "rpy": (0.2, rng.uniform(1.2, 1.6), 0.3)}
    size = rng.uniform(0.03, largest, len(SHAPES[shape]))
    vertices = rng.normal(size=(12, 3)) * largest / 2 if shape == "mesh" else ()
    return Body(name=name, shape=shape, size=size, vertices=vertices, **pose)


def random_motion(rng):
    """A drift, or a swing."""
    if rng.random() < 0.5:
        return BodyMotion(velocity=tuple(rng.uniform(-0.3, 0.3, 3)))
    away = rng.uniform(-0.3, 0.3, 3)
    return BodyMotion(waypoints=((0.9, *away), (1.7, 0, 0, 0)), periodic=True)


def random_scene(seed, count=8, shapes=tuple(SHAPES), ground=True, moving=0, **settings):
    """A scene of so many bodies, the shapes by turns, about the paper's goals; some move."""
    rng = np.random.default_rng(seed)
    bodies = [
        random_body(rng, f"{shapes[k % len(shapes)]} {k}", shapes[k % len(shapes)], **settings)
        for k in range(count)
    ]
    for k in rng.permutation(count)[:moving]:
        bodies[k] = replace(bodies[k], motion=random_motion(rng))
    return Scene(ground=ground, obstacles=bodies, goal_regions=PAPER_GOALS)
