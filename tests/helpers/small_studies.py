"""A small experiment, what its folder holds, and an executor that counts."""

import pickle

from kinarm.evaluation.experiments.executors import attempt

SMALL = {
    "name": "small",
    "problems": ["right"],
    "seeds": 2,
    "trials": {"count": 12, "first": 200, "per_decade": 3},
    "fixed": {"iterations": 3, "directions": 4, "top_directions": 2},
    "grid": {"step_size": [0.02, 0.2]},
}


def contents(folder):
    """All files of the trainings of a study, by name."""
    return {path.name: path.read_bytes() for path in folder.glob("runs/*")}


class Counting:
    """An executor that carries out at most so many tasks in this process."""

    def __init__(self, limit=1000):
        self.tasks, self._limit = [], limit

    def map(self, work, tasks):
        for task in tasks:
            if len(self.tasks) == self._limit:
                raise KeyboardInterrupt
            self.tasks.append(task)
            yield task, attempt(work, pickle.dumps(task))
