"""``kinarm-replay --live``: a page of its own server, and what is left when it ends."""

import signal
import socket
import subprocess
import urllib.request
from pathlib import Path

import pytest


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def live(command):
    """Start the live page; whatever happens, it does not outlast the test."""
    started = []

    def start(port):
        options = ("--policy", "zero", "--problem", "left", "--live", "--no-browser")
        process = subprocess.Popen(
            command("kinarm-replay", *options, "--port", port),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            # A background job inherits that Ctrl-C is ignored.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        started.append(process)
        return process, process.stdout.readline()

    yield start
    for process in started:
        process.kill()
        process.communicate()


def children(pid: int) -> list[str]:
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [child for task in tasks for child in task.read_text().split()]


def listens(port: int, host: str = "127.0.0.1") -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((host, port)) == 0


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_it_serves_this_machine_and_leaves_nothing_behind(live, sent):
    """127.0.0.2 is this machine too, and would answer if every interface were bound."""
    port = free_port()
    process, line = live(port)
    assert f"http://127.0.0.1:{port}/ " in line
    assert children(process.pid) == []
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/") as page:
        assert b"meshcat.js" in page.read()
    assert not listens(port, "127.0.0.2")
    process.send_signal(sent)
    status = process.wait(60)
    assert not listens(port)
    if sent == signal.SIGKILL:
        assert status == -sent
    else:
        assert (status, process.stderr.read()) == (130, "kinarm-replay: interrupted\n")
