"""What the campaign knows of something that reads files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .mutations import Mutation


@dataclass(frozen=True)
class Loader:
    """Something that reads files.

    Parameters
    ----------
    reads : tuple of str
        Functions of the project in which the reading takes place.
    samples : callable
        Makes the content of valid files.
    mutate : callable
        Damages such a content.
    load : callable
        Reads a file, and makes of it what a command would.
    file : str
        Where the file lies in its folder.
    prepare : callable
        Fills the folder with what lies beside the file.
    needs : str
        Module that comes with an extra, without which it reads nothing.
    """

    reads: tuple[str, ...]
    samples: Callable[[], Sequence[bytes]]
    mutate: Mutation
    load: Callable[[Path], object]
    file: str = "file.npz"
    prepare: Callable[[Path], object] = lambda folder: None
    needs: str = ""
