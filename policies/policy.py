"""One class for every trained policy: a normaliser, dense layers and a clip."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._archive import load_archive, reading, save_archive
from kinarm._validation import finite_array
from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.networks import ACTIVATIONS, Activation, Mirror, Networks, check_activations
from kinarm.observation import observation_layout
from kinarm.policies.normalizer import fold_normalizer, input_scale
from kinarm.policies.provenance import Provenance
from kinarm.problem import ReachProblem

FORMAT_VERSION = 2


class Layer(NamedTuple):
    """An affine map: ``weights @ x + bias``.

    Attributes
    ----------
    weights : ndarray, shape (n_out, n_in)
    bias : ndarray, shape (n_out,)
    """

    weights: NDArray[np.float64]
    bias: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Policy:
    """Maps observations to actions: normalise, dense layers, clip to [-1, 1].

    A linear policy has one layer. Inputs that were constant in training have weight zero.

    Parameters
    ----------
    mean, std : ndarray, shape (n_observations,)
        Statistics of the observations in training.
    layers : tuple of Layer
        From the observation to the action.
    provenance : Provenance
        Where it comes from, and the problem that it was made for.
    activation, output : {"linear", "tanh", "relu"}
        Function between the layers, and after the last one before the clip.
    mirror : Mirror, optional
        Reflection in which it sees goals on the left, and acts.

    Raises
    ------
    InvalidInputError
        If shapes do not fit together or an entry is not finite.
    """

    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    layers: tuple[Layer, ...]
    provenance: Provenance
    activation: Activation = "tanh"
    output: Activation = "linear"
    mirror: Mirror | None = None

    def __post_init__(self) -> None:
        check_activations(self.activation, self.output)
        if not self.layers:
            raise InvalidInputError("a policy needs at least one layer")
        mean = finite_array("mean", self.mean, (None,))
        std = finite_array("std", self.std, mean.shape)
        if (std < 0).any():
            raise InvalidInputError("std must not be negative")
        layers, width = [], len(mean)
        for number, layer in enumerate(self.layers):
            weights = finite_array(f"weights of layer {number}", layer.weights, (None, width))
            width = len(weights)
            layers.append(
                Layer(weights, finite_array(f"bias of layer {number}", layer.bias, (width,)))
            )
        mirror = None
        if self.mirror is not None:
            mirror = Mirror(
                finite_array("mirror of observations", self.mirror.observations, mean.shape),
                finite_array("mirror of actions", self.mirror.actions, (width,)),
            )
        for array in (mean, std, *(array for layer in layers for array in layer), *(mirror or ())):
            array.flags.writeable = False
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "std", std)
        object.__setattr__(self, "layers", tuple(layers))
        object.__setattr__(self, "mirror", mirror)

    def __repr__(self) -> str:
        made, widths = self.provenance, "-".join(str(len(layer.bias)) for layer in self.layers)
        return (
            f"Policy({made.algorithm} {made.recipe}, problem {self.problem.name!r}, seed "
            f"{made.seed}, layers {self.n_observations}-{widths})"
        )

    @property
    def problem(self) -> ReachProblem:
        """The problem that it was made for."""
        return self.provenance.problem

    @property
    def n_observations(self) -> int:
        """Length of an observation."""
        return len(self.mean)

    @property
    def n_actions(self) -> int:
        """Length of an action."""
        return len(self.layers[-1].bias)

    def __call__(self, observations: ArrayLike) -> NDArray[np.float64]:
        """Choose actions.

        Parameters
        ----------
        observations : array_like, shape (n_observations,) or (n, n_observations)
            One observation, or several.

        Returns
        -------
        ndarray, shape (n_actions,) or (n, n_actions)
            Fractions of the velocity limits in [-1, 1].
        """
        given = np.asarray(observations, dtype=float)
        shape = (self.n_observations,) if given.ndim == 1 else (None, self.n_observations)
        x = np.atleast_2d(finite_array("observations", given, shape))
        left = np.zeros(len(x), dtype=bool)
        if self.mirror is not None:
            left, x = self.mirror.on_the_left(x), self.mirror.from_the_right(x)
        x = (x - self.mean) * input_scale(self.std)
        for number, layer in enumerate(self.layers):
            x = (ACTIVATIONS[self.activation](x) if number else x) @ layer.weights.T + layer.bias
        actions = np.clip(ACTIVATIONS[self.output](x), -1.0, 1.0)
        if self.mirror is not None:
            actions = np.where(left[:, None], actions * self.mirror.actions, actions)
        return actions[0] if given.ndim == 1 else actions

    @cached_property
    def _networks(self) -> Networks:
        first = Layer(*fold_normalizer(*self.layers[0], self.mean, self.std))
        layers = (first, *self.layers[1:])
        flat = [part for weights, bias in layers for part in (weights.T.reshape(-1), bias)]
        widths = [self.n_observations, *(len(layer.bias) for layer in layers)]
        form = (self.activation, self.output, self.mirror)
        return Networks(np.array(widths, dtype=np.int64), np.concatenate(flat)[None], *form)

    def networks(self) -> Networks:
        """The policy in the form that the compiled simulator runs, normaliser folded in."""
        return self._networks

    def check_arm(self, arm: Arm) -> None:
        """Refuse an arm other than the one that the policy was trained for.

        Raises
        ------
        PolicyFileError
            If the arm differs in anything that the simulator uses.
        """
        trained = self.problem.arm
        if self.problem.arm_digest != arm.digest:
            other = "another version of arm" if trained.name == arm.name else "arm"
            raise PolicyFileError(
                f"the policy was trained for {other} {trained.name!r}, not for {arm.name!r}"
            )

    def save(self, path: str | Path) -> None:
        """Write the policy to an ``.npz`` file, without pickle.

        Raises
        ------
        OutputError
            If the file cannot be written; an existing file is then left as it was.
        """
        header = {
            "provenance": self.provenance.to_json(),
            "observation": observation_layout(),
            "activation": self.activation,
            "output": self.output,
        }
        arrays = {"mean": self.mean, "std": self.std}
        for number, layer in enumerate(self.layers):
            arrays |= {f"weights_{number}": layer.weights, f"bias_{number}": layer.bias}
        if self.mirror is not None:
            arrays |= {f"mirror_{name}": part for name, part in self.mirror._asdict().items()}
        save_archive(path, "policy", FORMAT_VERSION, arrays, header)

    @classmethod
    def load(cls, path: str | Path) -> Policy:
        """Read a policy that `save` wrote.

        Raises
        ------
        PolicyFileError
            If the file is missing, truncated, not a policy, written by another version, or made
            for observations of another layout.
        """
        header, arrays = load_archive(path, "policy", FORMAT_VERSION, PolicyFileError)
        with reading(repr(str(path)), "policy", PolicyFileError):
            if header["observation"] != observation_layout():
                raise PolicyFileError(
                    f"{str(path)!r} understands observations of layout "
                    f"{header['observation']!r}, not {observation_layout()!r}"
                )
            n_layers = sum(name.startswith("weights_") for name in arrays)
            signs = [f"mirror_{name}" for name in Mirror._fields]
            mirrored = any(name in arrays for name in signs)
            return cls(
                mean=arrays["mean"],
                std=arrays["std"],
                layers=tuple(
                    Layer(arrays[f"weights_{number}"], arrays[f"bias_{number}"])
                    for number in range(n_layers)
                ),
                provenance=Provenance.from_json(header["provenance"]),
                activation=header["activation"],
                output=header["output"],
                mirror=Mirror(*(arrays[name] for name in signs)) if mirrored else None,
            )
