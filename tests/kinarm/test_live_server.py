"""The live page: what browsers are sent, and those that come and go."""

import asyncio
import socket
import time
import urllib.request

import numpy as np
import pinocchio as pin
import pytest
import umsgpack
from tornado.websocket import websocket_connect

from kinarm.problem import PROBLEMS
from kinarm.viewer import live_stage
from kinarm.viewer.live_server import LiveServer
from kinarm.viewer.live_stage import LiveStage

PATIENCE = 20.0


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def server():
    with LiveServer(free_port()) as running:
        yield running


@pytest.fixture
def stage(server, simulator):
    return LiveStage(server, PROBLEMS["left"], simulator.arm)


def listens(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def leave(browser):
    """Close the connection at once, without a word."""
    if browser.protocol is not None:
        browser.protocol.stream.close()
    browser.close()


async def received(port, last):
    """What a browser is sent, up to a message of a type and path."""
    browser, messages = await websocket_connect(f"ws://127.0.0.1:{port}/"), []
    while not messages or (messages[-1]["type"], messages[-1]["path"]) != last:
        answer = await asyncio.wait_for(browser.read_message(), PATIENCE)
        messages.append(umsgpack.unpackb(answer))
    leave(browser)
    return messages


def until(condition):
    """Wait for what another thread brings about."""
    for _ in range(int(PATIENCE / 0.01)):
        if condition():
            return True
        time.sleep(0.01)
    return False


def watching(server):
    return len(server._bridge.websocket_pool)


def test_page_is_served_until_it_is_closed():
    server = LiveServer(free_port())
    with urllib.request.urlopen(server.address) as page:
        assert b"MeshCat" in page.read()
    server.close()
    assert not listens(server.port)
    server.close()  # nothing is left to close


def test_a_port_that_is_taken_is_passed_over(server):
    with LiveServer(server.port) as other:
        assert other.port > server.port
        assert listens(other.port)


def test_browser_sees_the_arm_where_pinocchio_has_it(server, stage, simulator):
    q = np.array([0.3, 0.4, -0.2, 0.5, 0.7, -1.0])
    stage.begin(q, [0.1, 0.5, 0.4])
    stage.server.window["last"].set_transform(np.eye(4))
    sent = asyncio.run(received(server.port, ("set_transform", "/meshcat/last")))
    matrices = {
        message["path"]: np.array(message["matrix"]).reshape(4, 4).T
        for message in sent
        if message["type"] == "set_transform"
    }
    np.testing.assert_allclose(matrices["/meshcat/goal"][:3, 3], [0.1, 0.5, 0.4], atol=1e-6)
    model = simulator.arm.model
    data, path, pose = model.createData(), "/meshcat/arm", np.eye(4)
    pin.forwardKinematics(model, data, q)
    for joint in range(1, simulator.arm.n_joints + 1):
        path += f"/axis_{joint}"
        pose = pose @ matrices[path]
        np.testing.assert_allclose(pose, data.oMi[joint].homogeneous, atol=1e-6)


def test_browsers_that_leave_in_the_middle_are_forgotten(server, stage):
    async def come_and_leave():
        for _ in range(8):
            browser = await websocket_connect(f"ws://127.0.0.1:{server.port}/")
            await asyncio.wait_for(browser.read_message(), PATIENCE)
            leave(browser)

    asyncio.run(come_and_leave())

    def all_gone():
        stage.show(np.zeros(6))
        return watching(server) == 0

    assert until(all_gone)
    stage.begin(np.zeros(6), [0.1, 0.5, 0.4])
    sent = asyncio.run(received(server.port, ("set_transform", "/meshcat/goal")))
    assert len(sent) > 1


def test_closing_lets_browsers_go(server, stage):
    async def stay():
        browser = await websocket_connect(f"ws://127.0.0.1:{server.port}/")
        await asyncio.wait_for(browser.read_message(), PATIENCE)
        await asyncio.to_thread(stage.close)
        while await asyncio.wait_for(browser.read_message(), PATIENCE) is not None:
            pass
        leave(browser)

    asyncio.run(stay())
    assert not listens(server.port)


def test_an_opened_stage_is_shown(monkeypatch, simulator):
    shown = []
    monkeypatch.setattr(live_stage.webbrowser, "open", shown.append)
    stage = LiveStage.opened(PROBLEMS["left"], simulator.arm)
    assert shown == [stage.server.address]
    stage.close()


def test_pace_is_kept(stage, monkeypatch):
    now, slept = [100.0], []

    def sleep(seconds):
        slept.append(seconds)
        now[0] += seconds

    monkeypatch.setattr(live_stage.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(live_stage.time, "sleep", sleep)
    stage.pace(0.5)
    now[0] += 0.2
    stage.pace(0.5)
    now[0] += 0.9
    stage.pace(0.5)
    np.testing.assert_allclose(slept, [0.0, 0.3, 0.0], atol=1e-9)
