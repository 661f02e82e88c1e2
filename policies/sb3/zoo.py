"""The hyperparameters for rl-zoo3 that ship with kinarm."""

from importlib import resources
from pathlib import Path

from kinarm.errors import UnknownNameError


def zoo_hyperparameters(algorithm: str) -> Path:
    """File that rl-zoo3 takes as ``--conf-file``, with an entry for each of kinarm's environments.

    Parameters
    ----------
    algorithm : str
        As rl-zoo3 names it: ``"ppo"``, ``"a2c"``, ``"sac"``, ``"td3"`` or ``"tqc"``.

    Raises
    ------
    UnknownNameError
        If no such file ships.
    """
    with resources.as_file(resources.files("kinarm.data") / "zoo") as folder:
        files = {path.stem: path for path in sorted(folder.glob("*.yml"))}
    if algorithm not in files:
        raise UnknownNameError("algorithm", algorithm, files)
    return files[algorithm]
