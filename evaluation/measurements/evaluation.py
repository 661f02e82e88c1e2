"""``kinarm-eval`` as a process."""

import os
import resource
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
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        env = {**os.environ, CACHE_VARIABLE: folder}
        for _ in range(2):
            began = time.perf_counter()
            subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=env)
            seconds.append(time.perf_counter() - began)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    before, after = seconds
    return {"seconds_without_bounds": before, "seconds": after, "peak_memory_mb": peak / 1024}
