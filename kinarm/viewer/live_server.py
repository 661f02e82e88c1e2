"""Meshcat's own server, in a thread of this process and for this machine alone."""

import asyncio
import errno
import socket
import threading
from typing import Any

import tornado.web
import umsgpack
from meshcat import Visualizer
from meshcat.servers.zmqserver import (
    VIEWER_HTML,
    VIEWER_ROOT,
    StaticFileHandlerNoCache,
    WebSocketHandler,
    ZMQWebSocketBridge,
)
from tornado.httpserver import HTTPServer
from tornado.websocket import WebSocketClosedError

from kinarm.errors import OutputError

HOST = "127.0.0.1"
PORT = 7000
PORTS_TRIED = 100


class _Socket(WebSocketHandler):
    """A browser that watches, without the messages that Meshcat prints about it."""

    def open(self, *_: str, **__: str) -> None:
        self.bridge.websocket_pool.add(self)
        self.bridge.send_scene(self)

    def on_close(self) -> None:
        self.bridge.websocket_pool.discard(self)

    def write_message(self, message: Any, binary: bool = False) -> "asyncio.Future[None]":
        """Send a message; a browser that has left, even while this was sent, is forgotten."""
        sent: asyncio.Future[None]
        try:
            sent = super().write_message(message, binary)
        except WebSocketClosedError:
            sent = asyncio.get_running_loop().create_future()
            sent.cancel()
        sent.add_done_callback(self._sent)
        return sent

    def _sent(self, sent: "asyncio.Future[None]") -> None:
        """Take note of how sending a message ended."""
        if sent.cancelled() or sent.exception() is not None:
            self.on_close()


class _Application(tornado.web.Application):
    """Meshcat's pages, for this machine only."""

    def listen(self, port: int, **settings: Any) -> HTTPServer:  # type: ignore[override]
        listening = socket.create_server((HOST, port))  # closed again if the port is taken
        listening.setblocking(False)
        self.server = HTTPServer(self, **settings)
        self.server.add_socket(listening)
        return self.server


class _Bridge(ZMQWebSocketBridge):
    """Meshcat's server without its ZeroMQ port, listening to this machine only."""

    def make_app(self) -> _Application:
        files = {"path": VIEWER_ROOT, "default_filename": VIEWER_HTML}
        return _Application(
            [(r"/static/(.*)", StaticFileHandlerNoCache, files), (r"/", _Socket, {"bridge": self})]
        )

    def setup_zmq(self, url: str) -> tuple["_Bridge", None, str]:
        return self, None, url

    def forward_to_websockets(self, frames: list[bytes]) -> None:
        """Pass a drawing command on; browsers may leave meanwhile."""
        for watching in tuple(self.websocket_pool):
            watching.write_message(frames[2], binary=True)

    def send(self, _: bytes) -> None:
        """Take the answers that would go to ZeroMQ."""

    async def close(self) -> None:
        """Let the browsers go, and stop listening."""
        self.app.server.stop()
        for watching in set(self.websocket_pool):
            watching.ws_connection.stream.close()
        await self.app.server.close_all_connections()


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
    OutputError
        If no port is free.
    """

    def __init__(self, port: int = PORT) -> None:
        self.port = port
        self._failure: OSError | None = None
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._run, name="kinarm live", daemon=True)
        self._thread.start()
        self._started.wait()
        if self._failure is not None:
            raise OutputError(f"cannot serve on port {port}: {self._failure.strerror}")
        self.window = Visualizer(window=self)

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        return f"http://{HOST}:{self.port}/static/"

    def send(self, command: Any) -> None:
        """Pass a drawing command on; Meshcat calls this."""
        described = command.lower()
        frames = [described["type"].encode(), described["path"].encode(), umsgpack.packb(described)]
        self._loop.call_soon_threadsafe(self._bridge.handle_zmq, frames)

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
        try:
            asyncio.run(self._serve())
        except OSError as error:
            self._failure = error
            self._started.set()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._over = asyncio.Event()
        self._bridge = self._listening_bridge()
        self._started.set()
        await self._over.wait()
        await self._bridge.close()

    def _listening_bridge(self) -> _Bridge:
        """Open the port, or the next free one."""
        last = self.port + PORTS_TRIED
        while True:
            try:
                return _Bridge(zmq_url="", host=HOST, port=self.port)
            except OSError as error:
                if error.errno != errno.EADDRINUSE or self.port >= min(last, 65535):
                    raise
                self.port += 1
