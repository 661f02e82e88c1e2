"""The finished trainings of a study, grouped as tables, figures and claims need them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.reproduction.outcome import Outcome, OutcomeStore
from kinarm.evaluation.reproduction.study import LITERAL, Purpose, Reading, Study, Training
from kinarm.evaluation.reproduction.training_run import final_trials
from kinarm.evaluation.trials import TrialSet
from kinarm.policies.ars_config import ARSConfig


@dataclass(frozen=True, eq=False)
class Results:
    """Outcomes of all trainings of a study.

    Attributes
    ----------
    study : Study
        What was trained.
    outcomes : mapping of Training to Outcome
        What each training came to.
    """

    study: Study
    outcomes: Mapping[Training, Outcome]

    @classmethod
    def load(cls, study: Study, store: OutcomeStore) -> "Results":
        """Read all outcomes that are finished."""
        found = {training: store.load(training) for training in study.trainings}
        return cls(study, {key: outcome for key, outcome in found.items() if outcome is not None})

    @property
    def missing(self) -> tuple[Training, ...]:
        """Trainings that are not finished."""
        return tuple(t for t in self.study.trainings if t not in self.outcomes)

    def select(
        self, purpose: Purpose, task: str | None = None, reading: Reading = LITERAL
    ) -> dict[Training, Outcome]:
        """Outcomes for a purpose, on a task or on all, under a reading."""
        if purpose == "ppo":
            reading = reading.for_ppo
        return {
            training: outcome
            for training, outcome in self.outcomes.items()
            if training.purpose == purpose
            and training.reading == reading
            and task in (None, training.config.task)
        }

    def distances(
        self, purpose: Purpose, task: str, reading: Reading = LITERAL
    ) -> NDArray[np.float64]:
        """Final distances of all seeds in all trials, shape (n_seeds, n_trials) [m]."""
        return np.array([o.distance for o in self.select(purpose, task, reading).values()])

    def sweep(self) -> dict[tuple[float, int], list[Outcome]]:
        """Outcomes of the sweep by learning rate and number of perturbations."""
        settings: dict[tuple[float, int], list[Outcome]] = {}
        for training, outcome in self.select("sweep").items():
            if isinstance(training.config, ARSConfig):
                setting = (training.config.step_size, training.config.directions)
                settings.setdefault(setting, []).append(outcome)
        return settings

    def trials(self, task: str, reading: Reading = LITERAL) -> TrialSet:
        """What the final policies faced."""
        return final_trials(task, reading, self.study.protocol)

    def left_bench(self, task: str, reading: Reading = LITERAL) -> NDArray[np.bool_]:
        """Trials whose goal lies on the left bench (y > 0), shape (n_trials,)."""
        left: NDArray[np.bool_] = self.trials(task, reading).goals[:, 1] > 0
        return left


def steps_to_level(outcome: Outcome, distance: float, share: float) -> float:
    """Environment steps after which a policy first ended within a distance often enough.

    Parameters
    ----------
    outcome : Outcome
        The training.
    distance : float
        The distance [m].
    share : float
        In which share of the snapshot's trials.

    Returns
    -------
    float
        Steps at the first such snapshot; infinity if there is none.
    """
    reached = (outcome.snapshot_distance <= distance).mean(axis=1) >= share
    return float(outcome.snapshot_steps[reached.argmax()]) if reached.any() else float("inf")


def distances_after(outcome: Outcome, environment_steps: float) -> NDArray[np.float32]:
    """Final distances at the last snapshot within a number of steps, or at the first [m]."""
    within = np.count_nonzero(outcome.snapshot_steps <= environment_steps)
    last: NDArray[np.float32] = outcome.snapshot_distance[max(int(within) - 1, 0)]
    return last
