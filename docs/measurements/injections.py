"""The check of contracts against arms with errors: which are caught, and whether any is imagined.

``python -m docs.measurements.injections data/results/contract`` writes ``injections.json``, from
which ``docs/tables.py`` makes the table of *Run it on an arm*.
"""

import argparse
import json
from collections import Counter, deque
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kinarm import Plant, ReachProblem, Scene
from kinarm.errors import InvalidInputError, RunStoppedError
from kinarm.kernels.compiling import Array
from kinarm.policies.running.backend import WiredArm
from kinarm.policies.running.check import ContractCheck
from kinarm.policies.running.fake import FakeArm
from kinarm.world import World

PLANT = Plant(delay=(0, 2), bandwidth=(1.6, 20.0), noise=(1e-4, 2e-3))
"""Lag and noise of real arms."""

KINDS = ("order", "sign", "offset", "scale", "degrees", "stale")
PLACES = ("reading", "command", "both")

SEEN = 0.15
"""Least error at the pose, of those that readings and commands share [rad or m]."""

PLACING = 0.03
"""How far from the pose somebody puts the arm, at most [rad or m]."""


Distortion = Callable[[Array], Array]
"""From joint positions to other ones, shape (n_joints,) [rad or m]."""


class FaultyArm(FakeArm):
    """A fake arm with errors on purpose: what becomes of its readings and commands."""

    def __init__(
        self,
        world: World,
        start: Array,
        *,
        plant: Plant | str = "ideal",
        reads: Distortion = np.copy,
        takes: Distortion = np.copy,
    ) -> None:
        super().__init__(world, start, plant=plant)
        self.reads, self.takes = reads, takes

    def read(self) -> Array:
        """What becomes of the joint positions."""
        return self.reads(super().read())

    def command(self, positions: Array) -> None:
        """Send the joints to what becomes of the command."""
        super().command(self.takes(positions))


class Injection(NamedTuple):
    """What becomes of an arm's readings and commands."""

    reads: Distortion
    takes: Distortion


def injection(rng: np.random.Generator, kind: str, place: str, pose: Array, n: int) -> Injection:
    """Draw an error of a kind; one of both ways shows at the pose."""
    while True:
        forth, back = distortions(rng, kind, len(pose), n)
        if place != "both" or np.abs(forth(pose) - pose)[:n].max() > SEEN:
            break
    reads = np.copy if place == "command" else forth
    takes = {"reading": np.copy, "command": forth, "both": back}[place]
    return Injection(reads, takes)


def distortions(
    rng: np.random.Generator, kind: str, n_joints: int, n: int
) -> tuple[Distortion, Distortion]:
    """An error of joint positions, and what undoes it."""
    joint, other = rng.choice(n, 2, replace=False)
    factor, shift, order = np.ones(n_joints), np.zeros(n_joints), np.arange(n_joints)
    if kind == "stale":
        held: deque[Array] = deque(maxlen=int(rng.choice([40, 150, 10**6])))

        def late(positions: Array) -> Array:
            held.append(positions)
            seen = positions.copy()
            joints = slice(None) if held.maxlen and held.maxlen > 100 else [joint]
            seen[joints] = held[0][joints]
            return seen

        return late, np.copy
    if kind == "order":
        order[[joint, other]] = other, joint
    elif kind == "sign":
        factor[joint] = -1.0
    elif kind == "offset":
        shift[joint] = rng.choice([-1, 1]) * rng.uniform(0.15, 2.0)
    elif kind == "scale":
        factor[joint] = rng.choice([rng.uniform(0.4, 0.88), rng.uniform(1.12, 2.0)])
    else:
        factor[: n if rng.random() < 0.5 else None] = np.rad2deg(1.0) ** rng.choice([-1, 1])
    undone = np.argsort(order)
    return (
        lambda positions: (positions * factor + shift)[order],
        lambda positions: (positions[undone] - shift) / factor,
    )


def draw_pose(rng: np.random.Generator, world: World) -> Array:
    """A pose at which joints are distinct and away from zero."""
    arm, n = world.arm, world.n_actions
    lower, upper = np.maximum(arm.lower[:n], -2) + 0.2, np.minimum(arm.upper[:n], 2) - 0.2
    while True:
        pose = arm.home.copy()
        pose[:n] = rng.uniform(lower, upper)
        apart = np.abs(pose[:n, None] - pose[None, :n]) + np.eye(n)
        if np.abs(pose[:n]).min() > 0.25 and apart.min() > 0.25:
            return pose


def measure(arm: str, count: int, clean: int, seed: int = 0) -> dict[str, Any]:
    """Check an arm with so many errors, and without any."""
    scene = Scene(obstacles=(), ground=False)
    world = World(ReachProblem.load("both").replace(arm=arm, scene=scene))
    rng, n = np.random.default_rng(seed), world.n_actions
    fake, tally = FaultyArm(world, world.arm.home, plant=PLANT), Counter[str]()
    missed, imagined = list[str](), list[str]()
    kinds = [each for each in product(KINDS, PLACES) if "stale" not in each or "reading" in each]
    while (done := tally.total()) < count + clean:
        pose = draw_pose(rng, world)
        try:
            check = ContractCheck(WiredArm(fake, world), world, pose)
        except InvalidInputError:  # too narrow
            continue
        kind, place = kinds[done % len(kinds)]
        error = injection(rng, kind, place, pose, n)
        if done >= count:
            kind, place, error = "no error", "", Injection(np.copy, np.copy)
        fake.start, (fake.reads, fake.takes) = pose.copy(), error
        fake.start[:n] += rng.uniform(-PLACING, PLACING, n)
        try:
            said = check.run()
        except RunStoppedError as stopped:
            said = [str(stopped)]
        tally[f"{kind}, {place}".rstrip(", ")] += 1
        if done >= count:
            imagined += said
        elif not said:
            missed.append(f"{kind}, {place}")
    return {"arm": arm, "tally": dict(tally), "missed": missed, "imagined": imagined}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=1000)
    given = parser.parse_args()
    rows = []
    for name in ("paper", "ur5", "so101"):
        rows.append(measure(name, given.count, given.count // 4))
        print(rows[-1])
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "injections.json").write_text(json.dumps(rows, indent=1) + "\n")
