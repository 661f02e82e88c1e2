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
