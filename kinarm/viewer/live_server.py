"""A scene served to browsers of this machine while it is drawn, by a thread of this process."""

import asyncio
import errno
import socket
import threading
from functools import cache
from importlib import resources
from typing import Any

from meshcat import Visualizer

from kinarm._validation import whole_number
from kinarm.errors import InvalidInputError, OutputError
from kinarm.viewer.live_scene import LiveScene
from kinarm.viewer.live_visits import File, Reception

HOST = "127.0.0.1"
PORT, LAST_PORT = 7000, 65535
PORTS_TRIED = 100


class LiveServer:
    """Serves a scene to browsers on this machine while it is drawn; use it in a ``with`` block.

    It runs in a thread and ends with the process, however that ends.

    Parameters
    ----------
    port : int
        Port to listen on; the next free one if it is taken.

    Attributes
    ----------
    port : int
        Port that it listens on.
    window : meshcat.Visualizer
        What to draw on.

    Raises
    ------
    InvalidInputError
        If there is no such port.
    OutputError
        If no port is free.
    """

    def __init__(self, port: int = PORT) -> None:
        self._listening = _listening_socket(port)
        self.port = self._listening.getsockname()[1]
        self._scene = LiveScene()
        self._reception = Reception(_files(), self._scene)
        self._loop = asyncio.new_event_loop()
        self._over = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="kinarm live", daemon=True)
        self._thread.start()
        self.window = Visualizer(window=self)

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        return f"http://{HOST}:{self.port}/"

    def send(self, command: Any) -> None:
        """Pass a drawing command on; Meshcat calls this."""
        self._scene.add(command.lower())
        self._loop.call_soon_threadsafe(self._reception.tell)

    def close(self) -> None:
        """Stop serving."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._over.set)
            self._thread.join()

    def __enter__(self) -> "LiveServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        self._loop.set_exception_handler(_say_nothing_of_the_network)
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        server = await self._reception.open(self._listening)
        await self._over.wait()
        server.close()
        self._reception.close()


def _say_nothing_of_the_network(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """Connections that break, and descriptors that are used up, are no news to a user."""
    if not isinstance(context.get("exception"), OSError):
        loop.default_exception_handler(context)


def _listening_socket(port: int) -> socket.socket:
    """Open the port, or the next free one."""
    if whole_number("port", port, 0) > LAST_PORT:
        raise InvalidInputError(f"port must be at most {LAST_PORT}, got {port}")
    for candidate in range(port, min(port + PORTS_TRIED, LAST_PORT) + 1):
        try:
            return socket.create_server((HOST, candidate))
        except OSError as error:
            reason = error.strerror
            if error.errno != errno.EADDRINUSE:
                break
    raise OutputError(f"cannot serve on port {port}: {reason}")


@cache
def _files() -> dict[str, File]:
    """What a page consists of, by address."""
    own = resources.files("kinarm.viewer")
    page, script = own / "live_page.html", own / "live_page.js"
    meshcat = resources.files("meshcat") / "viewer/dist/main.min.js"
    return {
        "/": File("text/html; charset=utf-8", page.read_bytes()),
        "/live_page.js": File("text/javascript; charset=utf-8", script.read_bytes()),
        "/meshcat.js": File("text/javascript; charset=utf-8", meshcat.read_bytes()),
    }
