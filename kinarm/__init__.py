"""kinarm: learn to reach with a simulated six-axis arm, and know how good the result is."""

from pathlib import Path
from typing import TYPE_CHECKING

from kinarm._exports import lazy_exports
from kinarm.registration import register_environments

if TYPE_CHECKING:
    from kinarm.arm import Arm, arm_names
    from kinarm.env import ReachEnv
    from kinarm.errors import (
        ArmError,
        InvalidInputError,
        KinarmError,
        MissingExtraError,
        OutputError,
        PolicyFileError,
        RecordingFileError,
        SceneError,
        StartInContactError,
        UnknownNameError,
        WorkerError,
    )
    from kinarm.networks import CompiledPolicy, Networks
    from kinarm.recording import Recording, load_recordings, save_recordings
    from kinarm.reference import ReferenceSimulator
    from kinarm.rollouts import Rollouts
    from kinarm.scene import Bench, Scene
    from kinarm.simulator import Simulator, StepResult
    from kinarm.task import TASKS, ReachTask, RewardWeights, load_task
    from kinarm.vector_env import ReachVectorEnv
    from kinarm.viewer import ReplayPage

__version__ = "0.1.0"

__all__ = [
    "TASKS",
    "Arm",
    "ArmError",
    "Bench",
    "CompiledPolicy",
    "InvalidInputError",
    "KinarmError",
    "MissingExtraError",
    "Networks",
    "OutputError",
    "PolicyFileError",
    "ReachEnv",
    "ReachTask",
    "ReachVectorEnv",
    "Recording",
    "RecordingFileError",
    "ReferenceSimulator",
    "ReplayPage",
    "RewardWeights",
    "Rollouts",
    "Scene",
    "SceneError",
    "Simulator",
    "StartInContactError",
    "StepResult",
    "UnknownNameError",
    "WorkerError",
    "__version__",
    "arm_names",
    "load_recordings",
    "load_task",
    "save_recordings",
]


def __dir__() -> list[str]:
    return __all__


__getattr__ = lazy_exports(
    __name__,
    {
        "arm": ("Arm", "arm_names"),
        "env": ("ReachEnv",),
        "errors": (
            "ArmError",
            "InvalidInputError",
            "KinarmError",
            "MissingExtraError",
            "OutputError",
            "PolicyFileError",
            "RecordingFileError",
            "SceneError",
            "StartInContactError",
            "UnknownNameError",
            "WorkerError",
        ),
        "networks": ("CompiledPolicy", "Networks"),
        "reference": ("ReferenceSimulator",),
        "recording": ("Recording", "load_recordings", "save_recordings"),
        "rollouts": ("Rollouts",),
        "scene": ("Bench", "Scene"),
        "simulator": ("Simulator", "StepResult"),
        "task": ("TASKS", "ReachTask", "RewardWeights", "load_task"),
        "viewer": ("ReplayPage",),
        "vector_env": ("ReachVectorEnv",),
    },
)

register_environments()

_root = Path(__file__).resolve().parent.parent
if (_root / "pyproject.toml").is_file():
    # In a clone the sub-packages lie beside this folder, whatever is installed.
    __path__.append(str(_root))
