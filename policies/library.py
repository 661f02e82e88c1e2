"""The policies that ship with kinarm, and loading by name, group or file."""

import re
from functools import cache
from importlib import resources
from pathlib import Path

from kinarm._files import is_file
from kinarm.errors import UnknownNameError
from kinarm.policies.policy import Policy

_SEED_SUFFIX = re.compile(r"-seed\d+$")


@cache
def policy_names() -> tuple[str, ...]:
    """Names of the shipped policies, such as ``ars-tuned-right-seed0``."""
    folder = resources.files("kinarm.data") / "policies"
    return tuple(
        sorted(Path(file.name).stem for file in folder.iterdir() if file.name.endswith(".npz"))
    )


def group_of(name: str) -> str:
    """Name without the training seed: what several seeds of one recipe and task share."""
    return _SEED_SUFFIX.sub("", name)


def load_policy(name_or_file: str | Path) -> Policy:
    """Load a shipped policy by name, or any policy from a file.

    Parameters
    ----------
    name_or_file : str or Path
        Name of a shipped policy; name of a group, for its first seed; or path of a file.

    Raises
    ------
    UnknownNameError
        If it is neither a name nor a file.
    PolicyFileError
        If the file cannot be used.
    """
    return Policy.load(policy_files(name_or_file)[0])


def policy_files(name_or_file: str | Path) -> tuple[Path, ...]:
    """Files behind a policy's name, a group's name or a path.

    Raises
    ------
    UnknownNameError
        If it is none of these.
    """
    text, path = str(name_or_file), Path(name_or_file)
    names = [name for name in policy_names() if text in (name, group_of(name))]
    if names:
        with resources.as_file(resources.files("kinarm.data") / "policies") as folder:
            return tuple(folder / f"{name}.npz" for name in names)
    if is_file(path) or path.suffix == ".npz" or path.parent != Path():
        return (path,)
    groups = dict.fromkeys(group_of(name) for name in policy_names())
    raise UnknownNameError("policy", text, (*groups, "path/to/policy.npz"))
