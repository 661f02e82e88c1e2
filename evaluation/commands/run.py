"""``kinarm-run``: drive an arm by a policy, and check an arm against its contract."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from kinarm._command_line import run_request
from kinarm._files import check_output
from kinarm._interrupts import telling
from kinarm.errors import (
    FROM_ZERO,
    POSITIVE,
    POSITIVE_SHARE,
    InvalidInputError,
    RunStoppedError,
)
from kinarm.policies.running.watchdog import SafeLimits
from kinarm.problem_options import ProblemOptions

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy
    from kinarm.policies.running.backend import WiredArm
    from kinarm.policies.running.run import Run
    from kinarm.simulator import Simulator


@dataclass(frozen=True, kw_only=True)
class ArmOptions(ProblemOptions):
    """Which arm, and by which policy or contract.

    Parameters
    ----------
    policy : str
        The policy: its name, a file, or a folder of kinarm-export.
    backend : {"fake", "mujoco", "ur", "lerobot"}
        The arm: in a simulation, of Universal Robots, or an SO-101 of LeRobot.
    address : str
        Host name of the arm's controller, or its serial port.
    rate : float
        Commands per second [Hz].
    """

    policy: str = field(metadata={"flag": "policy", "metavar": "POLICY"})
    backend: Literal["fake", "mujoco", "ur", "lerobot"]
    address: str | None = None
    rate: float | None = field(default=None, metadata=POSITIVE)

    DEFAULTS: ClassVar = {
        **ProblemOptions.DEFAULTS,
        "problem": "what the policy was trained for",
        "plant": "ideal; a real arm has its own",
        "feedback": "commanded",
        "rate": "what the arm wants, or the policy's",
    }

    def faced(self) -> "tuple[Policy, Simulator, Mapping[str, Any] | None]":
        """Policy, simulator without a plant, and the contract's signs and offsets, if any."""
        from kinarm.evaluation.finding import find_contestants
        from kinarm.policies.export import load_wiring
        from kinarm.simulator import Simulator

        folder = Path(self.policy)
        wiring = load_wiring(folder) if (folder / "contract.json").is_file() else None
        name = folder / "policy.npz" if wiring else self.policy
        ideal = replace(self, plant="ideal", feedback=None)
        stated = ideal.resolve() if self.problem or self.task else None
        contestant = find_contestants(name, stated)[0]
        if contestant.policy is None:
            raise InvalidInputError(f"{self.policy!r} is no trained policy")
        problem = stated or ideal.resolve(contestant.problem or "right")
        simulator = Simulator(problem, threads=1)
        contestant.check(problem, simulator.arm)
        return contestant.policy, simulator, wiring

    def arm_of(
        self, simulator: "Simulator", wiring: Mapping[str, Any] | None, start: Any
    ) -> "WiredArm":
        """The arm, by its contract; a simulated one rests at a start, and counts as the model."""
        from kinarm.plant import Plant
        from kinarm.policies.running.backend import WiredArm
        from kinarm.policies.running.fake import FakeArm
        from kinarm.policies.running.mujoco_arm import BANDWIDTH, MujocoArm
        from kinarm.policies.running.so_arm import SOArm
        from kinarm.policies.running.ur import URArm

        world, plant = simulator.world, Plant.load(self.plant or "ideal")
        if self.backend == "fake":
            return WiredArm(FakeArm(world, start, plant=plant), world)
        if self.backend == "mujoco":
            bandwidth = plant.range_of("bandwidth")[0] or BANDWIDTH
            return WiredArm(MujocoArm(world, start, bandwidth), world)
        if self.address is None or self.plant is not None:
            raise InvalidInputError(f"--backend {self.backend} needs --address, and has no --plant")
        make = URArm if self.backend == "ur" else SOArm
        return WiredArm(make(self.address), world, wiring)


@dataclass(frozen=True, kw_only=True)
class RunRequest(ArmOptions):
    """Drive an arm to goals by a policy, behind a shield and a watchdog.

    Parameters
    ----------
    goal : tuple of float
        A goal, as in the contract: position x y z [m], and its rest; repeatable.
    trials : int
        Without --goal, draw so many goals of the task.
    seed : int
        Seed of the goals, and of a simulated arm's start.
    speed : float
        Share of the speed of the training.
    shield : bool
        Replace steps that would touch something.
    watchdog : SafeLimits
        What stops the run.
    record : Path
        Write what the joints did, for kinarm-replay (.npz).
    overwrite : bool
        Replace an earlier recording.
    """

    goal: tuple[float, ...] = ()
    trials: int = 5
    seed: int = field(default=0, metadata=FROM_ZERO)
    speed: float = field(default=0.2, metadata=POSITIVE_SHARE)
    shield: bool = True
    watchdog: SafeLimits = field(default_factory=SafeLimits)
    record: Path | None = None
    overwrite: bool = False

    GROUPS: ClassVar = {
        "the arm": "policy backend address rate speed watchdog",
        "goals": "goal trials seed",
        "output": "record overwrite",
        **ProblemOptions.GROUPS,
    }


@dataclass(frozen=True, kw_only=True)
class CheckRequest(ArmOptions):
    """Move each joint a little and back, and say what is not as the contract has it.

    Parameters
    ----------
    at : tuple of str
        Where somebody has put the arm: home, or the joints' positions [rad or m].
    """

    at: tuple[str, ...] = field(default=("home",), metadata={"metavar": "home|Q"})


def _drive(request: RunRequest, _: str) -> None:
    """Run a policy; print how each goal went, and keep what was recorded."""
    import numpy as np

    from kinarm.policies.running.run import Run

    if request.record is not None:
        check_output(request.record, overwrite=request.overwrite, suffix=".npz")
    policy, simulator, wiring = request.faced()
    simulator = simulator.shielded(request.shield)
    starts, goals = simulator.sample(np.random.default_rng(request.seed), request.trials)
    if request.goal:
        width = simulator.world.goal_width
        if len(request.goal) % width:
            raise InvalidInputError(f"a goal is {width} numbers, got {len(request.goal)}")
        goals = np.reshape(request.goal, (-1, width))
    run = Run(
        request.arm_of(simulator, wiring, starts[0]),
        policy,
        simulator,
        speed=request.speed,
        rate=request.rate,
        measured=request.feedback == "measured",
        limits=request.watchdog,
        name=Path(request.policy).stem,
    )
    try:
        with telling(lambda: f"interrupted; {str(sys.exc_info()[1]) or 'the arm rests'}"):
            run.to_goals(goals)
    finally:
        _report(request.record, run)


def _report(out: Path | None, run: "Run") -> None:
    """Print what was done, and keep it."""
    import numpy as np

    from kinarm.recording import save_recordings

    for each in run.recordings:
        place, told = ", ".join(f"{value:.3f}" for value in each.goal), each.provenance
        print(
            f"goal {each.trial + 1} ({place}): {told['ended']}, {each.final_distance:.3f} m from it"
            f" after {each.steps} steps, {told['interventions']} replaced"
        )
    if run.latencies:
        half, most = (1e3 * np.percentile(run.latencies, share) for share in (50, 99))
        print(
            f"{len(run.latencies)} cycles at {run.rate:g} Hz, {run.parts} a step: {half:.2g} ms in "
            f"the median, {most:.2g} ms at the 99th percentile"
        )
    if run.recordings and out is not None:
        save_recordings(out, run.recordings)
        print(f"written: {out}; kinarm-replay {out} shows it")


def _check(request: CheckRequest, _: str) -> None:
    """Check an arm against its contract."""
    from kinarm.errors import finite_array
    from kinarm.policies.running.check import ContractCheck

    simulator, wiring = request.faced()[1:]
    pose = simulator.arm.home
    if request.at != ("home",):
        pose = finite_array("--at", request.at, pose.shape)
    arm = request.arm_of(simulator, wiring, pose)
    rate = request.rate or arm.backend.rate or 1.0 / simulator.problem.stepping.time_step
    check = ContractCheck(arm, simulator.world, pose, rate)
    wrong = check.run()
    for line in wrong:
        print(line)
    if wrong:
        raise RunStoppedError(f"{len(wrong)} of the arm's joints are not as the contract has them")
    print("passed: joints read what they have at the pose, and move as they are told")
    for line in check.unseen():
        print(f"not seen at this pose: {line}")


OTHERS = {"check": (CheckRequest, _check)}

main = partial(run_request, "kinarm-run", RunRequest, _drive, others=OTHERS)
"""Run the command line."""
