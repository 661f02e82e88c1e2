"""The user's cache folder: what was computed once and can be computed anew."""

import os
import tempfile
from contextlib import suppress
from pathlib import Path

CACHE_VARIABLE = "KINARM_CACHE"
"""Environment variable that names another cache folder."""


def cache_folder() -> Path:
    """Folder for what can be computed anew: ``$KINARM_CACHE``, or kinarm in the user's cache."""
    chosen, users = os.environ.get(CACHE_VARIABLE), os.environ.get("XDG_CACHE_HOME")
    if chosen:
        return Path(chosen)
    try:
        return (Path(users) if users else Path.home() / ".cache") / "kinarm"
    except RuntimeError:  # a user without a home
        return Path(tempfile.gettempdir()) / "kinarm"


def delete_least_recently_used(folder: Path, stem: str, most_files: int, most_bytes: int) -> None:
    """Delete ``.npz`` files that are too many or too large together; the latest one stays.

    Whatever other processes do to them meanwhile. What a process that was killed left half written
    counts, too.

    Parameters
    ----------
    folder : Path
        Where the files lie.
    stem : str
        What their names begin with.
    most_files, most_bytes : int
        How many may stay, and how large they may be together.
    """
    used = []
    for path in (*folder.glob(f"{stem}-*.npz"), *folder.glob(f".{stem}-*.npz.*")):
        with suppress(OSError):
            status = path.stat()
            used.append((status.st_mtime_ns, status.st_size, path))
    total = 0
    for rank, (_, size, path) in enumerate(sorted(used, reverse=True)):
        total += size
        if rank > 0 and (rank >= most_files or total > most_bytes):
            with suppress(OSError):
                path.unlink()
