"""What a process holds: memory, threads, processes, ports, open files and temporary files."""

import gc
from pathlib import Path
from typing import NamedTuple

LISTENING = "0A"
"""State of a listening socket in ``/proc/net/tcp``."""


class Census(NamedTuple):
    """What a process holds at a moment.

    Attributes
    ----------
    resident : float
        Memory in RAM [MB].
    threads, children, ports, descriptors : int
        Threads, child processes, ports that it listens on, and open files and sockets.
    outlasting : int
        Processes of the sessions that it started and left behind.
    files : int
        Files and folders in the folder for temporary files, and in that of outputs.
    """

    resident: float
    threads: int
    children: int
    ports: int
    descriptors: int
    outlasting: int
    files: int


COUNTED = Census._fields[1:]
"""What must not grow at all."""


def take_census(folders: list[Path], sessions: set[int]) -> Census:
    """Count what this process holds, after a collection of garbage.

    Parameters
    ----------
    folders : list of Path
        Folders of temporary files and of outputs.
    sessions : set of int
        Sessions of the processes that it started and that have ended.
    """
    gc.collect()
    own = Path("/proc/self")
    status = dict(line.split(":", 1) for line in (own / "status").read_text().splitlines())
    open_files = [_target(link) for link in (own / "fd").iterdir()]
    return Census(
        resident=int(status["VmRSS"].split()[0]) / 1024,
        threads=int(status["Threads"]),
        children=sum(len(task.read_text().split()) for task in own.glob("task/*/children")),
        ports=len(_listening() & set(open_files)),
        descriptors=len(open_files),
        outlasting=_alive_in(sessions),
        files=sum(1 for folder in folders for _ in folder.rglob("*")),
    )


def _target(link: Path) -> str:
    """What a descriptor stands for; nothing if it is closed by now."""
    try:
        return str(link.readlink())
    except OSError:
        return ""


def _listening() -> set[str]:
    """Sockets of this machine that listen, as the links of descriptors name them."""
    found = set()
    for table in ("tcp", "tcp6"):
        rows = [row.split() for row in Path(f"/proc/net/{table}").read_text().splitlines()[1:]]
        found |= {f"socket:[{row[9]}]" for row in rows if row[3] == LISTENING}
    return found


def _alive_in(sessions: set[int]) -> int:
    """How many processes belong to some sessions."""
    count = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has just ended
            continue
        count += int(fields[3]) in sessions
    return count
