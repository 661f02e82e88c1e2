"""One class for every trained policy: a normaliser, dense layers and a clip."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.files import CORRUPT, first_line, open_archive, write_atomically
from kinarm.networks import Networks
from kinarm.policies.normalizer import fold_normalizer, input_scale
from kinarm.policies.provenance import Provenance
from kinarm.validation import finite_array

FILE_FORMAT = "kinarm-policy"
FILE_VERSION = 1


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
    """Maps observations to actions: normalise, dense layers with tanh between, clip to [-1, 1].

    A linear policy has one layer. Inputs that were constant in training have weight zero.

    Parameters
    ----------
    mean, std : ndarray, shape (n_observations,)
        Statistics of the observations in training.
    layers : tuple of Layer
        From the observation to the action.
    provenance : Provenance
        Where it comes from.

    Raises
    ------
    InvalidInputError
        If shapes do not fit together or an entry is not finite.
    """

    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    layers: tuple[Layer, ...]
    provenance: Provenance

    def __post_init__(self) -> None:
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
        for array in (mean, std, *(array for layer in layers for array in layer)):
            array.flags.writeable = False
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "std", std)
        object.__setattr__(self, "layers", tuple(layers))

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
            Fractions of the rated speeds in [-1, 1].
        """
        given = np.asarray(observations, dtype=float)
        shape = (self.n_observations,) if given.ndim == 1 else (None, self.n_observations)
        x = (finite_array("observations", given, shape) - self.mean) * input_scale(self.std)
        for number, layer in enumerate(self.layers):
            x = (np.tanh(x) if number else x) @ layer.weights.T + layer.bias
        return np.clip(x, -1.0, 1.0)

    @cached_property
    def _networks(self) -> Networks:
        first = Layer(*fold_normalizer(*self.layers[0], self.mean, self.std))
        layers = (first, *self.layers[1:])
        flat = [part for weights, bias in layers for part in (weights.T.reshape(-1), bias)]
        widths = [self.n_observations, *(len(layer.bias) for layer in layers)]
        return Networks(np.array(widths, dtype=np.int64), np.concatenate(flat)[None])

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
        trained = self.provenance
        if trained.arm_digest != arm.digest:
            other = "another version of arm" if trained.arm == arm.name else "arm"
            raise PolicyFileError(
                f"the policy was trained for {other} {trained.arm!r}, not for {arm.name!r}"
            )

    def save(self, path: str | Path) -> None:
        """Write the policy to an ``.npz`` file, without pickle.

        Raises
        ------
        OutputError
            If the file cannot be written; an existing file is then left as it was.
        """
        arrays: dict[str, Any] = {
            "format": np.array(FILE_FORMAT),
            "version": np.array(FILE_VERSION),
            "provenance": np.array(json.dumps(self.provenance.to_json(), sort_keys=True)),
            "mean": self.mean,
            "std": self.std,
        }
        for number, layer in enumerate(self.layers):
            arrays[f"weights_{number}"] = layer.weights
            arrays[f"bias_{number}"] = layer.bias
        write_atomically(path, lambda file: np.savez(file, **arrays))

    @classmethod
    def load(cls, path: str | Path) -> "Policy":
        """Read a policy that `save` wrote.

        Raises
        ------
        PolicyFileError
            If the file is missing, truncated, not a policy, or written by a later version.
        """
        name = str(path)
        try:
            with Path(path).open("rb") as file:
                return cls._read(name, file)
        except OSError as error:
            raise PolicyFileError(f"cannot read policy {name!r}: {error.strerror}") from error
        except CORRUPT as error:
            raise PolicyFileError(
                f"{name!r} is not a complete kinarm policy: {first_line(error)}"
            ) from error

    @classmethod
    def _read(cls, name: str, file: IO[bytes]) -> "Policy":
        content = open_archive(
            name,
            file,
            kind="policy",
            file_format=FILE_FORMAT,
            version=FILE_VERSION,
            error=PolicyFileError,
        )
        n_layers = sum(key.startswith("weights_") for key in content.files)
        return cls(
            mean=content["mean"],
            std=content["std"],
            layers=tuple(
                Layer(content[f"weights_{number}"], content[f"bias_{number}"])
                for number in range(n_layers)
            ),
            provenance=Provenance.from_json(json.loads(str(content["provenance"]))),
        )
