"""kinarm: learn to reach with a simulated six-axis arm, and know how good the result is."""

from pathlib import Path
from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports
from kinarm.envs.registration import register_environments

if TYPE_CHECKING:
    from kinarm.arm import Arm, ArmSpecification
    from kinarm.envs import ReachEnv, ReachVectorEnv
    from kinarm.errors import (
        ArmError,
        InvalidInputError,
        KinarmError,
        MissingExtraError,
        OutputError,
        PolicyFileError,
        ProblemError,
        RecordingFileError,
        StartInContactError,
        UnknownNameError,
        WorkerError,
    )
    from kinarm.networks import CompiledPolicy, Mirror, Networks
    from kinarm.problem import PROBLEMS, ReachProblem, Stepping
    from kinarm.reference import ReferenceSimulator
    from kinarm.replay import Replay
    from kinarm.rollouts import Rollouts, StepResult
    from kinarm.scene import GoalRegion, Obstacle, Scene
    from kinarm.simulator import Simulator
    from kinarm.task import REWARD_TERMS, ReachTask, RewardWeights
    from kinarm.trajectory import Recording, load_recordings, save_recordings
    from kinarm.urdf import arm_names
    from kinarm.world import World

__version__ = "0.1.0"

__all__ = [
    "PROBLEMS",
    "REWARD_TERMS",
    "Arm",
    "ArmError",
    "ArmSpecification",
    "CompiledPolicy",
    "GoalRegion",
    "InvalidInputError",
    "KinarmError",
    "Mirror",
    "MissingExtraError",
    "Networks",
    "Obstacle",
    "OutputError",
    "PolicyFileError",
    "ProblemError",
    "ReachEnv",
    "ReachProblem",
    "ReachTask",
    "ReachVectorEnv",
    "Recording",
    "RecordingFileError",
    "ReferenceSimulator",
    "Replay",
    "RewardWeights",
    "Rollouts",
    "Scene",
    "Simulator",
    "StartInContactError",
    "StepResult",
    "Stepping",
    "UnknownNameError",
    "WorkerError",
    "World",
    "__version__",
    "arm_names",
    "load_recordings",
    "save_recordings",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "arm": ("Arm", "ArmSpecification"),
        "envs": ("ReachEnv", "ReachVectorEnv"),
        "errors": (
            "ArmError",
            "InvalidInputError",
            "KinarmError",
            "MissingExtraError",
            "OutputError",
            "PolicyFileError",
            "RecordingFileError",
            "ProblemError",
            "StartInContactError",
            "UnknownNameError",
            "WorkerError",
        ),
        "networks": ("CompiledPolicy", "Mirror", "Networks"),
        "problem": ("PROBLEMS", "ReachProblem", "Stepping"),
        "reference": ("ReferenceSimulator",),
        "replay": ("Replay",),
        "rollouts": ("Rollouts", "StepResult"),
        "scene": ("GoalRegion", "Obstacle", "Scene"),
        "simulator": ("Simulator",),
        "task": ("REWARD_TERMS", "ReachTask", "RewardWeights"),
        "trajectory": ("Recording", "load_recordings", "save_recordings"),
        "urdf": ("arm_names",),
        "world": ("World",),
    },
)

register_environments()

_root = Path(__file__).resolve().parent.parent
if (_root / "pyproject.toml").is_file():
    # In a clone the sub-packages lie beside this folder, whatever is installed.
    __path__.append(str(_root))
