"""The check of a contract: whether an arm counts and moves its joints as the contract has it.

What readings and commands have in common, such as a wrong sign of both, shows against a known pose
alone. So the check begins where somebody has put the arm, and moves nothing unless it reads what is
there.
"""

import numpy as np

from kinarm.errors import InvalidInputError
from kinarm.kernels.compiling import Array
from kinarm.policies.running.backend import WiredArm
from kinarm.world import World

PLACED, MOVE, STAYS = 0.1, 0.1, 0.03
"""How closely the arm has to be at the pose, how far joints are moved, and what counts as a move
where there should be none [rad or m]."""

OFF, LAG = 0.08, 0.4
"""Error of a joint's way, as a share, and mean time behind a command [s], that are too much."""

SPEED, REST = 0.1, 1.5
"""Share of the joints' speeds at which they move, and time until they have arrived [s]."""

READINGS, NEARBY = 20, 500
"""Readings that are averaged, and configurations around the pose that must be free."""


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
        If the pose is beyond the limits, or the arm would touch something around it.
    """

    def __init__(
        self, arm: WiredArm, world: World, at: Array | None = None, rate: float = 50.0
    ) -> None:
        self.arm, self.rate, self._names = arm, rate, np.array(world.arm.joint_names)
        pose, n = world.arm.home if at is None else at, world.n_actions
        self.pose = world.arm.chain.within_limits("the pose", pose, world.arm.joint_names)
        off = np.random.default_rng(0).uniform(-PLACED - MOVE, PLACED + MOVE, (NEARBY, n))
        around = np.tile(self.pose, (NEARBY, 1))
        around[1:, :n] += off[1:]
        if (touching := world.in_contact(around)).any():
            met = " touches ".join(world.contact_pair(around[touching.argmax()]) or ("it", "?"))
            raise InvalidInputError(f"the pose of the check is too narrow: around it, {met}")
        middle = 0.5 * (world.arm.lower + world.arm.upper)[:n]
        self._moves = np.where(self.pose[:n] < middle, MOVE, -MOVE)
        fastest = SPEED * float(world.arm.velocity_limits[:n].min())
        self._ramp = np.linspace(0.0, 1.0, 2 + round(MOVE / fastest * rate))[1:, None]

    def run(self) -> list[str]:
        """Check the arm; what is wrong, a line each, and nothing if all is well.

        Raises RunStoppedError if the arm does not answer.
        """
        with self.arm.connected(self.rate):
            return self._misplaced() or self._restless() or self._moved_wrongly()

    def unseen(self) -> list[str]:
        """What both ways may have wrong without its showing at the pose, a line each."""
        pose, names = self.pose[: len(self._moves)], self._names[: len(self._moves)]
        apart = np.abs(pose[:, None] - pose[None]) + np.diag(np.full(len(pose), np.inf))
        near, alike = np.abs(pose) < 2.0 * PLACED, apart.min(axis=1) < 2.0 * PLACED
        told = {"sign or scale, if wrong both ways, of": near, "order of": alike}
        return [f"{what} {', '.join(names[which])}" for what, which in told.items() if which.any()]

    def _misplaced(self) -> list[str]:
        """Joints that do not read what they have at the pose."""
        readings = []
        for _ in range(READINGS):
            readings.append(self.arm.read())
            self.arm.wait(self.arm.now() + 1.0 / self.rate)
        self._held, lines = np.mean(readings, axis=0), list[str]()
        for joint, way in enumerate((self._held - self.pose)[: len(self._moves)]):
            if abs(way) > PLACED:
                found, pose = self._held[joint], self.pose[joint]
                there = self._names[np.abs(self.pose - found) < PLACED]
                why = "its offset, scale or sign"
                if abs(found + pose) < PLACED:
                    why = "its sign"
                elif 0.0 < 40.0 * min(abs(found), abs(pose)) < max(abs(found), abs(pose)):
                    why = "degrees or radians, or its offset"
                elif len(there):
                    why = f"its offset, or the order, for {' or '.join(there)} is there"
                lines.append(f"{self._names[joint]} reads {found:.3f}, and is at {pose:.3f}: {why}")
        return lines

    def _restless(self) -> list[str]:
        """A joint that moves when it is told to stay where it reads, if any."""
        for _ in range(round(REST * self.rate)):
            moved = np.abs(self.arm.followed(self._held[None])[0] - self._held)[: len(self._moves)]
            if (moved > STAYS).any():
                joint = int(moved.argmax())
                said = f"{self._names[joint]} moves by {moved[joint]:.3f} when it is told to stay"
                return [f"{said}: commands have another sign, offset, scale or order"]
        return []

    def _moved_wrongly(self) -> list[str]:
        """The first joint that answers otherwise than it is told, if any."""
        rest = max(READINGS, round(REST * self.rate))
        for joint, way in enumerate(self._moves):
            home = self.arm.followed(np.tile(self._held, (READINGS, 1))).mean(axis=0)
            step = way * (np.arange(len(home)) == joint)
            told = np.concatenate([home + self._ramp * step, np.tile(home + step, (rest, 1))])
            seen = self.arm.followed(told)
            answer = (seen[-READINGS:].mean(axis=0) - home)[: len(self._moves)]
            lag = float((told - seen)[:, joint].sum()) / way / self.rate
            if wrong := self._wrong(joint, way, answer, lag):
                return [wrong]
            self.arm.followed(home + self._ramp[::-1] * step)
            self.arm.followed(np.tile(self._held, (rest, 1)))
        return []

    def _wrong(self, joint: int, way: float, answer: Array, lag: float) -> str:
        """What is wrong with the joints' answer to the move of one; nothing if all is well."""
        name, share = self._names[joint], answer[joint] / way
        others = (np.abs(answer) > STAYS) & (np.arange(len(answer)) != joint)
        said = f"{name} is told to move by {way:.3f}, and reads {answer[joint]:.3f}"
        if others.any():
            return f"{said}; {', '.join(self._names[: len(answer)][others])} moves: the order"
        if abs(share) < 0.01:
            return f"{said}: its reading is stale, or it does not move"
        if abs(share - 1.0) > OFF:
            return f"{said}: its {'sign' if abs(share + 1.0) < 0.3 else 'scale'}"
        return f"{name} reads what it had {lag:.2f} s before: stale" if lag > LAG else ""
