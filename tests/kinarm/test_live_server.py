"""The live page's server: what it tells, and where it listens."""

import socket

import numpy as np
import pytest
from live_pages import commands, told
from meshcat.geometry import Box

from kinarm.viewer.drawing import DrawnScene
from kinarm.viewer.live_server import LiveServer


@pytest.fixture
def server():
    with LiveServer(0) as started:
        yield started


ASKED = b"GET /meshcat.js HTTP/1.1\r\nHost: localhost\r\n\r\n"


class TestScene:
    def seen(self, scene, since=0):
        found = told(scene.news(since))[1]
        return [(command["path"], command["type"], command.get("value")) for command in found]

    def put(self, scene, path, kind="set_transform", **more):
        scene.add({"type": kind, "path": path, **more})

    def test_the_latest_of_each_kind_counts_in_the_order_in_which_they_came(self):
        scene = DrawnScene()
        for path in ("/a", "/b", "/a"):
            self.put(scene, path)
        self.put(scene, "/a", "set_property", property="visible", value=True)
        self.put(scene, "/a", "set_property", property="position", value=1)
        self.put(scene, "/a", "set_property", property="visible", value=False)
        assert self.seen(scene) == [
            *[("/b", "set_transform", None), ("/a", "set_transform", None)],
            *[("/a", "set_property", 1), ("/a", "set_property", False)],
        ]

    def test_news_are_what_came_since(self):
        scene = DrawnScene()
        for path in ("/a", "/b"):
            self.put(scene, path)
        since, found = told(scene.news(0))
        assert (since, len(found)) == (2, 2)
        assert told(scene.news(since)) == (2, [])
        self.put(scene, "/a")
        assert self.seen(scene, since) == [("/a", "set_transform", None)]

    @pytest.mark.parametrize(("deleted", "left"), [("/a", ["/ab", "/c"]), ("/", []), ("", [])])
    def test_what_is_deleted_takes_all_below_it_along(self, deleted, left):
        scene = DrawnScene()
        for path in ("/a", "/a/b", "/ab", "/c", "/end"):
            self.put(scene, path)
        self.put(scene, deleted, "delete")
        self.put(scene, "/end")
        found = [path for path, *_ in self.seen(scene)]
        assert found == [*left, deleted, "/end"]


class TestPage:
    def test_a_page_is_told_what_there_is_and_what_comes(self, server):
        server.window["box"].set_object(Box([1, 1, 1]))
        seen = commands(server.address)
        assert next(seen)["path"] == "/meshcat/box"
        for number in range(20):
            server.window["box"].set_transform(np.eye(4) * number)
        while next(seen)["matrix"][0] != 19:
            pass

    def test_one_who_leaves_or_never_reads_keeps_nobody_waiting(self, server, capfd):
        with socket.create_connection(("127.0.0.1", server.port)) as leaving:
            leaving.sendall(ASKED)
        with socket.create_connection(("127.0.0.1", server.port)) as silent:
            silent.sendall(ASKED)
            seen = commands(server.address)
            for number in range(40):
                server.window["box"].set_object(Box([number, 1, 1]))
                server.window["large"].set_property("value", "x" * 500_000)
            server.window["end"].set_transform(np.eye(4))
            while next(seen)["path"] != "/meshcat/end":
                pass
        assert capfd.readouterr() == ("", "")


class TestPorts:
    def test_this_machine_alone_is_served(self, server):
        """127.0.0.2 is this machine too, and would answer if every interface were bound."""
        with socket.socket() as probe:
            assert probe.connect_ex(("127.0.0.2", server.port)) != 0

    def test_another_one_if_it_is_taken(self, server):
        with LiveServer(server.port) as other:
            assert other.port != server.port

    def test_closed_again_and_opened_again(self):
        with LiveServer(0) as server:
            server.window["box"].set_object(Box([1, 1, 1]))
            seen = commands(server.address)
            assert next(seen)["path"] == "/meshcat/box"
        with pytest.raises(OSError, match="refused"):
            next(seen)
        with LiveServer(server.port) as again:
            assert again.port == server.port
