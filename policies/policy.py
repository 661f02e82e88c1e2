"""The class of all trained policies, and its file."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kinarm._fields import from_plain, to_plain
from kinarm._files import Archive, load_archive, reading, save_archive, write_atomically
from kinarm.arm import Arm
from kinarm.errors import InvalidInputError, PolicyFileError, finite_array
from kinarm.networks import Activation, Mirror, Networks
from kinarm.networks import Layer as Layer
from kinarm.observation_choice import Observation
from kinarm.observation_layout import ObservationLayout, observation_layout
from kinarm.policies.arm_policy import choose_action
from kinarm.policies.normalizer import fold_normalizer
from kinarm.policies.provenance import Provenance
from kinarm.problem import ProblemLike, ReachProblem

FORMAT_VERSION = 3

SIGNS = ("observations", "actions")
"""Arrays of a mirror."""

LARGEST = 1e30
"""Largest magnitude of statistics and weights: beyond it, actions overflow."""


@dataclass(frozen=True, eq=False)
class Policy:
    """Maps observations to actions: normalise, dense layers, clip to [-1, 1].

    A linear policy has one layer. Inputs that were constant in training have
    weight zero.

    Parameters
    ----------
    mean, std : ndarray, shape (n_observations,)
        Statistics of the observations in training.
    layers : tuple of Layer
        From the observation to the action.
    provenance : Provenance
        Where it comes from, and its problem.
    activations : tuple of str
        Function after each layer, the last one before the clip, as for
        `kinarm.networks.Networks`.
    mirror : Mirror, optional
        Reflection in which it sees goals on the left, and acts.
    shield : bool
        Whether a simulator replaces its steps that would touch; see `shielded`.
    residual : bool
        Whether outputs are added to ``resolved_rate``, as `kinarm.policies.PPOConfig` says, and
        the sum is turned off bodies where ``proximity`` is seen.
    """

    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    layers: tuple[Layer, ...]
    provenance: Provenance
    activations: tuple[Activation, ...] = ()
    mirror: Mirror | None = None
    shield: bool = False
    residual: bool = False

    def __post_init__(self) -> None:
        of_one: list[Any] = [([weights], [bias]) for weights, bias in self.layers]
        networks = Networks(tuple(of_one), self.activations, self.mirror)
        mean = finite_array("mean", self.mean, networks.widths[:1])
        std = finite_array("std", self.std, mean.shape)
        if self.residual and "resolved_rate" not in self.layout.places:
            raise InvalidInputError("a residual policy needs to see 'resolved_rate'")
        if (std < 0).any():
            raise InvalidInputError("std must not be negative")
        layers = tuple(Layer(weights[0], bias[0]) for weights, bias in networks.layers)
        for array in (mean, std, *chain(*layers), *(networks.mirror or ())[:2]):
            if np.abs(array).max(initial=0.0) > LARGEST:
                raise InvalidInputError(f"statistics and weights must be at most {LARGEST:g}")
            array.flags.writeable = False
        checked = {"activations": networks.activations, "mirror": networks.mirror}
        for name, part in {"mean": mean, "std": std, "layers": layers, **checked}.items():
            object.__setattr__(self, name, part)

    def __repr__(self) -> str:
        made = self.provenance
        widths = "-".join(map(str, [self.n_observations, *(len(b) for _, b in self.layers)]))
        seed = "" if made.seed is None else f"seed {made.seed}, "
        name = f"{made.algorithm} {made.recipe}, problem {self.problem.name!r}"
        return f"Policy({name}, {seed}layers {widths})"

    @property
    def problem(self) -> ReachProblem:
        """The problem that it was made for."""
        return self.provenance.problem

    @property
    def observation(self) -> Observation:
        """What it sees."""
        return self.problem.observation

    @property
    def n_observations(self) -> int:
        """Length of an observation."""
        return len(self.mean)

    @cached_property
    def layout(self) -> ObservationLayout:
        """Where the parts of an observation are."""
        return ObservationLayout.filling(self.problem, self.n_observations, self.n_actions)

    @cached_property
    def _turns_away(self) -> bool:
        """Whether it turns actions off bodies."""
        return self.residual and "proximity" in self.layout.places

    @property
    def n_actions(self) -> int:
        """Length of an action."""
        return len(self.layers[-1].bias)

    def __call__(self, observations: ArrayLike) -> NDArray[np.float64]:
        """Choose actions: fractions of the velocity limits in [-1, 1], shape ([n,] n_actions).

        Observations have the shape ([n,] n_observations).
        """
        given = np.asarray(observations, dtype=float)
        shape = (self.n_observations,) if given.ndim == 1 else (None, self.n_observations)
        x = finite_array("observations, as policy.observation has them,", given, shape)
        actions: NDArray[np.float64] = self._act(np, self.arrays, x)
        if self._turns_away:
            self.layout.turn_away(x, actions)
        return actions

    def _act(self, xp: Any, arrays: Any, observations: Any) -> Any:
        """Actions by the arrays of a library; see `kinarm.policies.arm_policy.choose_action`."""
        side = None if self.mirror is None else self.mirror.side
        return choose_action(xp, arrays, [*self.activations], side, observations)

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
            One observation or several, as for a call; or a dictionary of
            ``observation``, ``achieved_goal`` and ``desired_goal``.
        state, episode_start, deterministic
            Of no effect; the state is returned as it is.
        """
        if isinstance(observation, Mapping):
            return self(self.layout.flat(observation)), state
        return self(observation), state

    def networks(self) -> Networks:
        """The policy as the simulator runs it, normaliser folded in."""
        return self._networks

    @cached_property
    def _networks(self) -> Networks:
        first = Layer(*fold_normalizer(*self.layers[0], self.mean, self.std))
        batches = (Layer(weights[None], bias[None]) for weights, bias in (first, *self.layers[1:]))
        first_rate = int(self.arrays["rates"][0]) if self.residual else -1
        return Networks(tuple(batches), self.activations, self.mirror, first_rate)

    @cached_property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Statistics, layers and the rest by the names that they have in files."""
        arrays: dict[str, NDArray[Any]] = {"mean": self.mean, "std": self.std}
        for number, layer in enumerate(self.layers):
            arrays |= {f"weights_{number}": layer.weights, f"bias_{number}": layer.bias}
        if self.residual:
            arrays["rates"] = np.arange(self.layout.size)[self.layout.places["resolved_rate"]]
        if self.mirror is not None:
            arrays |= {f"mirror_{name}": getattr(self.mirror, name) for name in SIGNS}
        return arrays

    @classmethod
    def from_sb3(
        cls, model: Any, problem: ProblemLike | None = None, vec_normalize: Any = None
    ) -> "Policy":
        """Convert a model of Stable-Baselines3 or sb3-contrib: its deterministic actions.

        The model computes in float32, the policy in float64; actions agree to
        about 1e-6.

        Parameters
        ----------
        model : BaseAlgorithm, str or Path
            PPO, A2C, SAC, TD3, DDPG, TQC or TRPO with ``MlpPolicy`` or
            ``MultiInputPolicy``, or its file. Loading runs code in the file:
            open only files that you trust.
        problem : ReachProblem, str or Path, optional
            The problem of the policy; by default that of the model's
            environment.
        vec_normalize : VecNormalize, str or Path, optional
            The statistics that normalise its observations, their file, which
            runs code, or ``"none"``. By default those of the model's
            environment; a model without one that was trained with some is refused.

        Raises
        ------
        KinarmError
            If the model is recurrent, computes features, has other activation
            functions, or other observations or actions than the arm; the
            problem is unknown; a file cannot be read; or Stable-Baselines3 is
            not installed.
        """
        from kinarm.policies.conversion.sb3 import policy_from_sb3

        return policy_from_sb3(cls, model, problem, vec_normalize)

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
    ) -> "Policy":
        """Convert a feed-forward network of PyTorch.

        Parameters
        ----------
        module : nn.Module
            A ``Sequential`` of ``Linear`` and activation functions, or of such.
        problem : ReachProblem, str or Path
            The problem that it is for.
        mean, std : array_like, shape (n_observations,), optional
            Statistics that normalise its inputs, if any.
        name, environment_steps, seed
            Name of its algorithm, and steps and seed of its training, for tables.
        """
        from kinarm.policies.conversion.layers import module_pieces, policy_of_pieces

        origin = {"algorithm": name, "environment_steps": environment_steps, "seed": seed}
        pieces, own = module_pieces(module), ReachProblem.load(problem)
        return policy_of_pieces(cls, pieces, own, mean, std, recipe="torch", **origin)

    def to_torch(self) -> Any:
        """Make a module of PyTorch that maps observations to actions, in double precision."""
        if self._turns_away:
            raise InvalidInputError("a residual policy that sees 'proximity' has no such module")
        from kinarm.policies.conversion.to_torch import module_of

        return module_of(self.arrays, self._act)

    def to_onnx(self, path: str | Path) -> None:
        """Write the network in ONNX, from ``observation`` to ``action`` (extra ``export``).

        `kinarm.policies.export_policy` also writes a model from joint positions to commands.
        """
        from kinarm.policies.conversion.to_torch import onnx_model

        model = onnx_model(self.to_torch(), {"observation": self.n_observations}, "action")
        write_atomically(path, lambda file: file.write(model))

    def shielded(self) -> "Policy":
        """The same policy behind a shield: what would touch is replaced wherever it is rolled out.

        `kinarm.Simulator.rollout`, evaluations and replays do so, under a name with ``+shield``. In
        other environments, whose own `kinarm.Simulator.shielded` or ``shield=True`` decides,
        it acts as before.
        """
        return replace(self, shield=True)

    def check_arm(self, arm: Arm) -> None:
        """Refuse an arm that the simulator treats otherwise than its own."""
        trained = self.problem.arm
        if self.problem.arm_digest != arm.digest:
            other = "another version of arm" if trained.name == arm.name else "arm"
            raise PolicyFileError(
                f"the policy was trained for {other} {trained.name!r}, not for {arm.name!r}"
            )

    def save(self, path: str | Path | IO[bytes]) -> None:
        """Write an ``.npz`` file without pickle, all of it or nothing."""
        content = policy_content(self)
        # Weights of networks are of single precision: compressed, they take half.
        save_archive(path, "policy", FORMAT_VERSION, content.arrays, content.header, compress=True)

    @classmethod
    def load(cls, path: str | Path) -> "Policy":
        """Read a policy that `save` wrote.

        Raises
        ------
        PolicyFileError
            If the file is missing, truncated, not a policy, or of another
            version or layout of observations.
        """
        content = load_archive(path, "policy", FORMAT_VERSION, PolicyFileError)
        with reading(repr(str(path)), "policy", PolicyFileError):
            return policy_of_content(content, repr(str(path)))


def policy_content(policy: Policy) -> Archive:
    """A policy as files hold it, for `policy_of_content`."""
    header = {
        "provenance": to_plain(policy.provenance),
        "observation": observation_layout(policy.problem),
        "activations": list(policy.activations),
        **({"shield": True} if policy.shield else {}),
    }
    return Archive(header, policy.arrays)


def policy_of_content(content: Archive, where: str) -> Policy:
    """Rebuild what `policy_content` returned, read from ``where``.

    Call it within `kinarm._files.reading`, which turns errors into messages.
    """
    header, arrays = content
    provenance = from_plain(Provenance, header["provenance"], "provenance")
    layout = observation_layout(provenance.problem)
    if header["observation"] != layout:
        raise PolicyFileError(
            f"{where} understands observations of layout {header['observation']!r}, not {layout!r}"
        )
    n_layers = sum(name.startswith("weights_") for name in arrays)
    policy = Policy(
        mean=arrays["mean"],
        std=arrays["std"],
        layers=tuple(Layer(arrays[f"weights_{k}"], arrays[f"bias_{k}"]) for k in range(n_layers)),
        provenance=provenance,
        activations=tuple(header["activations"]),
        shield=header.get("shield", False),
        residual="rates" in arrays,
    )
    signs = [f"mirror_{name}" for name in SIGNS]
    if not any(name in arrays for name in signs):
        return policy
    observations, actions = (arrays[name] for name in signs)
    return replace(policy, mirror=Mirror(observations, actions, policy.layout.side or 0))
