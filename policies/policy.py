"""One class for every trained policy: a normaliser, dense layers and a clip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._validation import finite_array
from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError
from kinarm.networks import ACTIVATIONS, Activation, Mirror, Networks, checked_activations
from kinarm.policies.goal_observation import flat_observation
from kinarm.policies.normalizer import fold_normalizer, input_scale
from kinarm.policies.provenance import Provenance
from kinarm.problem import ProblemLike, ReachProblem

LARGEST = 1e30
"""Magnitude of statistics and weights at most: with larger ones, actions overflow."""


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
    activations : tuple of str
        Function after each layer, the last one before the clip: ``"linear"``, ``"tanh"``,
        ``"relu"``, ``"hardtanh"``, ``"elu"``, ``"leaky_relu"`` or ``"silu"``; by default tanh
        between the layers and none after the last.
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
    activations: tuple[Activation, ...] = ()
    mirror: Mirror | None = None

    def __post_init__(self) -> None:
        if not self.layers:
            raise InvalidInputError("a policy needs at least one layer")
        activations = checked_activations(self.activations, len(self.layers))
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
            if np.abs(array).max(initial=0.0) > LARGEST:
                raise InvalidInputError(f"statistics and weights must be at most {LARGEST:g}")
            array.flags.writeable = False
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "std", std)
        object.__setattr__(self, "layers", tuple(layers))
        object.__setattr__(self, "activations", activations)
        object.__setattr__(self, "mirror", mirror)

    def __repr__(self) -> str:
        made, widths = self.provenance, "-".join(str(len(layer.bias)) for layer in self.layers)
        seed = "" if made.seed is None else f"seed {made.seed}, "
        return (
            f"Policy({made.algorithm} {made.recipe}, problem {self.problem.name!r}, {seed}layers "
            f"{self.n_observations}-{widths})"
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
        for layer, activation in zip(self.layers, self.activations, strict=True):
            x = ACTIVATIONS[activation](x @ layer.weights.T + layer.bias)
        actions = np.clip(x, -1.0, 1.0)
        if self.mirror is not None:
            actions = np.where(left[:, None], actions * self.mirror.actions, actions)
        return actions[0] if given.ndim == 1 else actions

    def predict(
        self,
        observation: ArrayLike | Mapping[str, ArrayLike],
        state: Any = None,
        episode_start: Any = None,  # noqa: ARG002
        deterministic: bool = True,  # noqa: ARG002
    ) -> tuple[NDArray[np.float64], Any]:
        """Choose actions, as models of Stable-Baselines3 do.

        Parameters
        ----------
        observation : array_like or mapping
            One observation or several, as for a call; or, of the goal-conditioned environments,
            a dictionary of ``observation``, ``achieved_goal`` and ``desired_goal``.
        state : object
            Given back as it is: policies have no memory.
        episode_start, deterministic
            Of no effect: policies neither remember nor draw.

        Returns
        -------
        actions : ndarray, shape (n_actions,) or (n, n_actions)
            Fractions of the velocity limits in [-1, 1].
        state : object
            The state that was given.

        Raises
        ------
        InvalidInputError
            If the observation has another shape or other keys, or an entry is not finite.
        """
        if isinstance(observation, Mapping):
            observation = flat_observation(observation, self.n_observations)
        return self(observation), state

    @cached_property
    def _networks(self) -> Networks:
        first = Layer(*fold_normalizer(*self.layers[0], self.mean, self.std))
        layers = (first, *self.layers[1:])
        flat = [part for weights, bias in layers for part in (weights.T.reshape(-1), bias)]
        widths = [self.n_observations, *(len(layer.bias) for layer in layers)]
        weights = np.concatenate(flat)[None]
        return Networks(np.array(widths), weights, self.activations, self.mirror)

    def networks(self) -> Networks:
        """The policy in the form that the compiled simulator runs, normaliser folded in."""
        return self._networks

    @classmethod
    def from_sb3(
        cls,
        model: Any,
        problem: ProblemLike | None = None,
        vec_normalize: Any = None,
    ) -> Policy:
        """Convert a model of Stable-Baselines3 or sb3-contrib: its deterministic actions.

        The model computes in float32, the policy with the same numbers in float64; their actions
        agree to about 1e-6.

        Parameters
        ----------
        model : BaseAlgorithm, str or Path
            PPO, A2C, SAC, TD3, DDPG or TQC with ``MlpPolicy`` or ``MultiInputPolicy``, or the file
            that its ``save`` wrote. Loading a file runs code in it: open only files that you
            trust.
        problem : ReachProblem, str or Path, optional
            The problem that the policy is for; by default that of the model's environment.
        vec_normalize : VecNormalize, str or Path, optional
            The statistics that normalise its observations, or their file; by default those of the
            model's environment.

        Raises
        ------
        InvalidInputError
            If it cannot be converted, with the reason: it is recurrent, computes features, has
            other activation functions, or other observations or actions than the arm; or if
            the problem is unknown.
        PolicyFileError
            If a file cannot be read, or is something else.
        MissingExtraError
            If Stable-Baselines3 is not installed.
        """
        from kinarm.policies.conversion.sb3 import policy_from_sb3

        return policy_from_sb3(model, problem, vec_normalize)

    @classmethod
    def from_torch(
        cls,
        module: Any,
        problem: ProblemLike,
        *,
        mean: ArrayLike | None = None,
        std: ArrayLike | None = None,
        name: str = "torch",
        environment_steps: int = 0,
        seed: int | None = None,
    ) -> Policy:
        """Convert a feed-forward network of PyTorch, which maps observations to actions.

        Parameters
        ----------
        module : nn.Module
            A ``Sequential`` of ``Linear`` and activation functions; it can be nested.
        problem : ReachProblem, str or Path
            The problem that it is for.
        mean, std : array_like, shape (n_observations,), optional
            Statistics by which its inputs are normalised; without them they are not.
        name : str
            Name of the algorithm that trained it, for tables.
        environment_steps, seed
            Steps and seed of the training, for the record.

        Raises
        ------
        InvalidInputError
            If it holds a module that cannot be converted, or does not fit the problem's arm.
        MissingExtraError
            If PyTorch is not installed.
        """
        from kinarm.policies.conversion.layers import policy_from_torch

        origin = {"algorithm": name, "environment_steps": environment_steps, "seed": seed}
        return policy_from_torch(module, ReachProblem.load(problem), (mean, std), **origin)

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
        from kinarm.policies.policy_files import save_policy

        save_policy(path, self)

    @classmethod
    def load(cls, path: str | Path) -> Policy:
        """Read a policy that `save` wrote.

        Raises
        ------
        PolicyFileError
            If the file is missing, truncated, not a policy, written by another version, or made
            for observations of another layout.
        """
        from kinarm.policies.policy_files import read_policy

        return read_policy(path)
