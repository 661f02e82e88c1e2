"""Tables of a reproduction."""

import numpy as np
import pytest
from made_up_runs import made_up

from kinarm.evaluation.reproduction.claims import assess
from kinarm.evaluation.reproduction.study import LITERAL, Reading
from kinarm.evaluation.reproduction.tables import _median_cell, readings_table


def test_readings_without_ppo_leave_its_claims_out(results_of):
    results = results_of(lambda training: made_up(np.full(200, 0.1)))
    other = Reading(sharing="pair")
    claims = {LITERAL: assess(results), other: assess(results, other)[:4]}
    header, _, *rows = readings_table(results, claims).splitlines()
    columns = [[cell.strip() for cell in line.split("|")[1:-1]] for line in (header, *rows)]
    names, literal, shared = columns
    assert names[4:8] == ["`ars-left`", "`ars-right`", "`ars-both`", "`ars-one-bench`"]
    assert literal[3] == shared[3] == "100 / 100 / 100"
    assert literal[:3] == ["1", "progress", "none"]
    assert all(literal[4:-1])
    assert shared[4:8] == literal[4:8]
    assert shared[8:-1] == [""] * 3
    assert [literal[-1], shared[-1]] == ["2", "2"]


@pytest.mark.parametrize(
    ("steps", "cell"),
    [
        ([np.inf] * 3, "never"),
        ([1000, 2000, 9000], "2 thousand"),
        ([1000, 2000, np.inf], "2 thousand (2 of 3 seeds)"),
        ([1000, np.inf, np.inf], "most never (1 of 3 seeds)"),
    ],
)
def test_median_over_seeds_says_how_many_got_there(steps, cell):
    assert _median_cell(np.array(steps)) == cell
