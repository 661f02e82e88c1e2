"""The small campaign of hostile visitors."""

import pytest

from .live_page import campaign


@pytest.mark.slow
def test_hostile_visitors_keep_nobody_out_and_leave_nothing():
    record = campaign(200, seed=0)
    assert record.findings == {}
    assert record.polite_visits > 0
