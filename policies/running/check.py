"""The check of a contract: whether an arm counts and moves its joints as the contract has it.

What readings and commands have in common, such as a wrong sign of both, shows against a known pose
alone. So the check begins where somebody has put the arm, and moves nothing unless it reads what is
there.
"""

import numpy as np

from kinarm.chain import within_limits
from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import Array
from kinarm.policies.running.backend import WiredArm
from kinarm.world import World

PLACED = 0.1
"""How closely the arm has to be put at the pose [rad or m]."""

MOVE = 0.1
"""Way that each joint moves [rad or m]."""

SPEED = 0.1
"""Share of the joints' speeds that it moves with."""

STAYS = 0.03
"""Way of a joint that is told to stay, or another one moves, that counts as a move [rad or m]."""

OFF = 0.08
"""Error of a joint's way that counts, as a share of it."""

NEARBY = 500
"""Configurations around the pose that must be free."""

READINGS = 20
"""Readings of a resting arm that are averaged."""

LAG = 0.4
"""Mean time by which readings are behind commands that counts as stale [s]."""

REST, LONGEST_REST = 0.3, 3.0
"""Time after a command until the arm is read, and at most until it has arrived [s]."""

DEGREES = 180.0 / np.pi


class ContractCheck:
    """Moves each joint a little and back, and compares what is read with what is expected.

    Parameters
    ----------
    arm : WiredArm
        The arm by its contract, not yet connected.
    world : World
        Arm and scene of the contract.
    at : ndarray, shape (n_joints,), optional
        Where somebody has put the arm [rad or m]; home by default.
    rate : float
        Commands per second [Hz].

    Raises
    ------
    InvalidInputError
        If the pose is beyond the limits, or the arm would touch something there.
    """

    def __init__(
        self, arm: WiredArm, world: World, at: Array | None = None, rate: float = 50.0
    ) -> None:
        self.arm, self.rate, self._names = arm, rate, world.arm.joint_names
        pose = world.arm.home if at is None else at
        self.pose = within_limits("the pose", pose, world.arm.chain, self._names)
        self._n = world.n_actions
        off = np.random.default_rng(0).uniform(-PLACED - MOVE, PLACED + MOVE, (NEARBY, self._n))
        around = np.tile(self.pose, (NEARBY, 1))
        around[1:, : self._n] += off[1:]
        if (touching := world.in_contact(around)).any():
            pair = world.contact_pair(around[touching.argmax()])
            met = " touches ".join(pair or ("it", "something"))
            raise InvalidInputError(f"the pose of the check is too narrow: around it, {met}")
        self._moves = np.array([self._move(world, joint) for joint in range(self._n)])
        self._step = SPEED * world.arm.velocity_limits[: self._n].min() / rate

    def _move(self, world: World, joint: int) -> float:
        """Way of a joint towards the middle of its range [rad or m]."""
        below, above = world.arm.lower[joint], world.arm.upper[joint]
        return MOVE if 2.0 * self.pose[joint] < below + above else -MOVE

    def run(self) -> list[str]:
        """Check the arm; what is wrong, a line each, and nothing if all is well.

        Raises RunStoppedError if the arm does not answer.
        """
        with self.arm.connected(self.rate):
            return self._misplaced() or self._restless() or self._moved_wrongly()

    def unseen(self) -> list[str]:
        """What both ways may have wrong without its showing at the pose, a line each."""
        pose, names = self.pose[: self._n], self._names
        near = [
            name for name, zero in zip(names, np.abs(pose) < 2.0 * PLACED, strict=False) if zero
        ]
        apart = np.abs(pose[:, None] - pose[None]) + np.diag(np.full(self._n, np.inf))
        alike = [names[joint] for joint in np.flatnonzero(apart.min(axis=1) < 2.0 * PLACED)]
        told = {"sign or scale, if wrong both ways, of": near, "order of": alike}
        return [f"{what} {', '.join(which)}" for what, which in told.items() if which]

    def _misplaced(self) -> list[str]:
        """Joints that do not read what they have at the pose."""
        reading = self._averaged()
        wrong = np.flatnonzero(np.abs(reading - self.pose)[: self._n] > PLACED)
        return [
            f"{self._names[joint]} reads {reading[joint]:.3f}, and is at {self.pose[joint]:.3f}: "
            f"{self._guess(int(joint), reading, self.pose)}"
            for joint in wrong
        ]

    def _guess(self, joint: int, found: Array, expected: Array) -> str:
        """What may be wrong, where a joint has one value instead of another."""
        value, meant = found[joint], expected[joint]
        others = np.flatnonzero(np.abs(np.delete(expected, joint) - value) < PLACED)
        if abs(meant) > PLACED and abs(value + meant) < PLACED:
            return "its sign"
        if abs(meant) > 0.01 and abs(value / (meant * DEGREES) - 1.0) < 0.2:
            return "it counts in degrees"
        if abs(meant) > 0.01 and abs(value * DEGREES / meant - 1.0) < 0.2:
            return "it is taken to count in degrees"
        if len(others):
            names = np.delete(self._names, joint)[others]
            return f"its offset, or the order: {' or '.join(names)} is there"
        return "its offset, scale or sign"

    def _restless(self) -> list[str]:
        """Joints that move when they are told to stay where they read."""
        held = self._averaged()
        for _ in range(round(REST * self.rate)):
            self._cycle(held)
            moved = np.abs(self.arm.read() - held)[: self._n]
            if (moved > STAYS).any():
                self.arm.stop()
                joint = int(moved.argmax())
                return [
                    f"{self._names[joint]} moves by {moved[joint]:.3f} when it is told to stay "
                    f"where it reads: commands have another sign, offset, scale or order"
                ]
        return []

    def _moved_wrongly(self) -> list[str]:
        """Joints that answer otherwise than they are told."""
        for joint, way in enumerate(self._moves):
            home = self._averaged()
            there = home.copy()
            there[joint] += way
            (gone, lag), (back, _) = self._went(home, there), self._went(there, home)
            wrong = self._answer(joint, way, (gone - home)[: self._n], (back - home)[: self._n])
            if not wrong and lag[joint] > LAG * abs(way):
                late = lag[joint] / abs(way)
                wrong = [f"{self._names[joint]} reads what it had {late:.2f} s before: stale"]
            if wrong:
                return wrong
        return []

    def _answer(self, joint: int, way: float, answer: Array, back: Array) -> list[str]:
        """What is wrong with a joint's answer to a way there and back."""
        name, share = self._names[joint], answer[joint] / way
        others = np.flatnonzero(np.abs(np.delete(answer, joint)) > STAYS)
        moved = ", ".join(np.delete(np.array(self._names[: self._n]), joint)[others])
        said = f"{name} is told to move by {way:.3f}, and reads {answer[joint]:.3f}"
        if moved:
            return [f"{said}; {moved} moves: the order of joints"]
        if abs(share) < 0.01 or abs(answer[joint]) < 1e-9:
            return [f"{said}: its reading is stale, or it does not move"]
        if abs(share + 1.0) < 4.0 * OFF:
            return [f"{said}: its sign"]
        if abs(share - 1.0) > OFF:
            return [f"{said}: its scale, or degrees for radians"]
        if np.abs(back).max() > STAYS:
            joint = int(np.abs(back).argmax())
            return [f"{self._names[joint]} is back {back[joint]:.3f} off: stale, or it slips"]
        return []

    def _went(self, start: Array, end: Array) -> tuple[Array, Array]:
        """Where the arm is after a slow way between positions, and how far it was behind.

        That is summed over time, shape (n_joints,) [rad s or m s].
        """
        cycles = max(1, int(np.ceil(np.abs(end - start).max() / self._step)))
        behind = np.zeros(len(end))
        resting = round(REST * self.rate)
        before = np.full(len(end), np.inf)
        for cycle in range(1, cycles + 1):
            told = start + (end - start) * cycle / cycles
            self._cycle(told)
            behind = behind + (told - self.arm.read()) * np.sign(end - start)
        for _ in range(round(LONGEST_REST / REST)):
            for _ in range(resting):
                self._cycle(end)
                behind = behind + (end - self.arm.read()) * np.sign(end - start)
            reading = self._averaged(end)
            if np.abs(reading - before).max() < 0.02 * MOVE:
                break
            before = reading
        return reading, behind / self.rate

    def _averaged(self, held: Array | None = None) -> Array:
        """Mean of readings of a resting arm, shape (n_joints,) [rad or m]."""
        readings = []
        for _ in range(READINGS):
            readings.append(self.arm.read())
            self._cycle(held)
        return np.asarray(np.mean(readings, axis=0))

    def _cycle(self, told: Array | None) -> None:
        if told is not None:
            self.arm.command(told)
        self.arm.wait(self.arm.now() + 1.0 / self.rate)
