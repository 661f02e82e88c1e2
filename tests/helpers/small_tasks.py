"""Tasks for executors."""

import os
import signal


def square(number):
    return number * number


def touch(folder, number):
    (folder / str(number)).touch(exist_ok=False)


def kill_own_process_once(folder, number):
    """The first worker that comes to a task with an odd number does not survive it."""
    mark = folder / str(number)
    if number % 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def seem_to_leak(number):
    """What a worker does whose memory grows with every task: the pool replaces it."""
    from joblib.externals.loky import process_executor

    process_executor._MEMORY_LEAK_CHECK_DELAY = 0
    process_executor._MAX_MEMORY_LEAK_SIZE = -(10**12)
    return number
