"""The CSV of a contact's force over its overlap."""

import csv
from pathlib import Path

from beadwave import dem
from beadwave.dem.kernels.arguments import ForceTable
from beadwave.workflows.scene import InvalidScene


def force_table(path: str) -> ForceTable:
    """The table of a CSV of overlap [m], force [N], which may have a line of names first.

    Raises InvalidScene for a file that is not one, or does not grow from 0, 0.
    """
    try:
        with open(Path(path), newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error):
        raise InvalidScene(
            f"contact.file = {path!r} is not read as text; give a CSV of overlaps and forces."
        ) from None
    columns = []
    for i, row in enumerate(rows, start=1):
        try:
            overlap, force = map(float, row)
        except ValueError:
            if i == 1 and len(row) == 2:
                continue  # names of the columns
            raise InvalidScene(
                f"contact.file = {path!r} has {','.join(row)[:60]!r} in row {i}, allowed are two "
                "numbers, overlap [m] and force [N]; correct it."
            ) from None
        columns.append((overlap, force))
    try:
        return dem.force_table(*zip(*columns, strict=True)) if columns else dem.force_table([], [])
    except dem.InvalidChain as reason:
        raise InvalidScene(f"contact.file = {path!r}: {reason}.") from None
