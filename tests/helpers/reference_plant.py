"""The slow reference of a plant: the joints of one episode, step by step in NumPy."""

import numpy as np

from kinarm.kernels.compiling import Array
from kinarm.kernels.plant import GOAL_NOISE, HIGH_BITS, MOST_CHANGE, OFFSETS, RATE, SERVO, SUBSTEPS
from kinarm.world import World

WORD = 2**64


class ReferencePlant:
    """The joints of an episode; only what is drawn comes from kernels.

    Parameters
    ----------
    world : World
        World of the problem.
    start, goal : ndarray, shape (n_joints,) and (goal_width,)
        Start configuration [rad or m] and first goal.
    """

    def __init__(self, world: World, start: Array, goal: Array) -> None:
        self._arm, self._limit = world.arm, world.rules.step_limit
        n = len(self._limit)
        self._commanded = world.rules.commanded == 1
        self._velocity = np.zeros(n)
        self._numbers = numbers = np.zeros(0)
        self._calibration = self._bias = np.zeros(n)
        if world.plants.width:
            self._numbers = numbers = world.plants.of(start[None], goal[None], 1)[0]
            self._bias, self._calibration = numbers[OFFSETS : OFFSETS + 2 * n].reshape(2, n)
        self._part = world.problem.stepping.time_step / SUBSTEPS
        self._commands = [start[:n] - self._calibration]

    def moved(self, q: Array, action: Array) -> Array:
        """Joint positions at the end of a step [rad or m]."""
        n, target = len(self._limit), q.copy()
        command = self._commands[-1] + action * self._limit
        command = np.clip(command, self._arm.lower[:n], self._arm.upper[:n])
        if not len(self._numbers):
            self._commands, target[:n] = [command], command
            return target
        delay, resolution = self._numbers[:2]
        if resolution > 0:
            command = np.round(command / resolution) * resolution
        self._commands.append(command)
        told = self._commands[max(-1 - int(delay), -len(self._commands))] + self._calibration
        for axis in range(n):
            target[axis] = self._moved_joint(axis, q[axis], told[axis])
        return target

    def _moved_joint(self, axis: int, start: float, told: float) -> float:
        servo = self._numbers[SERVO : SERVO + 4].reshape(2, 2)
        most_change, trapeze = self._numbers[MOST_CHANGE:RATE]
        q, part, limit = start, self._part, self._limit[axis]
        lower, upper = self._arm.lower[axis], self._arm.upper[axis]
        for _ in range(SUBSTEPS):
            velocity = self._velocity[axis]
            exact = told + servo[0] @ (q - told, velocity)
            error = q - told
            wanted, most = servo[1] @ (error, velocity), limit / (SUBSTEPS * part)
            free = wanted - velocity
            change = np.clip(wanted, -most, most) - velocity
            change = np.clip(change, -most_change, most_change)
            self._velocity[axis] += change
            way = part * (self._velocity[axis] - trapeze * change)
            q = np.clip(exact if change == free else q + way, lower, upper)
            if not lower < q < upper:
                self._velocity[axis] = 0.0
        return float(np.clip(q, start - limit, start + limit))

    def seen(self, q: Array, goal: Array, step: int) -> tuple[Array, Array]:
        """Joint positions [rad or m] and goal [m] as they are seen after so many steps."""
        n, seen, aim = len(self._limit), q.copy(), goal.copy()
        if not len(self._numbers):
            return seen, aim
        noise = np.array([self._normal(1 + step * (n + 3) + i) for i in range(n + 3)])
        by_joint, by_goal = self._numbers[GOAL_NOISE - 1 : GOAL_NOISE + 1]
        seen[:n] += self._bias - self._calibration + by_joint * noise[:n]
        if self._commanded:
            seen[:n] = self._commands[-1]
        aim[:3] += self._numbers[OFFSETS + 2 * n :] + by_goal * noise[n:]
        return seen, aim

    def commanded(self, q: Array) -> Array:
        """Joint positions that were last commanded [rad or m]."""
        return np.concatenate([self._commands[-1], q[len(self._limit) :]])

    def _normal(self, count: int) -> float:
        """Nearly normal number, by SplitMix64: the sum of four."""
        high, low = self._numbers[HIGH_BITS : HIGH_BITS + 2]
        bits = ((int(high) << 32) + int(low) + count * 0x9E3779B97F4A7C15) % WORD
        for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
            bits = (bits ^ (bits >> shift)) * factor % WORD
        bits ^= bits >> 31
        total = sum((bits >> 16 * k) % 2**16 for k in range(4))
        return float(np.sqrt(3) * ((total + 2) / 2**16 - 2))
