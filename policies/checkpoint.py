"""Checkpoints of a training, from which it resumes exactly."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.files import write_atomically
from kinarm.policies.ars import ARSState
from kinarm.policies.ars_config import ARSConfig
from kinarm.policies.curve import CurvePoint
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.policy import CORRUPT

FILE_FORMAT = "kinarm-ars-checkpoint"
FILE_VERSION = 1


def save_checkpoint(path: str | Path, config: ARSConfig, state: ARSState) -> None:
    """Write the state of a training, replacing an earlier checkpoint only when complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    arrays: dict[str, Any] = {
        "format": np.array(FILE_FORMAT),
        "version": np.array(FILE_VERSION),
        "arm_digest": np.array(Arm.load(config.arm).digest),
        "config": np.array(json.dumps(asdict(config), sort_keys=True)),
        "generator": np.array(json.dumps(state.generator, sort_keys=True)),
        "theta": state.theta,
        "count": np.array(state.normalizer.count),
        "mean": state.normalizer.mean,
        "squares": state.normalizer.squares,
        "curve": np.array(state.curve, dtype=float).reshape(-1, len(CurvePoint._fields)),
    }
    write_atomically(path, lambda file: np.savez(file, **arrays))


def load_checkpoint(path: str | Path) -> tuple[ARSConfig, ARSState]:
    """Read what `save_checkpoint` wrote.

    Raises
    ------
    PolicyFileError
        If the file is missing, truncated or not a checkpoint.
    """
    try:
        with Path(path).open("rb") as file:
            content = np.load(file, allow_pickle=False)
            if str(content["format"]) != FILE_FORMAT:
                raise PolicyFileError(f"{str(path)!r} is not a checkpoint of a training")
            if int(content["version"]) > FILE_VERSION:
                raise PolicyFileError(f"{str(path)!r} was written by a later version of kinarm")
            state = ARSState(
                theta=content["theta"],
                normalizer=Normalizer(int(content["count"]), content["mean"], content["squares"]),
                generator=json.loads(str(content["generator"])),
                curve=tuple(CurvePoint.from_row(row) for row in content["curve"]),
            )
            _check_state(state)
            config = ARSConfig(**json.loads(str(content["config"])))
            arm_digest = str(content["arm_digest"])
    except OSError as error:
        raise PolicyFileError(f"cannot read checkpoint {str(path)!r}: {error.strerror}") from error
    except (ValueError, IndexError, KeyError, TypeError, EOFError, *CORRUPT) as error:
        if isinstance(error, InvalidInputError):
            raise
        raise PolicyFileError(f"{str(path)!r} is not a complete checkpoint") from error
    if Arm.load(config.arm).digest != arm_digest:
        raise PolicyFileError(f"arm {config.arm!r} has changed since {str(path)!r} was written")
    return config, state


def _check_state(state: ARSState) -> None:
    """Raise ValueError or TypeError if a training could not go on from a state."""
    n_actions, n_observations = state.theta.shape
    for statistic in (state.normalizer.mean, state.normalizer.squares):
        if statistic.shape != (n_observations,):
            raise ValueError(f"statistics of {statistic.shape} for {n_actions, n_observations}")
    np.random.default_rng().bit_generator.state = state.generator
