"""Recordings: what an arm did in one trial, state by state, in files without pickle."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from kinarm._files import CORRUPT, first_line, open_archive, write_atomically
from kinarm._validation import finite_array, whole_number
from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, RecordingFileError
from kinarm.rollouts import Rollouts
from kinarm.scene import Bench, Scene
from kinarm.simulator import Simulator

FILE_FORMAT = "kinarm-recordings"
FILE_VERSION = 1
OUTCOMES = ("success", "collision", "horizon")
ARRAYS = ("states", "distances", "goal", "refused", "contact_point")
"""Fields of a `Recording` that are stored as arrays; the others are stored as JSON."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """What an arm did in one trial. Arrays are copied and read-only.

    Parameters
    ----------
    policy : str
        Name of what drove the arm.
    task : str
        Name of the task.
    trial : int
        Number of the trial in its set.
    arm, arm_digest : str
        The arm: its name, and the hash of what the simulator uses of it.
    scene : Scene
        Where it stood.
    states : ndarray, shape (steps + 1, n_axes)
        Configurations, from the start to the end [rad or m].
    distances : ndarray, shape (steps + 1,)
        Distance from the tool to the goal at each of them [m].
    goal : ndarray, shape (3,)
        Goal position [m].
    outcome : str
        ``"success"``, ``"collision"`` or ``"horizon"``.
    tolerance : float
        The goal counts as reached at this distance or less [m].
    horizon : int
        Steps after which the episode would have been truncated.
    time_step : float
        Duration of a step [s].
    contact : tuple of str, optional
        The two bodies that would have touched, if the last move was refused.
    contact_point : ndarray, shape (3,), optional
        Where they would have touched [m].
    refused : ndarray, shape (n_axes,), optional
        The first configuration of the refused move at which they touch [rad or m].
    steps_lower_bound : int, optional
        Proven: no motion reaches the goal in fewer steps.
    provenance : dict
        Where it comes from, in terms that JSON can hold.

    Raises
    ------
    InvalidInputError
        If shapes do not fit together, an entry is not finite or the outcome is unknown.
    """

    policy: str
    task: str
    trial: int
    arm: str
    arm_digest: str
    scene: Scene = field(default_factory=Scene)
    states: NDArray[np.float64]
    distances: NDArray[np.float64]
    goal: NDArray[np.float64]
    outcome: str
    tolerance: float
    horizon: int
    time_step: float
    contact: tuple[str, str] | None = None
    contact_point: NDArray[np.float64] | None = None
    refused: NDArray[np.float64] | None = None
    steps_lower_bound: int | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.outcome not in OUTCOMES:
            raise InvalidInputError(f"outcome must be one of {OUTCOMES}, got {self.outcome!r}")
        whole_number("trial", self.trial, 0)
        whole_number("horizon", self.horizon, 1)
        for name in ("tolerance", "time_step"):
            if not 0 < getattr(self, name) < float("inf"):
                raise InvalidInputError(f"{name} must be finite and above 0")
        states = finite_array("states", self.states, (None, None))
        if not 1 <= len(states) <= self.horizon + 1:
            raise InvalidInputError(
                f"states must be 1 to {self.horizon + 1} for a horizon of {self.horizon}, "
                f"got {len(states)}"
            )
        shapes = {
            "states": states.shape,
            "distances": (len(states),),
            "goal": (3,),
            "refused": states.shape[1:],
            "contact_point": (3,),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None:
                value = finite_array(name, value, shape)
                value.flags.writeable = False
                object.__setattr__(self, name, value)

    @property
    def steps(self) -> int:
        """Steps taken, a refused one included."""
        return len(self.states) - 1

    @property
    def final_distance(self) -> float:
        """Distance from the tool to the goal at the end [m]."""
        return float(self.distances[-1])

    def check_arm(self, arm: Arm) -> None:
        """See that this is the arm that was recorded.

        Raises
        ------
        InvalidInputError
            If it is another one.
        """
        if arm.digest != self.arm_digest:
            other = "another version of arm" if arm.name == self.arm else "arm"
            raise InvalidInputError(
                f"the recording of trial {self.trial} is of {other} {self.arm!r} "
                f"({self.arm_digest}), not of {arm.name!r} ({arm.digest})"
            )

    def save(self, path: str | Path) -> None:
        """Write this recording alone to an ``.npz`` file; see `save_recordings`.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        save_recordings(path, [self])

    @classmethod
    def load(cls, path: str | Path) -> "Recording":
        """Read the recording of a file that holds one.

        Raises
        ------
        RecordingFileError
            If the file cannot be used, or holds several.
        """
        recordings = load_recordings(path)
        if len(recordings) != 1:
            raise RecordingFileError(
                f"{str(path)!r} holds {len(recordings)} recordings: load_recordings reads them all"
            )
        return recordings[0]


def save_recordings(path: str | Path, recordings: Sequence[Recording]) -> None:
    """Write recordings to an ``.npz`` file, without pickle.

    Raises
    ------
    OutputError
        If the file cannot be written; an existing file is then left as it was.
    """
    names = [item.name for item in fields(Recording) if item.name not in (*ARRAYS, "scene")]
    entries = [
        {**{name: getattr(each, name) for name in names}, "scene": asdict(each.scene)}
        for each in recordings
    ]
    arrays: dict[str, Any] = {
        "format": np.array(FILE_FORMAT),
        "version": np.array(FILE_VERSION),
        "recordings": np.array(json.dumps(entries, sort_keys=True)),
    }
    for number, each in enumerate(recordings):
        values = {f"{name}_{number}": getattr(each, name) for name in ARRAYS}
        arrays |= {name: value for name, value in values.items() if value is not None}
    write_atomically(path, lambda file: np.savez_compressed(file, **arrays))


def load_recordings(path: str | Path) -> list[Recording]:
    """Read what `save_recordings` wrote.

    Raises
    ------
    RecordingFileError
        If the file is missing, truncated, something else, or written by a later version.
    """
    name = str(path)
    try:
        with Path(path).open("rb") as file:
            return _read(name, file)
    except OSError as error:
        raise RecordingFileError(f"cannot read recording {name!r}: {error.strerror}") from error
    except (AttributeError, *CORRUPT) as error:
        raise RecordingFileError(
            f"{name!r} is not a complete recording: {first_line(error)}"
        ) from error


def _read(name: str, file: IO[bytes]) -> list[Recording]:
    content = open_archive(
        name,
        file,
        kind="recording",
        file_format=FILE_FORMAT,
        version=FILE_VERSION,
        error=RecordingFileError,
    )
    return [
        _recording(entries, {part: content.get(f"{part}_{number}") for part in ARRAYS})
        for number, entries in enumerate(json.loads(str(content["recordings"])))
    ]


def _recording(entries: dict[str, Any], arrays: dict[str, Any]) -> Recording:
    """Rebuild a recording from what JSON held of it, and its arrays."""
    scene, contact = entries.pop("scene"), entries.pop("contact")
    benches = [
        Bench(**{**bench, "x": tuple(bench["x"]), "y": tuple(bench["y"])})
        for bench in scene.pop("benches")
    ]
    return Recording(
        **entries,
        **arrays,
        contact=tuple(contact) if contact else None,
        scene=Scene(benches=tuple(benches), **scene),
    )


def record_rollouts(
    simulator: Simulator,
    rollouts: Rollouts,
    policy: str,
    numbers: Sequence[int] | None = None,
    *,
    steps_lower_bound: Callable[[int], int] | None = None,
    provenance: Mapping[str, Any] | None = None,
) -> list[Recording]:
    """Turn rollouts into recordings.

    Parameters
    ----------
    simulator : Simulator
        Where the rollouts took place.
    rollouts : Rollouts
        Made with ``record=True``.
    policy : str
        Name of what drove the arm.
    numbers : sequence of int, optional
        Which rollouts; all by default. A rollout's number becomes that of the trial.
    steps_lower_bound : callable, optional
        Gives the proven number of steps of a trial.
    provenance : dict, optional
        Where they come from, in terms that JSON can hold.

    Raises
    ------
    InvalidInputError
        If the rollouts were made without ``record=True``, or have no such number.
    """
    if rollouts.paths.size == 0:
        raise InvalidInputError("these rollouts kept no configurations: make them with record=True")
    chosen = range(len(rollouts)) if numbers is None else numbers
    for number in chosen:
        if number not in range(len(rollouts)):
            raise InvalidInputError(f"no trial {number}: there are 0 to {len(rollouts) - 1}")
    recordings = []
    for number in chosen:
        states = rollouts.paths[number, : rollouts.steps[number] + 1]
        goal = rollouts.goals[number]
        touch = None
        if rollouts.collision[number]:
            touch = simulator.contact(rollouts.configurations[number], rollouts.targets[number])
        recordings.append(
            Recording(
                policy=policy,
                task=simulator.task.name,
                trial=int(number),
                arm=simulator.arm.name,
                arm_digest=simulator.arm.digest,
                scene=simulator.scene,
                states=states,
                distances=simulator.distances(states, np.tile(goal, (len(states), 1))),
                goal=goal,
                outcome=_outcome(rollouts, number),
                tolerance=simulator.task.tolerance,
                horizon=simulator.task.horizon,
                time_step=simulator.time_step,
                contact=touch.pair if touch else None,
                contact_point=touch.point if touch else None,
                refused=touch.configuration if touch else None,
                steps_lower_bound=steps_lower_bound(number) if steps_lower_bound else None,
                provenance=dict(provenance or {}),
            )
        )
    return recordings


def _outcome(rollouts: Rollouts, number: int) -> str:
    if rollouts.success[number]:
        return "success"
    return "collision" if rollouts.collision[number] else "horizon"
