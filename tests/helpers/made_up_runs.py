"""Runs of trainings that never took place."""

from typing import Any

import numpy as np

from kinarm.evaluation.reproduction.runs import TrainedRun

SNAPSHOTS, SNAPSHOT_TRIALS = 4, 10


def made_up(
    distance: np.ndarray[Any, Any],
    snapshots: np.ndarray[Any, Any] | None = None,
    steps_per_iteration: int = 1000,
) -> TrainedRun:
    """A run with given final distances and distances at four snapshots."""
    if snapshots is None:
        snapshots = np.ones((SNAPSHOTS, SNAPSHOT_TRIALS))
    return TrainedRun(
        returns=np.linspace(0, 1, SNAPSHOTS),
        environment_steps=steps_per_iteration * np.arange(1, SNAPSHOTS + 1),
        wall_time=np.linspace(0.1, 1, SNAPSHOTS),
        snapshots=np.arange(SNAPSHOTS),
        snapshot_distance=snapshots.astype(np.float32),
        distance=distance,
        collision=np.zeros(len(distance), dtype=bool),
        steps=np.full(len(distance), 64),
    )
