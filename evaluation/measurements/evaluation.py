"""``kinarm-eval`` as a process."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping

from kinarm._cache import CACHE_VARIABLE
from kinarm.errors import WorkerError

RUN_AND_TELL = """
import resource, subprocess, sys
run = [sys.executable, "-P", "-m", *sys.argv[1:]]
subprocess.run(run, stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
"""A small process in between: the peak memory of another one counts that which started it."""


def _told_by(command: list[str], env: Mapping[str, str]) -> bytes:
    """Output of processes that do not see what a terminal sends, and end if this one is to."""
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, env=env, start_new_session=True) as process:
        try:
            told, _ = process.communicate()
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            raise
    if process.returncode:
        raise WorkerError("an evaluation that was to be measured ended unexpectedly")
    return told


def measure_evaluation() -> dict[str, float]:
    """Time [s] and peak memory [MB] of ``kinarm-eval --trials 200`` as its own process.

    The first time, the bounds of the trials are not known; then they are.
    """
    module = "kinarm.evaluation.commands.evaluate"
    command = [sys.executable, "-c", RUN_AND_TELL, module, "--trials", "200", "--json"]
    seconds, peaks = [], []
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, CACHE_VARIABLE: folder}
        for _ in range(2):
            began = time.perf_counter()
            told = _told_by(command, env)
            seconds.append(time.perf_counter() - began)
            peaks.append(int(told))
    before, after = seconds
    peak = max(peaks) / 1024
    return {"seconds_without_bounds": before, "seconds": after, "peak_memory_mb": peak}
