"""What is drawn for an episode: random bodies and a plant, which follow from start and goal."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kinarm._parallel import run_rows
from kinarm.arm import Arm
from kinarm.bodies import PARKED, Body
from kinarm.chain import Chain, quaternion_of
from kinarm.errors import ProblemError
from kinarm.kernels.compiling import Array
from kinarm.kernels.placing import ATTEMPTS, draw_scenes
from kinarm.kernels.plant import FORMER, OFFSETS, SUBSTEPS, VELOCITY, draw_plants, plant_width
from kinarm.plant import RANGES
from kinarm.problem import ReachProblem
from kinarm.scene import Scene
from kinarm.scene_draws import SceneDraws


def scenes_at(scenes: Array, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Array:
    """Scenes of some episodes; as they are, empty, if all have the same."""
    return scenes[rows] if len(scenes) else scenes


def bits_of(starts: Array, goals: Array) -> NDArray[np.uint64]:
    """Bits of goals and starts, shape (n, goal_width + n_joints): they decide what is drawn."""
    return (np.concatenate([goals, starts], axis=1) + 0.0).view(np.uint64)


def drawn_rows(
    scene: Scene, draws: SceneDraws, chain: Chain, starts: Array, goals: Array, threads: int
) -> Array:
    """Rows of all bodies in ``poses``, for each episode, shape (n, n_placed, 16).

    Raises ProblemError if there is no place for a body.

    Parameters
    ----------
    scene, draws, chain
        Scene with random bodies, how they are drawn, and the arm.
    starts, goals : ndarray, shape (n, n_joints) and (n, 3)
        Starts [rad or m] and goals [m].
    threads : int
        Threads at most.
    """
    n = len(starts)
    scenes, failed = np.empty((n, *draws.placed.shape)), np.empty(n, dtype=np.int64)
    arrays = starts, goals, bits_of(starts, goals), scenes, failed
    run_rows(draw_scenes, n, n, threads, chain, draws, *arrays)
    if failed.any():
        name = scene.random_bodies[int(failed.max()) - 1].name
        raise ProblemError(
            f"no place clear of the goal found for one of random bodies {name!r} in {ATTEMPTS} "
            f"draws, in {np.count_nonzero(failed)} of {n} scenes"
        )
    return scenes


def scene_of_episode(scene: Scene, arm: Arm, start: Array, goal: Array) -> Scene:
    """The scene of an episode, its random bodies among the obstacles.

    Parameters
    ----------
    scene, arm : Scene and Arm
        The scene, and the arm where it stands.
    start, goal : ndarray, shape (n_joints,) and (goal_width,)
        Where the episode starts [rad or m], and its goal [m].
    """
    if not scene.random_bodies:
        return scene
    draws = SceneDraws.of(scene)
    (rows,) = drawn_rows(scene, draws, arm.chain, start[None], goal[None, :3].copy(), threads=1)
    fixed = len(scene.obstacles)
    slots = [body for each in scene.random_bodies for body in each.slots]
    placed = zip(slots, rows[fixed : fixed + len(slots)], strict=True)
    bodies = [_moved(body, row) for body, row in placed if row[15] != PARKED[2]]
    return replace(scene, obstacles=(*scene.obstacles, *bodies), random_bodies=())


def _moved(body: Body, row: Array) -> Body:
    """A body with the size and the pose of a row."""
    x, y, z, radius = row[:4].tolist()
    size = {
        "box": (2 * x, 2 * y, 2 * z),
        "sphere": (radius,),
        "capsule": (radius, 2 * z),
        "cylinder": (x, 2 * z),
        "mesh": (),
    }[body.shape]
    turn = tuple(quaternion_of(row[4:13].reshape(3, 3)).tolist())
    return replace(body, size=size, position=tuple(row[13:].tolist()), quaternion=turn)


class EpisodePlants:
    """Draws the plants of episodes.

    Attributes
    ----------
    width, rows : int
        Numbers of a plant, and rows of its state; zero if it is ideal.
    """

    def __init__(self, problem: ReachProblem, step_limit: Array) -> None:
        plant, self._n_actions = problem.plant, len(step_limit)
        ranges = np.array([plant.range_of(name) for name in RANGES], dtype=np.float64)
        self._draws = ranges, problem.stepping.time_step / SUBSTEPS
        self.width = 0 if plant.ideal else plant_width(self._n_actions)
        self.rows = 0 if plant.ideal else FORMER + int(plant.range_of("delay")[1])

    def of(self, starts: Array, goals: Array, threads: int) -> Array:
        """Numbers of plants, shape (n, width).

        Takes starts, shape (n, n_joints) [rad or m], goals, shape (n, goal_width), of which all
        numbers count, and the number of threads.
        """
        n, bits = len(starts), bits_of(starts, goals)
        plants = np.empty((n, self.width))
        run_rows(draw_plants, n, n, threads, *self._draws, bits, plants)
        return plants

    def at_rest(self, plants: Array, q: Array) -> Array:
        """States in which arms rest, shape (n, rows, n_actions).

        Takes numbers of plants, shape (n, width), and joint positions, shape (n, n_joints) [rad or
        m].
        """
        if not self.width:
            return np.zeros((0, 0, self._n_actions))
        calibration = plants[:, OFFSETS + self._n_actions : OFFSETS + 2 * self._n_actions]
        commands = q[:, : self._n_actions] - calibration
        drive = np.repeat(commands[:, None], self.rows, axis=1)
        drive[:, VELOCITY] = 0.0
        return drive
