"""The table of a record."""

from .record_page import record_page


def test_counts_are_summed_and_measures_are_compared():
    parts = {
        "urdf": {"inputs": 2000, "findings": {"hangs": 2, "prints": 1}, "peak_memory": 3.5},
        "policy": {"inputs": 50, "findings": {}, "examples": {}, "peak_memory": 0.25},
    }
    assert record_page(parts).splitlines() == [
        "|  | inputs | memory at its highest [MB] | findings |",
        "| --- | --- | --- | --- |",
        "| policy | 50 | 0.25 | 0 |",
        "| urdf | 2,000 | 3.5 | 3 |",
        "| **all** | 2,050 | 3.5 | 3 |",
    ]
