"""Networks of PyTorch as layers of a policy.

Affine maps, clips and functions are joined into layers with a function each.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm.errors import InvalidInputError, needed
from kinarm.networks import Activation, Layer
from kinarm.observation_layout import ObservationLayout
from kinarm.policies.provenance import Provenance, package_versions
from kinarm.problem import ReachProblem

if TYPE_CHECKING:
    from kinarm.policies.policy import Policy

CONVERTED = (
    "Sequential, Linear, Tanh, ReLU, ELU (alpha 1), LeakyReLU (slope 0.01), SiLU, Hardtanh, "
    "Flatten, Identity, and Dropout after eval()"
)
"""Modules that can be converted, for messages."""

UNLIMITED = 2.0**20
"""Limit of entries without one; scaling by it rounds nothing."""

WHOLE = ""
"""Key of a flat observation."""


class Clip(NamedTuple):
    """Finite limits, for all values or for each: shape () or (n,)."""

    low: NDArray[np.float64] | np.float64
    high: NDArray[np.float64] | np.float64


Piece = Layer | Clip | Activation


def chained(
    pieces: Iterable[Piece], n_inputs: int
) -> tuple[tuple[Layer, ...], tuple[Activation, ...]]:
    """Join pieces into layers, and the function after each.

    Affine maps in a row become one. A clip becomes ``hardtanh`` between two scalings, which join
    their neighbours.
    """
    layers: list[Layer] = []
    activations: list[Activation] = []
    open_map = Layer(np.eye(n_inputs), np.zeros(n_inputs))
    for piece in pieces:
        weights, bias = open_map
        width = len(bias)
        if isinstance(piece, Layer):
            if piece.weights.shape[1] != width:
                wanted = piece.weights.shape[1]
                raise InvalidInputError(f"a layer takes {wanted} inputs where {width} arrive")
            open_map = Layer(piece.weights @ weights, piece.weights @ bias + piece.bias)
        elif isinstance(piece, Clip):
            low, high = (np.broadcast_to(end, width) for end in piece)
            middle, half = (high + low) / 2, (high - low) / 2
            layers.append(Layer(weights / half[:, None], (bias - middle) / half))
            activations.append("hardtanh")
            open_map = Layer(np.diag(half), middle)
        else:
            layers.append(open_map)
            activations.append(piece)
            open_map = Layer(np.eye(width), np.zeros(width))
    weights, bias = open_map
    if not layers or bias.any() or not np.array_equal(weights, np.eye(len(bias))):
        layers.append(open_map)
        activations.append("linear")
    return tuple(layers), tuple(activations)


def policy_of_pieces(
    kind: "type[Policy]",
    pieces: Iterable[Piece],
    problem: ReachProblem,
    mean: ArrayLike | None = None,
    std: ArrayLike | None = None,
    **origin: Any,
) -> "Policy":
    """Make a policy of pieces from the observation to the action.

    Raises InvalidInputError if they cannot be converted, or numbers of entries do not fit.

    Parameters
    ----------
    kind : type
        `Policy`.
    pieces, problem
        The pieces in order, and their problem.
    mean, std : array_like, shape (n_observations,), optional
        Statistics that normalise observations before, if any.
    **origin
        Fields of `Provenance`, but for problem and versions.
    """
    arm = problem.load_arm()
    n_observations, n_actions = ObservationLayout.of(problem, arm).size, arm.n_actuated
    layers, activations = chained(pieces, n_observations)
    if len(layers[-1].bias) != n_actions:
        raise InvalidInputError(
            f"the module gives {len(layers[-1].bias)} numbers; arm {arm.name!r} takes {n_actions}"
        )
    return kind(
        mean=np.zeros(n_observations) if mean is None else np.asarray(mean),
        std=np.ones(n_observations) if std is None else np.asarray(std),
        layers=layers,
        activations=activations,
        provenance=Provenance(problem=problem.pinned, versions=package_versions(), **origin),
    )


def module_pieces(module: Any) -> Iterator[Piece]:
    """Pieces of a module in order; parameters become float64, which is exact.

    Raises InvalidInputError if it is or holds a module that cannot be converted, and
    MissingExtraError if PyTorch is not installed.
    """
    nn = needed("torch", "torch", "sb3").nn
    functions: dict[type, Any] = {nn.Tanh: "tanh", nn.ReLU: "relu", nn.SiLU: "silu"}
    kind = type(module)
    if kind is nn.Sequential:
        for part in module:
            yield from module_pieces(part)
    elif kind is nn.Linear:
        weights = module.weight.detach().cpu().numpy().astype(np.float64)
        bias = np.zeros(len(weights)) if module.bias is None else module.bias.detach().cpu().numpy()
        yield Layer(weights, bias.astype(np.float64))
    elif kind in functions:
        yield functions[kind]
    elif kind is nn.ELU and module.alpha == 1.0:
        yield "elu"
    elif kind is nn.LeakyReLU and module.negative_slope == 0.01:
        yield "leaky_relu"
    elif kind in (nn.Hardtanh, nn.ReLU6):
        yield Clip(np.float64(module.min_val), np.float64(module.max_val))
    elif kind is nn.Dropout and (not module.training or module.p == 0.0):
        return  # it drops nothing
    elif kind not in (nn.Flatten, nn.Identity):
        raise InvalidInputError(f"cannot convert {module!r}; what can be converted: {CONVERTED}")


def normalization(statistics: Any, sizes: Mapping[str, int]) -> Iterator[Piece]:
    """The map by ``VecNormalize``: (x - mean) / sqrt(var + epsilon), and a clip.

    It has statistics of some parts of the inputs, whose sizes are given in order. Raises
    InvalidInputError if the statistics are of other observations.
    """
    if statistics is None or not statistics.norm_obs:
        return
    known = statistics.obs_rms
    known = known if isinstance(known, dict) else {WHOLE: known}
    if not all(each.mean.shape == (sizes.get(key),) for key, each in known.items()):
        raise InvalidInputError("VecNormalize has statistics of other observations than the model")
    n, end = sum(sizes.values()), 0
    scale, shift, limit = np.ones(n), np.zeros(n), np.full(n, UNLIMITED)
    for key, size in sizes.items():
        place, end = slice(end, end + size), end + size
        if key in known:
            scale[place] = 1 / np.sqrt(known[key].var + statistics.epsilon)
            shift[place] = -known[key].mean * scale[place]
            limit[place] = statistics.clip_obs
    yield Layer(np.diag(scale), shift)
    if np.isfinite(statistics.clip_obs):
        yield Clip(-limit, limit)
