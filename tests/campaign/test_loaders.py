"""A few of the damaged files that `tests.campaign.loaders` makes."""

import pytest

from .loaders import LOADERS, fuzz
from .tally import Tally

pytestmark = pytest.mark.rare

INPUTS = 25


@pytest.mark.parametrize("name", LOADERS)
def test_damaged_files_are_refused_in_one_line_or_read(name):
    if LOADERS[name].needs:
        pytest.importorskip(LOADERS[name].needs)
    tally = Tally()
    fuzz(name, INPUTS, 1, tally)
    assert tally.failed == {}, tally.examples
    assert tally.counts["inputs"] == INPUTS
    assert tally.counts.get("refused", 0) + tally.counts.get("accepted", 0) == INPUTS
