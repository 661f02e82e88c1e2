"""Hostile visitors of the live page, while polite ones want to be answered.

``python -m tests.campaign.live_page --count 20000 --out data/results/campaign/live_page.json``
"""

import argparse
import multiprocessing
import random
import resource
import socket
import struct
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from .processes import PATIENCE, Subject, own_cache, started, write
from .record_page import write_page

CROWD = 2000
"""Connections that hostile visitors keep open at a time."""

PAUSE = 0.1
"""Between polite visits [s]."""

QUIET = 50
"""Polite visits before the hostile ones."""

SETTLING, STILL = 12.0, 2.0
"""Memory that changes less than that [MB] in so long [s] is settled."""

HOSTS = ("localhost", "127.0.0.1", "evil.example", "[::1]", "", "localhost:80", "x" * 5000, "\x00")
PATHS = (
    *("/", "/scene", "/meshcat.js", "/live_page.js", "/static/%00", "/%2e%2e/etc/passwd", "//"),
    *("/../../etc/passwd", "/\x00", "*", "http://evil.example/", "/scene?" + "x" * 20_000, "/é"),
)
UPGRADE = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"


def request(path: str, host: str = "localhost", more: str = "") -> bytes:
    """A request as browsers send it."""
    return f"GET {path} HTTP/1.1\r\nHost: {host}\r\n{more}\r\n".encode()


class Visitor:
    """A hostile visitor: does something odd, and may keep its connection."""

    def __init__(self, port: int, rng: random.Random) -> None:
        self._rng = rng
        self.connection = socket.create_connection(("127.0.0.1", port), timeout=5)

    def leaves(self) -> None:
        """Ask for the scene, read some of it or nothing, and be gone without a word."""
        self.connection.sendall(request("/scene"))
        if self._rng.random() < 0.5:
            self.connection.recv(self._rng.choice((1, 1000, 100_000)))
        linger = struct.pack("ii", 1, 0)  # what is on its way is dropped
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.connection.close()

    def never_reads(self) -> None:
        """Ask for much, and take nothing."""
        self.connection.sendall(request(self._rng.choice(("/scene", "/meshcat.js"))))

    def says_nothing(self) -> None:
        """Be there, and no more."""

    def says_half(self) -> None:
        """Begin a request."""
        text = request("/scene")
        self.connection.sendall(text[: self._rng.randrange(len(text))])

    def never_ends(self) -> None:
        """Send a head, or a body, that is too long."""
        head = self._rng.choice((b"GET /", request("/scene"), request("/")))
        self.connection.sendall(head)
        for _ in range(self._rng.randrange(64)):
            self.connection.sendall(b"x" * 65_536)

    def babbles(self) -> None:
        """Send bytes that are no request."""
        self.connection.sendall(self._rng.randbytes(self._rng.randrange(2000)) + b"\r\n\r\n")

    def asks_oddly(self) -> None:
        """Ask for what there is not, or by a name that is none of this machine's."""
        origin = self._rng.choice(("", f"Origin: http://{self._rng.choice(HOSTS)}\r\n"))
        self.connection.sendall(
            request(self._rng.choice(PATHS), self._rng.choice(HOSTS), origin)
            * self._rng.choice((1, 1, 500))
        )

    def frames(self) -> None:
        """Speak as over a websocket: frames that say that they are huge, and many small ones."""
        self.connection.sendall(request("/", more=UPGRADE) + request("/scene", more=UPGRADE))
        self.connection.sendall(b"\x82\xff" + b"\x7f" * 8 + b"\x00" * 4)
        self.connection.sendall(b"\x00\x80\x00\x00\x00\x00" * self._rng.randrange(5000))


ACTS: tuple[Callable[[Visitor], None], ...] = (
    Visitor.leaves,
    Visitor.never_reads,
    Visitor.says_nothing,
    Visitor.says_half,
    Visitor.never_ends,
    Visitor.babbles,
    Visitor.asks_oddly,
    Visitor.frames,
)


def pester(port: int, count: int, seed: int) -> None:
    """Visit so many times, in every way, with a crowd of connections that stay open."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    room = min(CROWD, hard - 100)
    rng, crowd = random.Random(seed), deque[Visitor]()
    for number in range(count):
        with suppress(OSError):
            crowd.append(Visitor(port, rng))
            ACTS[number % len(ACTS)](crowd[-1])
        if len(crowd) > room:
            crowd.popleft().connection.close()


@dataclass
class Record:
    """What came of the visits to a live page.

    Attributes
    ----------
    undisturbed, median_answer, slowest_answer : float
        How long polite visits took, until the first command of the scene was there: the slowest
        before hostile ones came, and all of them meanwhile [s].
    memory, peak_memory : float
        Resident memory of the command before and at its highest [MB].
    files, files_left : int
        Descriptors that it had open before, and some time after.
    """

    acts: int = 0
    polite_visits: int = 0
    undisturbed: float = 0.0
    median_answer: float = 0.0
    slowest_answer: float = 0.0
    memory: float = 0.0
    peak_memory: float = 0.0
    files: int = 0
    files_left: int = 0
    findings: dict[str, int] = field(default_factory=dict)

    def find(self, what: str) -> None:
        """Take note of something that is wrong."""
        self.findings[what] = self.findings.get(what, 0) + 1


def politely(port: int) -> float:
    """Get the page and the first command of its scene; return how long it took [s]."""
    began = time.monotonic()
    for path in ("/", "/scene"):
        with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
            connection.sendall(request(path))
            answer = b""
            while len(answer.partition(b"\r\n\r\n")[2]) < 100:
                piece = connection.recv(4096)
                if not piece:
                    raise ConnectionError
                answer += piece
            if not answer.startswith(b"HTTP/1.1 200 OK\r\n"):
                raise ConnectionError
    return time.monotonic() - began


@contextmanager
def live_page(folder: Path) -> Iterator[tuple[int, int]]:
    """A command that serves a live page; its process and its port."""
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    options = ("--policy", "zero", "--problem", "left", "--live", "--no-browser")
    subject = Subject("kinarm-replay", (*options, "--port", str(port)))
    with started(subject.spelled(as_module=True), folder) as process:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline and process.poll() is None:
            with suppress(OSError):
                politely(port)
                break
            time.sleep(0.1)
        yield process.pid, port


def _memory(pid: int, entry: str) -> float:
    """An entry of a process's status [MB]."""
    text = Path(f"/proc/{pid}/status").read_text()
    return round(int(text.partition(entry)[2].split(maxsplit=1)[0]) / 1024, 1)


def _settled_memory(pid: int) -> float:
    """Resident memory when it no longer grows: the first trials may compile. Its peak is reset."""
    deadline, before = time.monotonic() + PATIENCE, 0.0
    while time.monotonic() < deadline:
        now = _memory(pid, "VmRSS:")
        if abs(now - before) < STILL:
            break
        before = now
        time.sleep(SETTLING)
    Path(f"/proc/{pid}/clear_refs").write_text("5")
    return before


def _files(pid: int) -> int:
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def campaign(count: int, seed: int, most_memory: float = 50.0) -> Record:
    """Let hostile visitors come so many times, and polite ones all the while.

    A command that takes more than ``most_memory`` in addition is a finding [MB].
    """
    record = Record(acts=count)
    with own_cache(), TemporaryDirectory() as name:
        folder = Path(name)
        with live_page(folder) as (pid, port):
            record.memory, record.files = _settled_memory(pid), _files(pid)
            record.undisturbed = round(max(politely(port) for _ in range(QUIET)), 3)
            answers: list[float] = []
            hostile = multiprocessing.get_context("spawn").Process(
                target=pester, args=(port, count, seed)
            )
            hostile.start()
            while hostile.is_alive():
                answers += _visit(record, port)
                time.sleep(PAUSE)
            hostile.join()
            answers += _visit(record, port)
            record.polite_visits = len(answers)
            record.median_answer = round(float(np.median(answers)), 3)
            record.slowest_answer = round(max(answers), 3)
            record.files_left = _files_when_all_left(pid, record.files)
            record.peak_memory = _memory(pid, "VmHWM:")
        if record.peak_memory - record.memory > most_memory:
            record.find(f"takes more than {most_memory} MB")
        if record.files_left > record.files:
            record.find("leaves descriptors open")
        for line in (folder / "err").read_text().splitlines()[:1]:
            record.find(f"prints {line!r}")
    return record


def _visit(record: Record, port: int) -> list[float]:
    """How long a polite visit takes [s]; none if it fails."""
    try:
        return [politely(port)]
    except OSError as error:
        record.find(f"a polite visitor gets {type(error).__name__}")
        return []


def _files_when_all_left(pid: int, before: int) -> int:
    """Open descriptors, after some patience."""
    deadline = time.monotonic() + PATIENCE
    while _files(pid) > before and time.monotonic() < deadline:
        time.sleep(0.1)
    return _files(pid)


def main() -> None:
    """Run the large campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    record = campaign(given.count, given.seed)
    parts: dict[str, Any] = asdict(record)
    write(given.out, "live_page", {"visits": record.acts}, sum(record.findings.values()), parts)
    if given.out:
        write_page(given.out, {"live page": parts})
    sys.exit(1 if record.findings else 0)


if __name__ == "__main__":
    main()
