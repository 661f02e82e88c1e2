"""Files of policies: what they hold, without pickle."""

from pathlib import Path

from kinarm._archive import Archive, load_archive, reading, save_archive
from kinarm.errors import PolicyFileError
from kinarm.networks import Mirror
from kinarm.observation import observation_layout
from kinarm.policies.policy import Layer, Policy
from kinarm.policies.provenance import Provenance

FORMAT_VERSION = 3


def save_policy(path: str | Path, policy: Policy) -> None:
    """Write a policy; see `Policy.save`."""
    content = policy_content(policy)
    # Weights of networks have the digits of single precision: compressed, they take half the room.
    save_archive(path, "policy", FORMAT_VERSION, content.arrays, content.header, compress=True)


def read_policy(path: str | Path) -> Policy:
    """Read a policy; see `Policy.load`."""
    content = load_archive(path, "policy", FORMAT_VERSION, PolicyFileError)
    with reading(repr(str(path)), "policy", PolicyFileError):
        return policy_of_content(content, repr(str(path)))


def policy_content(policy: Policy) -> Archive:
    """What files hold of a policy: `policy_of_content` makes it again."""
    header = {
        "provenance": policy.provenance.to_json(),
        "observation": observation_layout(),
        "activations": list(policy.activations),
    }
    arrays = {"mean": policy.mean, "std": policy.std}
    for number, layer in enumerate(policy.layers):
        arrays |= {f"weights_{number}": layer.weights, f"bias_{number}": layer.bias}
    if policy.mirror is not None:
        arrays |= {f"mirror_{name}": part for name, part in policy.mirror._asdict().items()}
    return Archive(header, arrays)


def policy_of_content(content: Archive, where: str) -> Policy:
    """Rebuild what `policy_content` returned and the file ``where`` holds.

    Raises
    ------
    PolicyFileError
        If it was made for observations of another layout.
    KinarmError
        If something cannot be used.
    KeyError
        If something is missing.
    """
    header, arrays = content
    if header["observation"] != observation_layout():
        raise PolicyFileError(
            f"{where} understands observations of layout "
            f"{header['observation']!r}, not {observation_layout()!r}"
        )
    n_layers = sum(name.startswith("weights_") for name in arrays)
    signs = [f"mirror_{name}" for name in Mirror._fields]
    mirrored = any(name in arrays for name in signs)
    return Policy(
        mean=arrays["mean"],
        std=arrays["std"],
        layers=tuple(
            Layer(arrays[f"weights_{number}"], arrays[f"bias_{number}"])
            for number in range(n_layers)
        ),
        provenance=Provenance.from_json(header["provenance"]),
        activations=tuple(header["activations"]),
        mirror=Mirror(*(arrays[name] for name in signs)) if mirrored else None,
    )
