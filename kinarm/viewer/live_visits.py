"""Visits to a live page, which serves three files to this machine alone.

Visitors may be slow, silent, rude or many. They can neither delay others nor fill the memory. Each
has its own task, which sends piece by piece, within a time limit. The task reads a visitor until
its request ends, and never again. The number of visits of each kind is limited: a new one ends the
least promising.
"""

import asyncio
import ipaddress
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import NamedTuple, NoReturn
from urllib.parse import urlsplit

from kinarm.viewer.live_scene import LiveScene

LONGEST_REQUEST = 16_384
"""A request may be so long [bytes]."""

PIECE = 65_536
"""So much is on its way to a visitor at a time [bytes]."""

PATIENCE = 10.0
"""So long a request may take to come, and a piece to be taken [s]."""

AT_ONCE, WAITING = 16, 1024
"""So many visitors are let in at a time, and may wait to be."""

MOST = {"silent": 64, "served": 64, "watching": 32}
"""Visits of each kind: without a request yet, with an answer that ends, and with the scene."""


class File(NamedTuple):
    """What is behind an address that does not change."""

    kind: str
    content: bytes


class Visit:
    """A connection.

    Parameters
    ----------
    writer : asyncio.StreamWriter
        Where answers go.
    """

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self.kind = "silent"
        self.seen = 0
        self.news = asyncio.Event()
        writer.transport.set_write_buffer_limits(high=0)  # draining waits until all is gone

    def end(self) -> None:
        """Let go of the visitor at once."""
        self._writer.transport.abort()

    async def pour(self, content: bytes) -> None:
        """Send bytes, piece by piece.

        Raises
        ------
        OSError
            If the visitor leaves or takes too long (TimeoutError).
        """
        for begin in range(0, len(content), PIECE):
            self._writer.write(content[begin : begin + PIECE])
            async with asyncio.timeout(PATIENCE):
                await self._writer.drain()

    async def answer(self, status: str, kind: str, content: bytes | None) -> None:
        """Send a whole answer, or the head of one that has no end; raises as `pour` does."""
        head = [f"HTTP/1.1 {status}", f"Content-Type: {kind}", "Cache-Control: no-store"]
        head += ["X-Content-Type-Options: nosniff", "Connection: close"]
        if content is not None:
            head.append(f"Content-Length: {len(content)}")
        await self.pour("\r\n".join([*head, "", ""]).encode("latin-1") + (content or b""))


class Reception:
    """Receives visitors, in the thread of its event loop.

    Parameters
    ----------
    files : mapping of str to File
        What does not change, by address.
    scene : LiveScene
        What does: behind the address ``/scene``, a stream of commands without end.
    """

    def __init__(self, files: Mapping[str, File], scene: LiveScene) -> None:
        self._files, self._scene = files, scene
        self._visits: dict[Visit, None] = {}

    async def open(self, listening: socket.socket) -> asyncio.Server:
        """Let visitors in that come to a socket."""
        server = await asyncio.start_server(
            self._receive, sock=listening, limit=LONGEST_REQUEST, backlog=AT_ONCE
        )
        listening.listen(WAITING)  # asyncio has one number for both
        return server

    def tell(self) -> None:
        """Notify the watching visitors of a change."""
        for visit in self._visits:
            visit.news.set()

    def close(self) -> None:
        """Let everybody go."""
        for visit in self._visits:
            visit.end()

    async def _receive(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer a visitor's one request."""
        visit = Visit(writer)
        self._visits[visit] = None
        self._make_room(visit)
        try:
            # It is cancelled by the end of the server alone, which asyncio reports as an error.
            with suppress(OSError, EOFError, asyncio.LimitOverrunError, asyncio.CancelledError):
                async with asyncio.timeout(PATIENCE):
                    request = await reader.readuntil(b"\r\n\r\n")
                await self._answer(visit, request.decode("latin-1"), reader)
        finally:
            del self._visits[visit]
            visit.end()

    async def _answer(self, visit: Visit, request: str, reader: asyncio.StreamReader) -> None:
        """Send what is asked for, or say why not."""
        status, address = judged(request)
        file = self._files.get(address)
        if status == "200 OK" and address == "/scene":
            self._promote(visit, "watching")
            leaving = asyncio.create_task(_end_when_left(visit, reader))
            try:
                await visit.answer(status, "application/octet-stream", None)
                await self._show(visit)
            finally:
                leaving.cancel()
        if status == "200 OK" and file is None:
            status = "404 Not Found"
        self._promote(visit, "served")
        if file is None or status != "200 OK":
            file = File("text/plain", f"{status}\n".encode())
        await visit.answer(status, file.kind, file.content)

    async def _show(self, visit: Visit) -> NoReturn:
        """Send the scene, and what changes of it, as fast as it is taken, until that fails."""
        while True:
            visit.news.clear()
            for command in self._scene.since(visit.seen):
                await visit.pour(command.content)
                visit.seen = command.number
            await visit.news.wait()

    def _promote(self, visit: Visit, kind: str) -> None:
        """Take note of what a visit turns out to be."""
        visit.kind = kind
        self._make_room(visit)

    def _make_room(self, newest: Visit) -> None:
        """If there are too many visits of a kind, end the one that is farthest behind."""
        others = [visit for visit in self._visits if visit.kind == newest.kind]
        others.remove(newest)
        if len(others) >= MOST[newest.kind]:
            min(others, key=lambda visit: visit.seen).end()  # the oldest of equals


async def _end_when_left(visit: Visit, reader: asyncio.StreamReader) -> None:
    """A page that watches says nothing more: what comes is its leaving, or none of its."""
    with suppress(OSError):
        await reader.read(1)
    visit.end()


def judged(request: str) -> tuple[str, str]:
    """The status of a request, and the address that it asks for.

    Only a page of this machine's own is answered: other names in ``Host`` come of sites that make
    theirs point here, another ``Origin`` of those that ask openly.
    """
    first, *lines = request.split("\r\n")
    fields = {name.strip().lower(): value.strip() for name, _, value in map(_parted, lines)}
    method, _, rest = first.partition(" ")
    address, _, version = rest.partition(" ")
    host, origin = fields.get("host", ""), fields.get("origin")
    if not version.startswith("HTTP/1.") or not host:
        return "400 Bad Request", address
    if not _is_local(host) or origin not in (None, f"http://{host}"):
        return "403 Forbidden", address
    if method != "GET":
        return "405 Method Not Allowed", address
    return "200 OK", address.partition("?")[0]


def _parted(line: str) -> tuple[str, str, str]:
    return line.partition(":")


def _is_local(host: str) -> bool:
    """Whether a name with or without a port is one of this machine's for itself."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    except ValueError:
        return False
