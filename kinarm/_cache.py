"""A cache of computed results in the user's cache folder, for later processes."""

import hashlib
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from kinarm._archive import Arrays, load_archive, save_archive
from kinarm._files import check_folder
from kinarm.errors import InvalidInputError, OutputError

CACHE_VARIABLE = "KINARM_CACHE"
"""Environment variable that names another cache folder."""


def cache_folder() -> Path:
    """Folder of the cache: ``$KINARM_CACHE``, or ``kinarm`` in the user's cache folder."""
    chosen, users = os.environ.get(CACHE_VARIABLE), os.environ.get("XDG_CACHE_HOME")
    if chosen:
        return Path(chosen)
    try:
        return (Path(users) if users else Path.home() / ".cache") / "kinarm"
    except RuntimeError:  # a user without a home
        return Path(tempfile.gettempdir()) / "kinarm"


def cached_arrays(
    kind: str, version: int, made_of: bytes, make: Callable[[], Mapping[str, ArrayLike]]
) -> Arrays:
    """Look arrays up, or make and keep them.

    A file that cannot be read is replaced; where none can be written, nothing is kept.

    Parameters
    ----------
    kind : str
        What they are, one word.
    version : int
        To be raised when the same content makes other arrays.
    made_of : bytes
        Everything that they depend on.
    make : callable
        Makes them.
    """
    path = cache_folder() / f"{kind}-{hashlib.sha256(made_of).hexdigest()[:24]}.npz"
    with suppress(InvalidInputError):
        return load_archive(path, kind, version, InvalidInputError).arrays
    arrays = {name: np.asarray(array) for name, array in make().items()}
    with suppress(OutputError):
        check_folder(path.parent)
        save_archive(path, kind, version, arrays, {})
    return arrays
