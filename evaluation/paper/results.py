"""The finished trainings of the reproduction, in order."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run
from kinarm.evaluation.experiments.runs import TrainedRun
from kinarm.evaluation.experiments.study import Study
from kinarm.evaluation.trials import TrialSet, trial_set
from kinarm.policies.ars import Sharing
from kinarm.problem import PROBLEMS

PURPOSES = ("sweep", "ars", "ppo")
"""The sweep of ARS's settings, its models, and those of PPO."""

LEARNERS = {"ars": "ARS", "ppo": "PPO"}

NEAR = 0.2
"""Distance within which a trial ends near its goal (section 4) [m]."""


@dataclass(frozen=True, kw_only=True)
class Reading:
    """One reading of what the paper leaves open, by default the literal one.

    Parameters
    ----------
    start_spread : float
        Share of the joint ranges about home from which starts are drawn, in
        training and trials.
    reward : {"progress", "sign"}
        Reward of a step: the metres that it brings the tool closer, or 1 or -1
        for closer or farther, divided by the horizon.
    sharing : {"none", "pair", "iteration"}
        Which rollouts of an ARS iteration face the same start and goal.
    """

    start_spread: float = 1.0
    reward: Literal["progress", "sign"] = "progress"
    sharing: Sharing = "none"

    @property
    def name(self) -> str:
        """Such as ``"spread1-progress-none"``."""
        return f"spread{self.start_spread:g}-{self.reward}-{self.sharing}"


LITERAL = Reading()


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperRun:
    """A finished training of the reproduction."""

    planned: Run
    trained: TrainedRun

    @property
    def purpose(self) -> str:
        """One of `PURPOSES`: the first word of its entry."""
        return self.planned.entry.name.partition("-")[0]

    @property
    def task(self) -> str:
        """One of the names in `PROBLEMS`."""
        return self.planned.config.problem.name

    @property
    def setting(self) -> tuple[float, int]:
        """Learning rate and number of perturbations of ARS; 0 for PPO."""
        config = self.planned.settings["config"]
        return config.get("step_size", 0.0), config.get("directions", 0)

    @cached_property
    def reading(self) -> Reading:
        """How it reads the paper."""
        task = self.planned.config.training_problem.task
        return Reading(
            start_spread=task.start_spread,
            reward="progress" if task.reward.progress else "sign",
            sharing=self.planned.settings["config"].get("sharing", "none"),
        )

    @property
    def name(self) -> str:
        """Unique, and fit for a file name."""
        setting = "-rate{:g}-perturb{}".format(*self.setting) if self.purpose == "sweep" else ""
        reading = "" if self.reading == LITERAL else f"-{self.reading.name}"
        return f"{self.purpose}{setting}-{self.task}-seed{self.planned.config.seed}{reading}"

    @property
    def place(self) -> tuple[float, ...]:
        """Key of the order by purpose, reading, task, setting and seed."""
        reading, (rate, perturbations) = self.reading, self.setting
        return (
            PURPOSES.index(self.purpose),
            -reading.start_spread,
            reading.reward != "progress",
            get_args(Sharing).index(reading.sharing),
            [*PROBLEMS].index(self.task),
            -rate,
            perturbations,
            self.planned.config.seed,
        )

    @property
    def distance(self) -> NDArray[np.float64]:
        """Final distances of the trained policy, shape (n_trials,) [m]."""
        return self.trained.outcomes.distance

    @property
    def environment_steps(self) -> int:
        """Environment steps of the training."""
        return self.trained.last.environment_steps

    @property
    def curve_steps(self) -> NDArray[np.int64]:
        """Environment steps at the points of the curve, shape (n_points,)."""
        return np.array([point.environment_steps for point in self.trained.curve])

    @property
    def curve_distance(self) -> NDArray[np.float32]:
        """Final distances at the points of the curve, shape (n_points, n_curve_trials) [m]."""
        return np.asarray(self.trained.curve_distance, dtype=np.float32)

    def steps_to_level(self, distance: float, share: float) -> float:
        """Steps until a share of trials ends within a distance [m]; infinity for never."""
        reached = (self.curve_distance <= distance).mean(axis=1) >= share
        return float(self.curve_steps[reached.argmax()]) if reached.any() else float("inf")

    def distance_after(self, environment_steps: float) -> NDArray[np.float32]:
        """Final distances [m] at the last point within some steps, or at the first."""
        within = int(np.count_nonzero(self.curve_steps <= environment_steps))
        last: NDArray[np.float32] = self.curve_distance[max(within - 1, 0)]
        return last


@dataclass(frozen=True, eq=False)
class PaperResults:
    """The experiment, and its finished trainings in the order of the paper."""

    experiment: Experiment
    runs: tuple[PaperRun, ...]

    @classmethod
    def of(cls, study: Study) -> "PaperResults":
        """Take what is finished of the experiment."""
        runs = [
            PaperRun(planned=planned, trained=trained)
            for planned, trained in study.finished.items()
        ]
        return cls(study.experiment, tuple(sorted(runs, key=lambda run: run.place)))

    @property
    def is_judged(self) -> bool:
        """Whether the trainings are long enough to judge the paper's claims."""
        return self.experiment.name == "reproduction"

    @property
    def readings(self) -> tuple[Reading, ...]:
        """Readings under which ARS was trained."""
        return tuple(dict.fromkeys(run.reading for run in self.runs if run.purpose == "ars"))

    def select(
        self, purpose: str, task: str | None = None, reading: Reading = LITERAL
    ) -> list[PaperRun]:
        """Choose some of the trainings.

        Parameters
        ----------
        purpose, task : str
            One of `PURPOSES`, and the name of a task; all tasks by default.
        reading : Reading
            How they read the paper; for PPO, only what concerns it.
        """
        if purpose == "ppo":
            reading = Reading(start_spread=reading.start_spread, reward=reading.reward)
        return [
            run
            for run in self.runs
            if run.purpose == purpose and run.reading == reading and task in (None, run.task)
        ]

    def sweep(self) -> dict[tuple[float, int], list[PaperRun]]:
        """Runs of the sweep by learning rate and number of perturbations."""
        settings: dict[tuple[float, int], list[PaperRun]] = {}
        for run in self.select("sweep"):
            settings.setdefault(run.setting, []).append(run)
        return settings

    def trial_set(self, task: str, reading: Reading = LITERAL) -> TrialSet:
        """Trials that the final policies faced.

        Under one reading, the paper's tasks are crossed: each trial has the same start, and its
        goal at the same place of the left or right bench.
        """
        problem = self.select("ars", task, reading)[0].planned.config.problem
        return trial_set(problem, self.experiment.trials.count, self.experiment.trials.seed)


def final_distances(runs: Iterable[PaperRun]) -> NDArray[np.float64]:
    """Final distances of some trainings, shape (n_runs, n_trials) [m]."""
    return np.array([run.distance for run in runs])
