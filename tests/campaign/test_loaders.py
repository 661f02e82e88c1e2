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


def test_what_goes_wrong_is_noticed(monkeypatch, tmp_path):
    """A loader that ends its process, one that prints and one that raises something else."""

    def load(path):
        number = len(list(tmp_path.iterdir()))
        (tmp_path / str(number)).touch()
        if number == 2:
            import os

            os._exit(3)
        if number == 4:
            raise ValueError(number)

    loader = LOADERS["scene"]
    monkeypatch.setitem(LOADERS, "scene", type(loader)(loader.samples, loader.damage, load))
    tally = Tally()
    fuzz("scene", 6, 0, tally)
    assert tally.counts == {"inputs": 6, "accepted": 4}
    assert sorted(name.partition(" at ")[0] for name in tally.failed) == [
        "ValueError",
        "hangs, or ends with status 3",
    ]
