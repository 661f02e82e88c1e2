"""``kinarm-eval`` as a process."""

import os
import subprocess
import sys
import tempfile
import time

from kinarm.evaluation.bounds import CACHE_VARIABLE


def measure_evaluation() -> dict[str, float]:
    """Time [s] and peak memory [MB] of ``kinarm-eval --trials 200`` as a process of its own.

    The first time, the bounds of the trials are not known; then they are.
    """
    module = "kinarm.evaluation.commands.evaluate"
    command = [sys.executable, "-P", "-m", module, "--trials", "200", "--json"]
    seconds, peaks = [], []
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, CACHE_VARIABLE: folder}
        for _ in range(2):
            began = time.perf_counter()
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=env)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode:
                raise subprocess.CalledProcessError(process.returncode, command)
            seconds.append(time.perf_counter() - began)
            peaks.append(usage.ru_maxrss)
    before, after = seconds
    peak = max(peaks) / 1024
    return {"seconds_without_bounds": before, "seconds": after, "peak_memory_mb": peak}
