"""The live page's server: what it tells, and where it listens."""

import socket

import numpy as np
import pytest
from live_pages import commands
from meshcat.geometry import Box

from kinarm.viewer.live_server import LiveServer


@pytest.fixture
def server():
    with LiveServer(0) as started:
        yield started


SCENE = b"GET /scene HTTP/1.1\r\nHost: localhost\r\n\r\n"


class TestPage:
    def test_a_page_is_told_what_there_is_and_what_comes(self, server):
        server.window["box"].set_object(Box([1, 1, 1]))
        told = commands(server.address)
        assert next(told)["path"] == "/meshcat/box"
        for number in range(20):
            server.window["box"].set_transform(np.eye(4) * number)
        while next(told)["matrix"][0] != 19:
            pass
        told.close()

    def test_one_who_leaves_or_never_reads_keeps_nobody_waiting(self, server, capfd):
        with socket.create_connection(("127.0.0.1", server.port)) as leaving:
            leaving.sendall(SCENE)
        with socket.create_connection(("127.0.0.1", server.port)) as silent:
            silent.sendall(SCENE)
            told = commands(server.address)
            for number in range(40):
                server.window["box"].set_object(Box([number, 1, 1]))
                server.window["large"].set_property("value", "x" * 500_000)
            server.window["end"].set_transform(np.eye(4))
            while next(told)["path"] != "/meshcat/end":
                pass
        assert capfd.readouterr() == ("", "")


class TestPorts:
    def test_this_machine_alone_is_served(self, server):
        """127.0.0.2 is this machine too, and would answer if every interface were bound."""
        with socket.socket() as probe:
            assert probe.connect_ex(("127.0.0.2", server.port)) != 0

    def test_the_next_free_one(self, server):
        with LiveServer(server.port) as other:
            assert other.port > server.port

    def test_closed_again_and_opened_again(self):
        with LiveServer(0) as server:
            told = commands(server.address)
            server.window["box"].set_object(Box([1, 1, 1]))
            assert next(told)["path"] == "/meshcat/box"
        server.close()
        assert [*told] == []
        with LiveServer(server.port) as again:
            assert again.port == server.port
