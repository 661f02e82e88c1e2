"""Checkpoints of a training, from which it resumes exactly."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.errors import PolicyFileError
from kinarm.files import CORRUPT, first_line, open_archive, write_atomically
from kinarm.policies.learners import Config, TrainingState, find_learner, learner_of

FILE_FORMAT = "kinarm-checkpoint"
FILE_VERSION = 1


class Checkpoint(NamedTuple):
    """A training that was stopped.

    Attributes
    ----------
    config : ARSConfig, PPOConfig or settings of another learner
        The settings.
    state : TrainingState
        Where to go on.
    """

    config: Any
    state: Any


def save_checkpoint(path: str | Path, config: Config, state: TrainingState) -> None:
    """Write the state of a training, replacing an earlier checkpoint only when complete.

    Parameters
    ----------
    path : str or Path
        The file, ``.npz`` without pickle.
    config : ARSConfig, PPOConfig or settings of another learner
        The settings of the training.
    state : TrainingState
        Its state.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    arrays: dict[str, Any] = {
        "format": np.array(FILE_FORMAT),
        "version": np.array(FILE_VERSION),
        "learner": np.array(learner_of(config).name),
        "config": np.array(json.dumps(asdict(config), sort_keys=True)),  # type: ignore[call-overload]
        "arm_digest": np.array(Arm.load(config.arm).digest),
        **arrays_of("state", state),
    }
    write_atomically(path, lambda file: np.savez(file, **arrays))


def load_checkpoint(path: str | Path) -> Checkpoint:
    """Read what `save_checkpoint` wrote.

    Raises
    ------
    PolicyFileError
        If the file is missing, truncated or not a checkpoint, or if the arm has changed since.
    """
    name = str(path)
    try:
        with Path(path).open("rb") as file:
            content = open_archive(
                name,
                file,
                kind="checkpoint",
                file_format=FILE_FORMAT,
                version=FILE_VERSION,
                error=PolicyFileError,
            )
            learner = find_learner(str(content["learner"]))
            config = learner.config(**json.loads(str(content["config"])))
            state = rebuilt(learner.state, "state", content)
            arm_digest = str(content["arm_digest"])
    except OSError as error:
        raise PolicyFileError(f"cannot read checkpoint {name!r}: {error.strerror}") from error
    except (IndexError, *CORRUPT) as error:
        raise PolicyFileError(
            f"{name!r} is not a complete checkpoint: {first_line(error)}"
        ) from error
    if Arm.load(config.arm).digest != arm_digest:
        raise PolicyFileError(f"arm {config.arm!r} has changed since {name!r} was written")
    return Checkpoint(config, state)


def arrays_of(name: str, value: Any) -> dict[str, NDArray[Any]]:
    """Flatten a value into arrays; parts of records get names such as ``state.theta``.

    Parameters
    ----------
    name : str
        Name of the value.
    value : dataclass, named tuple, tuple of named tuples of numbers, dict, array or number
        The value. Dictionaries are kept as JSON.
    """
    if is_dataclass(value) or hasattr(value, "_fields"):
        parts = [(part, getattr(value, part)) for part in _field_names(type(value))]
        return {k: v for part, item in parts for k, v in arrays_of(f"{name}.{part}", item).items()}
    if isinstance(value, dict):
        return {name: np.array(json.dumps(value, sort_keys=True))}
    return {name: np.array(value)}


def rebuilt(kind: Any, name: str, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """Rebuild a value of a kind, a type or its annotation, from what `arrays_of` returned."""
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        hints = get_type_hints(kind)
        names = _field_names(kind)
        return kind(**{part: rebuilt(hints[part], f"{name}.{part}", arrays) for part in names})
    if get_origin(kind) is tuple:
        record = get_args(kind)[0]
        types = get_type_hints(record).values()
        rows = arrays[name].reshape(-1, len(types)).tolist()
        return tuple(record(*(t(x) for t, x in zip(types, row, strict=True))) for row in rows)
    if get_origin(kind) is dict:
        return json.loads(str(arrays[name]))
    return kind(arrays[name]) if kind in (int, float) else arrays[name]


def _field_names(kind: Any) -> Iterable[str]:
    """Names of the fields of a dataclass or named tuple."""
    return [item.name for item in fields(kind)] if is_dataclass(kind) else kind._fields
