"""Comparisons as assertions; with --rows FILE each is also a row of a table for docs/verify.md."""

import csv
from pathlib import Path
from time import perf_counter

import pytest

from beadwave.workflows.evidence.harness import Comparison, Row, compared, row_of


@pytest.fixture
def check(request):
    """Assert that the difference of a comparison is at most what is allowed."""
    started = perf_counter()
    group = Path(request.fspath).stem

    def check(comparison: Comparison) -> None:
        nonlocal started
        since, started = perf_counter() - started, perf_counter()
        row = row_of(group, comparison, since)
        if file := request.config.option.rows:
            add_row(Path(file), row)
        assert row.verdict == "within", row

    return check


@pytest.fixture
def compare(check):
    """Assert that the entries of two arrays that differ most do so by at most what is allowed;
    arguments are those of `compared`."""

    def compare(quantity, ours, theirs, **options) -> None:
        check(compared(quantity, ours, theirs, **options))

    return compare


def add_row(file: Path, row: Row) -> None:
    """The row at the end of a CSV with the columns of `beadwave verify --out`."""
    new = not file.exists()
    with file.open("a", encoding="utf-8", newline="") as lines:
        table = csv.writer(lines)
        if new:
            table.writerow(Row._fields[:-1])
        table.writerow(row[:-1])
