"""Small studies."""

import pytest
from small_studies import SMALL

from kinarm.evaluation.experiments.study import Study


@pytest.fixture
def small(tmp_path):
    """Makes a small study, in a folder of its own."""

    def make(folder="study", **changes):
        return Study({**SMALL, **changes}, tmp_path / folder)

    return make


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A small study, carried out."""
    return Study(SMALL, tmp_path_factory.mktemp("finished")).run(jobs=1)
