"""Results of trainings that never took place."""

from collections.abc import Callable

import pytest

from kinarm.evaluation.reproduction.results import Results
from kinarm.evaluation.reproduction.runs import TrainedRun
from kinarm.evaluation.reproduction.study import PlannedTraining, Study, full_study


@pytest.fixture(scope="session")
def study() -> Study:
    """The full study, of which nothing is trained."""
    return full_study()


@pytest.fixture(scope="session")
def results_of(study: Study) -> Callable[..., Results]:
    """Make results from a function from trainings to runs."""

    def make(run_of: Callable[[PlannedTraining], TrainedRun]) -> Results:
        return Results(study, {training: run_of(training) for training in study.trainings})

    return make
