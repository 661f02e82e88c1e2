"""The finished trainings of a study, grouped as tables, figures and claims need them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.reproduction.runs import RunStore, TrainedRun
from kinarm.evaluation.reproduction.study import LITERAL, PlannedTraining, Purpose, Reading, Study
from kinarm.evaluation.reproduction.training import final_trials
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.ars.config import ARSConfig


@dataclass(frozen=True, eq=False)
class Results:
    """What the finished trainings of a study came to."""

    study: Study
    runs: Mapping[PlannedTraining, TrainedRun]

    @classmethod
    def load(cls, study: Study, store: RunStore) -> "Results":
        """Read all runs that are finished."""
        found = {training: store.load(training) for training in study.trainings}
        return cls(study, {key: run for key, run in found.items() if run is not None})

    @property
    def missing(self) -> tuple[PlannedTraining, ...]:
        """Trainings that are not finished."""
        return tuple(t for t in self.study.trainings if t not in self.runs)

    def select(
        self, purpose: Purpose, task: str | None = None, reading: Reading = LITERAL
    ) -> list[TrainedRun]:
        """Runs for a purpose, on a task or on all, under a reading."""
        if purpose == "ppo":
            reading = reading.for_ppo
        return [
            run
            for training, run in self.runs.items()
            if training.purpose == purpose
            and training.reading == reading
            and task in (None, training.config.problem.name)
        ]

    def distances(
        self, purpose: Purpose, task: str, reading: Reading = LITERAL
    ) -> NDArray[np.float64]:
        """Final distances of all seeds in all trials, shape (n_seeds, n_trials) [m]."""
        return np.array([run.distance for run in self.select(purpose, task, reading)])

    def sweep(self) -> dict[tuple[float, int], list[TrainedRun]]:
        """Runs of the sweep by learning rate and number of perturbations."""
        settings: dict[tuple[float, int], list[TrainedRun]] = {}
        for training, run in self.runs.items():
            config = training.config
            if training.purpose == "sweep" and isinstance(config, ARSConfig):
                settings.setdefault((config.step_size, config.directions), []).append(run)
        return settings

    def trial_set(self, task: str, reading: Reading = LITERAL) -> TrialSet:
        """What the final policies faced."""
        return final_trials(reading.problem(task), self.study.protocol)
