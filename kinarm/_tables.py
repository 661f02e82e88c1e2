"""Tables of the commands: columns that fit; and CSV files."""

import csv
import io
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from kinarm._console import open_console
from kinarm._fields import Checked
from kinarm.errors import check_known

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

T = TypeVar("T")

ALWAYS = float("inf")
"""Priority of columns that are never left out."""

CHOOSE = "--columns shows those that you name"
"""How to see what a table leaves out, for commands with `TableOptions`."""

GAP, FEWEST = 2, 16
"""Characters between columns, and least width of words that wrap; wide consoles give a third."""


@dataclass(frozen=True)
class Column(Generic[T]):
    """A column of a table, with the cell of each row.

    Attributes
    ----------
    heading : str
        Its heading.
    cell : callable
        Text of a row.
    name, meaning : str
        Name for ``--columns``, by default the heading, and what it shows.
    priority : float
        Where space is scarce, columns of low priority are left out first.
    words : bool
        Words instead of figures: they stand at the left, and wrap.
    """

    heading: str
    cell: Callable[[T], object]
    name: str = ""
    meaning: str = ""
    priority: float = 0
    words: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.heading)

    @property
    def is_label(self) -> bool:
        """Whether it says what a row is about: words that are never left out."""
        return self.words and self.priority == ALWAYS


def parse_columns(text: str) -> tuple[str, ...]:
    """Names of columns, such as ``"success,collision"``."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


@dataclass(frozen=True, kw_only=True)
class TableOptions(Checked):
    """What becomes of the table.

    Parameters
    ----------
    columns : tuple of str
        Names of the columns that are shown, such as success,collision.
    """

    columns: tuple[str, ...] = field(
        default=(), metadata={"parse": parse_columns, "metavar": "A,B,C"}
    )

    def chosen(self, known: Sequence[Column[T]]) -> list[Column[T]]:
        """The labels, and the columns of given names; without names, all columns."""
        by_name = {column.name: column for column in known}
        check_known("column", self.columns, by_name)
        labels = (name for name, each in by_name.items() if each.is_label)
        names = dict.fromkeys((*labels, *self.columns)) if self.columns else by_name
        return [by_name[name] for name in names]


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV, with a heading; a value that one has not is empty."""
    names = dict.fromkeys(name for row in rows for name in row)
    text = io.StringIO()
    writer = csv.DictWriter(text, [*names], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


class _Filled(NamedTuple):
    """A column with its heading, perhaps in lines, and cells."""

    column: Column[Any]
    heading: str
    cells: list[str]

    def wrapped(self) -> "_Filled":
        """The same with a heading as wide as the cells, or as its longest word."""
        room = max(map(len, (*self.heading.split(), *self.cells)))
        lines = textwrap.wrap(self.heading, room, break_on_hyphens=False)
        return self._replace(heading="\n".join(lines))

    def width(self, of_words: int) -> int:
        """Characters that it needs, if words wrap at so many."""
        width = max(map(len, (*self.heading.split("\n"), *self.cells)))
        return min(width, of_words) if self.column.is_label else width


def print_columns(
    columns: Sequence[Column[T]],
    groups: Iterable[Sequence[T]],
    console: "Console",
    *,
    whole: bool = False,
    advice: str = "a wider terminal, or COLUMNS=250, shows them",
) -> None:
    """Print a table: headings and words wrap; an empty line separates groups of rows.

    Columns without room are left out and named, with advice on how to see them; or, if the table is
    wanted whole, none, however wide it is.
    """
    rows = [row for group in groups for row in (None, *group)][1:]
    shown = [
        _Filled(
            column, column.heading, ["" if row is None else str(column.cell(row)) for row in rows]
        )
        for column in columns
    ]

    def width() -> int:
        words = max(FEWEST, console.width // 3)
        return sum(each.width(words) for each in shown) + GAP * (len(shown) - 1)

    if width() > console.width:
        shown = [each.wrapped() for each in shown]
    left_out = list[str]()
    while width() > console.width and not whole:
        least = min(shown, key=lambda each: each.column.priority)
        if least.column.priority == ALWAYS:
            break
        shown.remove(least)
        left_out.append(least.column.name)
    table = _table(shown, width=width() if width() > console.width else None, pad_edge=False)
    console.print(table, crop=False)
    if left_out:
        console.print(f"not shown: {', '.join(reversed(left_out))}; {advice}", style="dim")


def print_markdown(columns: Sequence[Column[T]], rows: Sequence[T], console: "Console") -> None:
    """Print a table as Markdown, with all columns, however wide it is."""
    from rich import box

    filled = [
        _Filled(each, each.heading, [str(each.cell(row)).replace("*", "\\*") for row in rows])
        for each in columns
    ]
    text = io.StringIO()
    open_console(file=text).print(_table(filled, box=box.MARKDOWN))
    console.out(text.getvalue().strip(), highlight=False)


def _table(columns: Sequence[_Filled], **style: Any) -> "Table":
    """A table for Rich."""
    from rich.table import Table

    table = Table(**{"box": None, "header_style": "bold", **style})
    for column, heading, _ in columns:
        table.add_column(
            heading,
            justify="left" if column.words else "right",
            no_wrap=not column.is_label,
            overflow="fold",
        )
    for row in zip(*(each.cells for each in columns), strict=True):
        table.add_row(*row)
    return table


def print_table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], expendable: Sequence[str] = ()
) -> None:
    """Print a table of texts; narrow terminals leave out what is expendable, in this order."""
    columns = [
        Column[Sequence[str]](
            heading,
            itemgetter(number),
            priority=expendable.index(heading) if heading in expendable else ALWAYS,
            words=True,
        )
        for number, heading in enumerate(headings)
    ]
    print_columns(columns, [rows], open_console())
