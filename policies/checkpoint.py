"""Checkpoints of a training, from which it resumes exactly."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.files import CORRUPT, write_atomically
from kinarm.policies.ars import ARSState
from kinarm.policies.ars_config import ARSConfig
from kinarm.policies.curve import CurvePoint
from kinarm.policies.normalizer import Normalizer
from kinarm.policies.ppo_config import PPOConfig
from kinarm.policies.ppo_state import EpisodeStates, PPOState

ARS_FORMAT = "kinarm-ars-checkpoint"
PPO_FORMAT = "kinarm-ppo-checkpoint"
FILE_VERSION = 1

Arrays = Mapping[str, NDArray[Any]]
ConfigT = TypeVar("ConfigT", ARSConfig, PPOConfig)
StateT = TypeVar("StateT", ARSState, PPOState)


def save_checkpoint(path: str | Path, config: ARSConfig, state: ARSState) -> None:
    """Write the state of a training, replacing an earlier checkpoint only when complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    arrays = {
        "generator": np.array(json.dumps(state.generator, sort_keys=True)),
        "theta": state.theta,
        **_common_arrays(state),
    }
    _save(path, ARS_FORMAT, config, arrays)


def load_checkpoint(path: str | Path) -> tuple[ARSConfig, ARSState]:
    """Read what `save_checkpoint` wrote.

    Raises
    ------
    PolicyFileError
        If the file is missing, truncated or not a checkpoint.
    """
    return _load(path, ARS_FORMAT, ARSConfig, _ars_state)


def save_ppo_checkpoint(path: str | Path, config: PPOConfig, state: PPOState) -> None:
    """Write the state of a training, replacing an earlier checkpoint only when complete.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    arrays = {
        "parameters": state.parameters,
        "first_moment": state.first_moment,
        "second_moment": state.second_moment,
        "simulator_time": np.array(state.simulator_time),
        **{f"episodes_{name}": array for name, array in state.episodes._asdict().items()},
        **_common_arrays(state),
    }
    _save(path, PPO_FORMAT, config, arrays)


def load_ppo_checkpoint(path: str | Path) -> tuple[PPOConfig, PPOState]:
    """Read what `save_ppo_checkpoint` wrote.

    Raises
    ------
    PolicyFileError
        If the file is missing, truncated or not a checkpoint.
    """
    return _load(path, PPO_FORMAT, PPOConfig, _ppo_state)


def _common_arrays(state: ARSState | PPOState) -> dict[str, NDArray[Any]]:
    """What every learner keeps."""
    return {
        "count": np.array(state.normalizer.count),
        "mean": state.normalizer.mean,
        "squares": state.normalizer.squares,
        "curve": np.array(state.curve, dtype=float).reshape(-1, len(CurvePoint._fields)),
    }


def _save(path: str | Path, file_format: str, config: ARSConfig | PPOConfig, state: Arrays) -> None:
    """Write the settings and the arrays of a state."""
    arrays: dict[str, Any] = {
        "format": np.array(file_format),
        "version": np.array(FILE_VERSION),
        "arm_digest": np.array(Arm.load(config.arm).digest),
        "config": np.array(json.dumps(asdict(config), sort_keys=True)),
        **state,
    }
    write_atomically(path, lambda file: np.savez(file, **arrays))


def _load(
    path: str | Path,
    file_format: str,
    config_type: type[ConfigT],
    read_state: Callable[[Arrays], StateT],
) -> tuple[ConfigT, StateT]:
    """Read settings and state, and see that the arm is still the same."""
    try:
        with Path(path).open("rb") as file:
            content = np.load(file, allow_pickle=False)
            if str(content["format"]) != file_format:
                raise PolicyFileError(
                    f"{str(path)!r} is not a checkpoint of such a training ({file_format})"
                )
            if int(content["version"]) > FILE_VERSION:
                raise PolicyFileError(f"{str(path)!r} was written by a later version of kinarm")
            state = read_state(content)
            config = config_type(**json.loads(str(content["config"])))
            arm_digest = str(content["arm_digest"])
    except OSError as error:
        raise PolicyFileError(f"cannot read checkpoint {str(path)!r}: {error.strerror}") from error
    except (IndexError, *CORRUPT) as error:
        if isinstance(error, InvalidInputError):
            raise
        raise PolicyFileError(f"{str(path)!r} is not a complete checkpoint") from error
    if Arm.load(config.arm).digest != arm_digest:
        raise PolicyFileError(f"arm {config.arm!r} has changed since {str(path)!r} was written")
    return config, state


def _normalizer(content: Arrays, n_observations: int) -> Normalizer:
    """Read the statistics; ValueError if they have the wrong length."""
    mean, squares = content["mean"], content["squares"]
    if not mean.shape == squares.shape == (n_observations,):
        raise ValueError(f"statistics of {mean.shape} and {squares.shape} for {n_observations}")
    return Normalizer(int(content["count"]), mean, squares)


def _curve(content: Arrays) -> tuple[CurvePoint, ...]:
    return tuple(CurvePoint.from_row(row) for row in content["curve"])


def _ars_state(content: Arrays) -> ARSState:
    """Read a state; ValueError or TypeError if a training could not go on from it."""
    theta = content["theta"]
    _, n_observations = theta.shape
    generator = json.loads(str(content["generator"]))
    np.random.default_rng().bit_generator.state = generator
    return ARSState(
        theta=theta,
        normalizer=_normalizer(content, n_observations),
        generator=generator,
        curve=_curve(content),
    )


def _ppo_state(content: Arrays) -> PPOState:
    """Read a state; ValueError or TypeError if a training could not go on from it."""
    vectors = [content[name] for name in ("parameters", "first_moment", "second_moment")]
    if len({vector.shape for vector in vectors}) > 1 or vectors[0].ndim != 1:
        raise ValueError(f"parameters and moments of shapes {[v.shape for v in vectors]}")
    if not all(vector.dtype == np.float32 and np.isfinite(vector).all() for vector in vectors):
        raise ValueError("parameters and moments must be finite numbers of single precision")
    episodes = EpisodeStates(*(content[f"episodes_{name}"] for name in EpisodeStates._fields))
    if len({len(array) for array in episodes}) > 1:
        raise ValueError(f"episodes of shapes {[array.shape for array in episodes]}")
    return PPOState(
        parameters=vectors[0],
        first_moment=vectors[1],
        second_moment=vectors[2],
        normalizer=_normalizer(content, len(content["mean"])),
        episodes=episodes,
        curve=_curve(content),
        simulator_time=float(content["simulator_time"]),
    )
