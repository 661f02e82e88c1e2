"""Results of trainings that never took place."""

from collections.abc import Callable

import numpy as np
import pytest

from kinarm.episodes import Rollouts
from kinarm.evaluation.experiments.curve import Clock, CurvePoint
from kinarm.evaluation.experiments.experiment import Experiment
from kinarm.evaluation.experiments.plan import Run, plan
from kinarm.evaluation.experiments.runs import LEFT_OUT, TrainedRun
from kinarm.evaluation.paper.results import PaperResults, PaperRun

POINTS, CURVE_TRIALS = 4, 10


@pytest.fixture(scope="session")
def experiment() -> Experiment:
    """The shipped experiment, of which nothing is trained."""
    return Experiment.load("reproduction")


@pytest.fixture(scope="session")
def planned(experiment: Experiment) -> tuple[Run, ...]:
    """Its trainings."""
    return plan(experiment)


@pytest.fixture(scope="session")
def made_up_run() -> Callable[..., TrainedRun]:
    """Make a run of final distances, and of distances at four points of its curve."""

    def make(
        distance: np.ndarray, curve: np.ndarray | None = None, steps: int = 1000
    ) -> TrainedRun:
        points = [CurvePoint(k, k * steps, 0.0, 0.0, 0.0) for k in range(1, POINTS + 1)]
        n = len(distance)
        nowhere = np.zeros(n, dtype=bool)
        if curve is None:
            curve = np.ones((POINTS, CURVE_TRIALS))
        return TrainedRun(
            curve=tuple(points),
            last=points[-1],
            outcomes=Rollouts(
                distance=distance,
                steps=np.full(n, 64),
                returns=np.zeros(n),
                success=nowhere,
                collision=nowhere,
                **dict.fromkeys(LEFT_OUT, np.empty(0)),
            ),
            returns=np.linspace(0, 1, POINTS),
            curve_distance=curve.astype(np.float32),
            clock=Clock(seconds=1.0, points=(0.1, 0.4, 0.7, 1.0)),
        )

    return make


@pytest.fixture(scope="session")
def results_of(experiment: Experiment, planned: tuple[Run, ...]) -> Callable[..., PaperResults]:
    """Make results from a function from trainings to runs, which are told their purpose."""

    def make(run_of: Callable[[PaperRun], TrainedRun]) -> PaperResults:
        runs = []
        for run in planned:
            asked = PaperRun(planned=run, trained=None)
            runs.append(PaperRun(planned=run, trained=run_of(asked)))
        return PaperResults(experiment, tuple(sorted(runs, key=lambda run: run.place)))

    return make
