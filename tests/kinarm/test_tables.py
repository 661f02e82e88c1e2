"""Tables fit their width with whole cells, and CSV files hold what programs can read again."""

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from kinarm._tables import ALWAYS, Column, TableOptions, csv_text, print_columns
from kinarm.errors import UnknownNameError

words = st.text(st.characters(codec="ascii", categories=("L", "N")), min_size=1, max_size=12)
labels = st.lists(words, min_size=1, max_size=12).map(" ".join)

COLUMNS = [
    Column("trainings", lambda row: row[0], priority=ALWAYS, words=True),
    Column("success %", lambda row: f"{row[1]:.1f}", "success", priority=ALWAYS),
    Column("share of trials in contact %", lambda row: f"{row[2]:.1f}", "contact", priority=2),
    Column("median of all steps", lambda row: f"{row[3]}", "steps", priority=1),
]


def printed(rows, width, columns=COLUMNS, **options):
    console = Console(file=io.StringIO(), width=width)
    print_columns(columns, [rows], console, **options)
    return console.file.getvalue().splitlines()


rows = st.tuples(labels, *[st.floats(0, 100)] * 2, st.integers(0, 10**6))


@given(st.lists(rows, min_size=1, max_size=5), st.integers(45, 150))
def test_lines_fit_and_every_word_and_figure_is_whole(rows, width):
    lines = printed(rows, width)
    assert max(map(len, lines)) <= width
    told = " ".join(lines).split()
    for label, success, *_ in rows:
        assert f"{success:.1f}" in told
        assert set(label.split()) <= set(told)


def test_columns_leave_by_priority_and_are_named():
    rows = [("a", 1.0, 2.0, 3)]
    heading, row = printed(rows, 80)
    assert heading.split("  ") == [column.heading for column in COLUMNS]
    assert row.split() == ["a", "1.0", "2.0", "3"]
    narrow = printed(rows, 30, advice="ask")
    assert narrow[-1] == "not shown: steps; ask"
    assert narrow[-2].split() == ["a", "1.0", "2.0"]
    narrower = printed(rows, 22, advice="ask")
    assert " ".join(narrower[-2:]).split() == ["not", "shown:", "contact,", "steps;", "ask"]
    assert [line.split() for line in printed(rows, 22, whole=True)][-1] == ["a", "1.0", "2.0", "3"]


def test_names_choose_columns_after_the_labels():
    chosen = TableOptions(columns=("steps", "success")).chosen(COLUMNS)
    assert [column.name for column in chosen] == ["trainings", "steps", "success"]
    assert TableOptions().chosen(COLUMNS) == COLUMNS
    with pytest.raises(UnknownNameError, match=r"'step' \(did you mean 'steps'\?\); available: tr"):
        TableOptions(columns=("step",)).chosen(COLUMNS)


def test_csv_is_read_again():
    rows = [{"name": "a=1", "share": -0.25}, {"name": 'a,"b"', "low": 1e-9, "share": None}]
    read = list(csv.DictReader(io.StringIO(csv_text(rows))))
    assert read == [
        {"name": "a=1", "share": "-0.25", "low": ""},
        {"name": 'a,"b"', "share": "", "low": "1e-09"},
    ]
