"""Specifications of environments, of any problem, that JSON can hold."""

import json
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec

from kinarm.simulator import Simulator

SETTINGS = (
    *("render_mode", "width", "height", "camera", "observation_dtype", "reward_type"),
    *("num_envs", "autoreset_mode", "threads", "vectorization_mode"),
)
"""Arguments of environments that are not part of their problem."""


def portable_spec(spec: EnvSpec, simulator: Simulator) -> EnvSpec:
    """Complete the specification of an environment, so that it can be written as JSON.

    It states the horizon. A problem, or changes to one, that JSON cannot hold are replaced by
    what `kinarm.ReachProblem.to_json` makes of the whole problem.

    Parameters
    ----------
    spec : EnvSpec
        As Gymnasium made it.
    simulator : Simulator
        That of the environment.
    """
    steps = spec.max_episode_steps or simulator.task.horizon
    given = {name: value for name, value in spec.kwargs.items() if name != "max_episode_steps"}
    return replace(spec, kwargs=_portable(given, simulator), max_episode_steps=steps)


def _portable(given: Mapping[str, Any], simulator: Simulator) -> dict[str, Any]:
    """Arguments of an environment as JSON can hold them."""
    settings = {name: _plain(given[name]) for name in SETTINGS if name in given}
    kwargs = {**given, **settings}
    try:
        json.dumps(kwargs)
    except TypeError:
        return {"problem": simulator.problem.to_json(), **settings}
    return kwargs


def _plain(value: Any) -> Any:
    """A setting as JSON can hold it."""
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, type | np.dtype):
        return np.dtype(value).name
    return value


class PortableSpec:
    """An environment whose specification JSON can hold; see `portable_spec`."""

    simulator: Simulator
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What makes this environment again; it can be written as JSON."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = None if spec is None else portable_spec(spec, self.simulator)
