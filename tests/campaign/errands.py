"""What a long run does in turns, in its own process and in others."""

import asyncio
import shutil
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from kinarm.evaluation import TrialSet, evaluate, find_contestants, oracle_bounds, record
from kinarm.policies import load_checkpoint, recipe, save_checkpoint, sb3_vec_env, train_policy
from kinarm.problem import PROBLEMS
from kinarm.recording import load_recordings, save_recordings
from kinarm.simulator import Simulator
from kinarm.viewer import replay_page
from kinarm.viewer.live_server import LiveServer
from kinarm.viewer.live_stage import LiveStage

PORT = 7600
"""First port that is tried for a live page."""

PATIENCE = 120.0
"""How long a process may take to come to a point [s]."""


@dataclass
class LongRun:
    """What lasts as long as the run, and where it writes.

    Attributes
    ----------
    folder : Path
        Outputs; what an errand writes is gone when it is done.
    round : int
        Number of the round, which seeds what is random.
    sessions : set of int
        Sessions of the processes that were started and have ended.
    done : dict of int
        How often things were done, by their name.
    """

    folder: Path
    round: int = 0
    sessions: set[int] = field(default_factory=set)
    done: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.single = gymnasium.make("kinarm/ReachBoth-v0")
        self.batch = gymnasium.make_vec("kinarm/ReachGoalRight-v0", num_envs=16)
        self.sb3 = sb3_vec_env("right", n_envs=16, seed=0)
        self.sb3.reset()
        self.simulator = Simulator("left", threads=1)
        self.stage = LiveStage(LiveServer(PORT), PROBLEMS["left"], self.simulator.arm)

    def close(self) -> None:
        """Let go of everything."""
        for each in (self.single, self.batch, self.sb3, self.stage):
            each.close()

    def clear(self) -> None:
        """Remove what was written."""
        for left in self.folder.iterdir():
            shutil.rmtree(left) if left.is_dir() else left.unlink()

    def count(self, what: str, times: int = 1) -> None:
        """Note that something was done."""
        self.done[what] = self.done.get(what, 0) + times


def environments(run: LongRun) -> None:
    """Step environments that last, and make, step and close others."""
    rng = np.random.default_rng(run.round)
    run.single.reset(seed=run.round)
    run.batch.reset(seed=run.round)
    pictured = gymnasium.make("kinarm/ReachRight-v0", render_mode="rgb_array", width=64, height=48)
    passing = gymnasium.make_vec("kinarm/ReachLeft-v0", num_envs=4)
    pictured.reset(seed=run.round)
    passing.reset(seed=run.round)
    for _ in range(64):
        for single in (run.single, pictured):
            _, _, terminated, truncated, _ = single.step(single.action_space.sample())
            if terminated or truncated:
                single.reset()
        for batch, n in ((run.batch, 16), (passing, 4)):
            observed = batch.step(rng.uniform(-1, 1, (n, 5)))[0]
            assert batch.observation_space.contains(observed)
        run.sb3.step(rng.uniform(-1, 1, (16, 5)))
    assert pictured.render().shape == (48, 64, 3)
    pictured.close()
    passing.close()
    run.count("environment steps", 64 * (1 + 1 + 16 + 4 + 16))


def trainings(run: LongRun) -> None:
    """Train by ARS and by PPO, with a checkpoint on the way from which another goes on."""
    for learner, settings in (
        ("ars", {"iterations": 4}),
        ("ppo", {"iterations": 2, "n_envs": 4, "n_steps": 50, "batch_size": 50, "n_epochs": 2}),
    ):
        config = recipe(learner, "paper", problem=PROBLEMS["right"], seed=run.round, **settings)
        states: list[Any] = []
        whole = train_policy(config, on_iteration=states.append, threads=1)
        path = run.folder / f"{learner}.checkpoint.npz"
        save_checkpoint(path, config, states[0])
        resumed = train_policy(config, state=load_checkpoint(path).state, threads=1)
        for one, other in zip(whole.policy.layers, resumed.policy.layers, strict=True):
            assert one.weights.tobytes() == other.weights.tobytes()
        path.unlink()
        run.count(f"trainings by {learner}", 2)


def evaluations(run: LongRun) -> None:
    """Evaluate policies, and ask the oracle for bounds of fresh trials."""
    evaluate("ars-tuned-both", trials=100, seed=run.round)
    evaluate("ppo-tuned-both", trials=20, seed=run.round)
    trials = TrialSet.draw("right", 4, seed=run.round)
    bounds = oracle_bounds(trials)
    rollouts = find_contestants("ars-tuned-both")[0].run(trials)
    assert (rollouts.steps >= bounds.steps_lower_bound)[rollouts.success].all()
    run.count("evaluated trials", 124)


def replays(run: LongRun) -> None:
    """Record trials, write them and their page, and read them again."""
    trials = TrialSet.draw("both", 3, seed=run.round)
    recordings = record(find_contestants("ppo-tuned-both")[0], trials)
    file, page = run.folder / "three.npz", run.folder / "three.html"
    save_recordings(file, recordings)
    replay_page(load_recordings(file)).save(page)
    file.unlink()
    page.unlink()
    run.count("replay pages")


def live_pages(run: LongRun) -> None:
    """Move an arm on the page that lasts and on a new one, while clients come and go."""
    starts, goals = run.simulator.sample(np.random.default_rng(run.round), 2)
    policy = find_contestants("ars-tuned-both")[0].policy
    rollouts = run.simulator.rollout(policy, starts, goals, record=True)
    with LiveServer(PORT) as passing:
        assert passing.port != run.stage.server.port
        stages = [run.stage, LiveStage(passing, PROBLEMS["left"], run.simulator.arm)]
        ports = [stage.server.port for stage in stages]
        clients = threading.Thread(target=asyncio.run, args=(_watch(ports),))
        clients.start()
        while clients.is_alive():
            for stage in stages:
                for path, goal in zip(rollouts.paths, goals, strict=True):
                    way = path[np.isfinite(path[:, 0])]
                    stage.begin(way[0], goal)
                    for configuration in way:
                        stage.show(configuration)
                    points = [run.simulator.arm.tool_position(q) for q in way]
                    stage.draw_trace(points, "success")
                    stage.pace(0.05)
        clients.join()
    run.count("clients of a live page", 12)


async def _watch(ports: list[int]) -> None:
    """Three clients of each page, twice: one leaves at once, one after the scene, one stays on."""
    for _ in range(2):
        await asyncio.gather(*(_client(port, kept) for port in ports for kept in (1, 12, 60)))


async def _client(port: int, messages: int) -> None:
    """Take some commands of a scene, and leave; after a single one, without saying so."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(f"GET /scene HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
    async with asyncio.timeout(PATIENCE):
        await reader.readuntil(b"\r\n\r\n")
        for _ in range(messages):
            (length,) = struct.unpack("<I", await reader.readexactly(4))
            await reader.readexactly(length)
    if messages == 1:
        writer.transport.abort()
    writer.close()


def commands(run: LongRun) -> None:
    """Run command lines: a training that is interrupted and resumed, an evaluation, a live page."""
    out = run.folder / "trained.npz"
    train = ("kinarm.policies.train", "ars", "--task", "right", "--out", str(out))
    begun = _start(*train, "--iterations", "100000", "--seed", str(run.round))
    _await(lambda: out.with_suffix(".checkpoint.npz").exists(), begun)
    assert _stop(run, begun, signal.SIGINT) == 130
    resumed, checkpoint = _start(*train, "--resume"), out.with_suffix(".checkpoint.npz")
    saved = checkpoint.stat().st_mtime_ns
    _await(lambda: checkpoint.stat().st_mtime_ns != saved, resumed)
    assert _stop(run, resumed, signal.SIGINT) == 130
    evaluated = _start(
        *("kinarm.evaluation.commands.evaluate", "--policy", "ars-tuned-both"),
        *("--trials", "20", "--out", str(run.folder / "evaluated")),
    )
    assert _stop(run, evaluated) == 0
    live = _start(
        *("kinarm.evaluation.commands.replay", "--policy", "ars-tuned-both", "--live"),
        *("--no-browser", "--port", str(PORT + 50)),
    )
    assert live.stdout is not None
    line = live.stdout.readline()
    port = int(line.split(":")[2].split("/")[0])
    asyncio.run(_client(port, 20))
    assert _stop(run, live, signal.SIGINT) == 130
    run.clear()
    run.count("processes", 4)


def _start(module: str, *arguments: str) -> "subprocess.Popen[str]":
    """Start a command line in a session of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def _await(condition: Callable[[], bool], process: "subprocess.Popen[str]") -> None:
    """Wait until something is the case while a process runs."""
    pause = threading.Event()
    for _ in range(int(PATIENCE / 0.05)):
        if condition():
            return
        assert process.poll() is None
        pause.wait(0.05)
    raise TimeoutError


def _stop(run: LongRun, process: "subprocess.Popen[str]", sent: int | None = None) -> int:
    """Wait for the end of a process, which a signal may bring about; return its status."""
    run.sessions.add(process.pid)
    if sent is not None:
        process.send_signal(sent)
    try:
        process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise
    return process.returncode


ERRANDS = (environments, trainings, evaluations, replays, live_pages, commands)
