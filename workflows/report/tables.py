"""Tables of numbers: as aligned text for a person, as CSV and as records for machines."""

import csv
import re
from collections.abc import Iterable
from io import StringIO
from math import isfinite, isnan
from typing import Any, NamedTuple

NUMBER = re.compile(r"[-+]?[\d.,]+(e[-+]\d+)?( %)?|-|nan|inf|")  # written as a text already
LINE = 100  # characters of a printed sentence's lines


class Table(NamedTuple):
    """Rows of numbers and words for CSV and JSON; None is a missing value.

    `printed` has the headings and rows that are printed instead, () for none.
    """

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple, ...]
    printed: tuple[tuple, ...] | None = None

    def column(self, name: str) -> tuple:
        """Values of a column, from the first row to the last."""
        return tuple(row[self.columns.index(name)] for row in self.rows)


def lines(table: Table) -> tuple[tuple, ...]:
    """Headings and rows that are printed of a table, () for none."""
    return (table.columns, *table.rows) if table.printed is None else table.printed


def aligned_text(columns: tuple[str, ...], rows: Iterable[tuple]) -> str:
    """Rows that are only printed, as `text` prints a table."""
    return text(Table("", columns, tuple(rows)))


def text(table: Table) -> str:
    """Aligned columns, numbers in three digits and flush right, a dash for a missing value."""
    columns = []
    for column in zip(*lines(table), strict=True):
        cells = [short(value) for value in column]
        width = max(map(len, cells))
        values = column[1:]  # below the heading
        if any(isinstance(value, str) and not NUMBER.fullmatch(value) for value in values):
            columns.append([cell.ljust(width) for cell in cells])
        else:
            columns.append([cell.rjust(width) for cell in cells])
    return "\n".join("  ".join(cells).rstrip() for cells in zip(*columns, strict=True))


def short(value: Any, n: int = 3, *, zeros: bool = False) -> str:
    """A value as text: a number in n digits, without a power of ten below 1e5, with trailing zeros
    for n > 3 or where `zeros` are asked for; a word as it is; a dash for None and nan."""
    if value is None or (isinstance(value, float) and isnan(value)):
        return "-"
    if not isinstance(value, float):
        return str(value)
    if 10.0**n - 0.5 <= abs(value) < 1e5:
        return f"{value:.0f}"
    return f"{value:#.{n}g}".removesuffix(".") if n > 3 or zeros else f"{value:.{n}g}"


def apart(values: Iterable[Any], most_digits: int = 6, *, zeros: bool = False) -> list[str]:
    """Values in three digits, or in more where different values would look alike, up to
    `most_digits`; see `short` for `zeros`."""
    values = list(values)
    n_different = len({short(value, most_digits) for value in values})
    for n in range(3, most_digits + 1):
        texts = [short(value, n, zeros=zeros) for value in values]
        if len(set(texts)) == n_different:
            break
    return texts


def as_csv(table: Table) -> str:
    """The table as CSV; a missing value is an empty cell."""
    file = StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows([None if value != value else value for value in row] for row in table.rows)
    return file.getvalue()


def records(table: Table) -> list[dict[str, Any]]:
    """A dict for each row; numbers that are not finite become None, since JSON has none."""
    return [
        {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in zip(table.columns, row, strict=True)
        }
        for row in table.rows
    ]
