"""A few kills, signals and failing writes, and commands in strange surroundings."""

import pytest

from . import disturbances
from .disturbances import EVALUATED, STUDIED, TRAIN, ended, started, unfit
from .tally import Tally

pytestmark = pytest.mark.rare


@pytest.mark.parametrize(
    ("disturb", "command", "count"),
    [
        ("kill", TRAIN, 1),
        ("kill", STUDIED, 1),
        ("interrupt", STUDIED, 1),
        ("limit", EVALUATED, 2),
    ],
)
def test_nothing_is_lost_or_left(disturb, command, count):
    tally = Tally()
    getattr(disturbances, disturb)(command, count, 0, tally)
    assert tally.failed == {}, tally.examples
    assert sum(tally.counts.values()) >= count


@pytest.mark.parametrize(
    "surroundings",
    [
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"},
        {"HOME": "/proc/none", "XDG_CACHE_HOME": "/proc/none", "KINARM_CACHE": "/proc/none"},
        {"NUMBA_CACHE_DIR": "/proc/none", "TERM": "dumb", "COLUMNS": "0", "LINES": "x"},
    ],
)
def test_commands_end_well_anywhere(surroundings, monkeypatch, tmp_path):
    for name, value in surroundings.items():
        monkeypatch.setenv(name, value)
    commands = (disturbances.SHORT, "kinarm-replay --policy gone/é[/o].npz")
    for command, expected in zip(commands, (0, 2), strict=True):
        with started(command, tmp_path) as process:
            status, err = ended(process)
        assert status == expected, err
        assert unfit(command, status, err, (0, 2)) == ""
