"""The live page's server: what it tells, whom it answers, and what it keeps."""

import errno
import io
import socket
import struct
import threading
import urllib.error
import urllib.request
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest
import umsgpack
from live_pages import commands
from meshcat.geometry import Box

from kinarm.errors import InvalidInputError, OutputError
from kinarm.viewer.live_scene import LiveScene
from kinarm.viewer.live_server import LiveServer, _say_nothing_of_the_network
from kinarm.viewer.live_visits import MOST, judged


@pytest.fixture
def server():
    with LiveServer(0) as started:
        yield started


def asked(server, text, *, half_close=True):
    """Send bytes to the server, and return all that it answers."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as connection:
        connection.sendall(text)
        if half_close:
            connection.shutdown(socket.SHUT_WR)
        answer = io.BytesIO()
        try:
            while piece := connection.recv(65536):
                answer.write(piece)
        except ConnectionResetError:
            pass
        return answer.getvalue()


def get(address, host="localhost", extra=""):
    return f"GET {address} HTTP/1.1\r\nHost: {host}\r\n{extra}\r\n".encode()


class TestScene:
    def told(self, scene, number=0):
        told = [umsgpack.unpackb(command.content[4:]) for command in scene.since(number)]
        lengths = [struct.unpack("<I", command.content[:4])[0] for command in scene.since(number)]
        assert lengths == [len(command.content) - 4 for command in scene.since(number)]
        return [(each["path"], each["type"], each.get("value")) for each in told]

    def put(self, scene, path, kind="set_transform", **more):
        scene.add({"type": kind, "path": path, **more})

    def test_the_latest_of_each_kind_counts_in_the_order_in_which_they_came(self):
        scene = LiveScene()
        for path in ("/a", "/b", "/a"):
            self.put(scene, path)
        self.put(scene, "/a", "set_property", property="visible", value=True)
        self.put(scene, "/a", "set_property", property="position", value=1)
        self.put(scene, "/a", "set_property", property="visible", value=False)
        assert self.told(scene) == [
            *[("/b", "set_transform", None), ("/a", "set_transform", None)],
            *[("/a", "set_property", 1), ("/a", "set_property", False)],
        ]

    def test_news_are_what_came_after(self):
        scene = LiveScene()
        for path in ("/a", "/b"):
            self.put(scene, path)
        last = scene.since(0)[-1].number
        assert scene.since(last) == []
        self.put(scene, "/a")
        assert self.told(scene, last) == [("/a", "set_transform", None)]

    @pytest.mark.parametrize(("deleted", "left"), [("/a", ["/ab", "/c"]), ("/", []), ("", [])])
    def test_what_is_deleted_takes_all_below_it_along(self, deleted, left):
        scene = LiveScene()
        for path in ("/a", "/a/b", "/ab", "/c"):
            self.put(scene, path)
        self.put(scene, deleted, "delete")
        assert [path for path, *_ in self.told(scene)] == [*left, deleted]

    def test_what_is_drawn_again_and_again_takes_no_more_room(self):
        scene = LiveScene()
        for _ in range(1000):
            self.put(scene, "/trace", "delete")
            self.put(scene, "/trace", "set_object", object={})
        assert len(scene.since(0)) == 2


class TestPage:
    def test_the_files_of_a_page(self, server):
        with urllib.request.urlopen(server.address, timeout=60) as page:
            text = page.read().decode()
        for name in ("meshcat.js", "live_page.js"):
            assert f'src="{name}"' in text
            with urllib.request.urlopen(f"{server.address}{name}", timeout=60) as script:
                assert script.headers["Content-Type"].startswith("text/javascript")
                assert len(script.read()) == int(script.headers["Content-Length"]) > 500

    def test_a_page_is_told_what_there_is_and_what_comes(self, server):
        server.window["box"].set_object(Box([1, 1, 1]))
        told = commands(server.address)
        assert next(told)["path"] == "/meshcat/box"
        for number in range(20):
            server.window["box"].set_transform(np.eye(4) * number)
        while next(told)["matrix"][0] != 19:
            pass
        told.close()

    def test_many_commands_from_many_threads(self, server):
        def draw(name):
            for _ in range(50):
                server.window[name].set_transform(np.eye(4))

        threads = [threading.Thread(target=draw, args=(f"n{k}",)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        paths = {each["path"] for each in islice(commands(server.address), 4)}
        assert paths == {f"/meshcat/n{k}" for k in range(4)}


class TestRequests:
    @pytest.mark.parametrize(
        "host",
        ["localhost", "localhost:7000", "127.0.0.1:1", "127.9.9.9", "[::1]:7000", "LOCALHOST"],
    )
    def test_names_of_this_machine_are_answered(self, server, host):
        assert asked(server, get("/", host), half_close=False).startswith(b"HTTP/1.1 200 OK")

    @pytest.mark.parametrize(
        "host",
        [
            *("evil.example", "evil.example:7000", "127.0.0.1.evil.example", "localhost.evil.com"),
            *("10.0.0.1", "[fe80::1]", "[", "0.0.0.0", "a@localhost.evil", "::1x"),
        ],
    )
    @pytest.mark.parametrize("address", ["/", "/scene"])
    def test_names_that_only_point_here_are_not(self, server, host, address):
        extra = f"Origin: http://{host}\r\n"
        answer = asked(server, get(address, host, extra), half_close=False)
        assert answer.startswith(b"HTTP/1.1 403 Forbidden")

    @pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://localhost"])
    def test_pages_of_others_are_not(self, server, origin):
        answer = asked(server, get("/scene", extra=f"Origin: {origin}\r\n"), half_close=False)
        assert answer.startswith(b"HTTP/1.1 403 Forbidden")

    def test_a_page_of_its_own_may_say_so(self):
        request = get("/scene", "localhost:7000", "Origin: http://localhost:7000\r\n").decode()
        assert judged(request) == ("200 OK", "/scene")

    @pytest.mark.parametrize(
        ("text", "status"),
        [
            (get("/static/%00"), b"404"),
            (get("/../../etc/passwd"), b"404"),
            (get("//etc/passwd"), b"404"),
            (get("/\x00"), b"404"),
            (get("/?x=1"), b"200"),
            (get("/").replace(b"GET", b"POST"), b"405"),
            (get("/").replace(b"HTTP/1.1", b"HTTP/2"), b"400"),
            (b"GET / HTTP/1.1\r\n\r\n", b"400"),
            (b"\r\n\r\n", b"400"),
            (b"\xff\x00\r\n\r\n", b"400"),
            (b"x" * 20_000 + b"\r\n\r\n", b""),
            (b"GET / HTTP/1.1\r\nHost: localhost\r\n", b""),
            (b"", b""),
        ],
    )
    def test_odd_requests(self, server, capfd, text, status):
        answer = asked(server, text)
        assert answer.partition(b" ")[2][:3] == status
        assert asked(server, get("/"), half_close=False).startswith(b"HTTP/1.1 200")
        assert capfd.readouterr() == ("", "")

    def test_a_visit_is_one_request(self, server):
        assert asked(server, get("/") * 100, half_close=False).count(b"HTTP/1.1") <= 1


class TestVisitors:
    def test_one_who_leaves_is_forgotten(self, server, capfd):
        server.window["box"].set_object(Box([1, 1, 1]))
        for _ in range(20):
            with socket.create_connection(("127.0.0.1", server.port)) as connection:
                connection.sendall(get("/scene"))
        told = commands(server.address)
        for number in range(1, 5000):  # on a busy machine, news comes before farewells
            server.window["box"].set_transform(np.eye(4) * number)
            while next(told).get("matrix", [0])[0] != number:
                pass
            if len(server._reception._visits) == 1:
                break
        else:
            pytest.fail("visitors who left are still known")
        assert capfd.readouterr() == ("", "")

    def test_one_who_still_watches_at_the_end_is_no_error(self, capfd, caplog):
        with LiveServer() as server:
            server.window["box"].set_object(Box([1, 1, 1]))
            assert next(commands(server.address))["path"] == "/meshcat/box"
        assert (capfd.readouterr(), caplog.text) == (("", ""), "")

    @pytest.mark.parametrize(("kind", "text"), [("silent", b""), ("watching", get("/scene"))])
    def test_there_are_only_so_many_and_a_new_one_is_let_in(self, server, kind, text):
        server.window["box"].set_object(Box([1, 1, 1]))
        crowd = []
        for _ in range(2 * MOST[kind]):
            crowd.append(socket.create_connection(("127.0.0.1", server.port)))
            crowd[-1].sendall(text)
        assert next(commands(server.address))["path"] == "/meshcat/box"
        assert len(server._reception._visits) <= sum(MOST.values())
        for visitor in crowd:
            visitor.close()

    def test_one_who_never_reads_keeps_nobody_waiting(self, server):
        with socket.create_connection(("127.0.0.1", server.port)) as silent:
            silent.sendall(get("/scene"))
            told = commands(server.address)
            for number in range(40):
                server.window["box"].set_object(Box([number, 1, 1]))
                server.window["large"].set_property("value", "x" * 500_000)
            server.window["end"].set_transform(np.eye(4))
            while next(told)["path"] != "/meshcat/end":
                pass
            assert len(server._scene.since(0)) == 3


class TestPorts:
    def test_the_next_free_one(self, server):
        with LiveServer(server.port) as other:
            assert other.port > server.port

    @pytest.mark.parametrize("port", [-1, 65536, 10**9, "7000", 7000.0])
    def test_numbers_that_are_none(self, port):
        with pytest.raises(InvalidInputError, match="port must be"):
            LiveServer(port)

    def test_none_is_free(self):
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 65535))
            taken.listen()
            with pytest.raises(OutputError, match="cannot serve on port 65535: Address already"):
                LiveServer(65535)


def test_closing_again_does_nothing():
    with LiveServer(0) as server:
        server.close()
    assert not server._thread.is_alive()


def test_a_port_that_is_not_ours_to_take(monkeypatch):
    """The next ones are not tried: they are as little."""
    tried = []

    def refuse(address):
        tried.append(address[1])
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(socket, "create_server", refuse)
    with pytest.raises(OutputError, match="cannot serve on port 80: Permission denied"):
        LiveServer(80)
    assert tried == [80]


@pytest.mark.parametrize(("error", "told"), [(OSError(), False), (ValueError(), True)])
def test_breaking_connections_are_no_news(error, told):
    context, seen = {"message": "it broke", "exception": error}, []
    _say_nothing_of_the_network(SimpleNamespace(default_exception_handler=seen.append), context)
    assert seen == ([context] if told else [])
