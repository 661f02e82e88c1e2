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

    The first time, nothing is compiled; then the bounds of the trials are not known; then they are.
    """
    module = "kinarm.evaluation.commands.evaluate"
    command = [sys.executable, "-c", RUN_AND_TELL, module, "--trials", "200", "--json"]
    with tempfile.TemporaryDirectory() as compiled, tempfile.TemporaryDirectory() as bounds:
        known = {**os.environ, CACHE_VARIABLE: bounds}
        new = {**os.environ, CACHE_VARIABLE: compiled, "NUMBA_CACHE_DIR": compiled}
        runs = [_timed(command, env) for env in (new, known, known)]
    (first, _), (unbounded, _), (seconds, _) = runs
    return {
        "seconds_first": first,
        "seconds_without_bounds": unbounded,
        "seconds": seconds,
        "peak_memory_mb": max(peak for _, peak in runs[1:]),
    }


def _timed(command: list[str], env: Mapping[str, str]) -> tuple[float, float]:
    """Time [s] of a command and its peak memory [MB]."""
    began = time.perf_counter()
    told = _told_by(command, env)
    return time.perf_counter() - began, int(told) / 1024
