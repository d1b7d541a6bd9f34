"""Tables of signals as measurements are stored: a CSV with a header line, instants on an even grid.

Records of a chain, hits of a hammer and frequency responses are read by it:

    # a title
    time [us], sphere 9 force [mN], sphere 4 velocity [mm/s]

Semicolons or tabs may stand for the commas; decimals take a point. A header that is a comment, as
numpy writes it, counts as well. All raise ValueError for content that cannot be used, and name the
line by the number that an editor shows.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6}
TIME_RESPONSE = 1  # function type of a data set 58
UNEVEN = 0.3  # deviation of a time from the even grid, over the step: files print few digits


class SignalTable(NamedTuple):
    """The numbers of a CSV and what stands above them."""

    title: str
    header: tuple[str, ...]  # names of the columns
    values: NDArray[np.float64]  # (k, n)

    def require_columns(self) -> None:
        """Raise ValueError where the header has more or fewer names than the lines numbers."""
        if len(self.header) != self.values.shape[1]:
            raise ValueError(
                f"its lines have {self.values.shape[1]} cells, the header has {len(self.header)}"
            )


def signal_table(path: Path) -> SignalTable:
    """The table of a CSV file; raises ValueError for a line that is not as many numbers as the
    others, and for a file without lines of numbers."""
    title, first, n_lines = [], "", 0
    with path.open(encoding="utf-8-sig") as file:
        for line in file:
            if line.strip() and not line.startswith("#"):
                first = line
                break
            n_lines += 1
            title.append(line.lstrip("# ").strip())
    between = next((mark for mark in ";\t" if mark in first), ",")
    if title and _numbers(first.split(between)):
        first = title.pop()  # the header is the last of the comments
    else:
        n_lines += 1

    # the fast reader names no line, so that a file it refuses is read once more
    with catch_warnings():
        simplefilter("ignore")  # of a file without lines
        try:
            values = np.loadtxt(
                path, delimiter=between, ndmin=2, skiprows=n_lines, encoding="utf-8-sig"
            )
        except UnicodeDecodeError:
            raise
        except ValueError:
            values = np.full((1, 1), np.nan)
    header = tuple(name.strip() for name in first.split(between))
    if not np.isfinite(values).all():
        raise ValueError(_fault(path, n_lines, between, header))
    if not values.size:
        raise ValueError("no samples below a header line")
    return SignalTable(" ".join(filter(None, title)), header, values)


def _numbers(cells: list[str]) -> bool:
    """True if every cell is a number."""
    try:
        return bool([float(cell) for cell in cells])
    except ValueError:
        return False


def _fault(path: Path, n_lines: int, between: str, header: tuple[str, ...]) -> str:
    """A sentence on the first line below `n_lines` that cannot be read."""
    n_cells = None
    for n, line in _lines(path, n_lines):
        cells = line.partition("#")[0].split(between)
        n_cells = n_cells or len(cells)
        if len(cells) != n_cells:
            return f"line {n} has {len(cells)} cells, those before it have {n_cells}"
        for i, cell in enumerate(cells):
            try:
                is_number = np.isfinite(float(cell)) if cell.strip() else False
            except ValueError:
                return f"line {n} is not numbers with decimal points: {line[:40]!r}"
            if not is_number:
                column = repr(header[i]) if i < len(header) else str(i + 1)
                return f"line {n} has no number in the column {column}: {line[:40]!r}"
    return "its lines are not numbers with decimal points"


def _lines(path: Path, n_lines: int) -> Iterator[tuple[int, str]]:
    """Lines with a table's numbers, each with its number in the file."""
    with path.open(encoding="utf-8-sig") as file:
        for n, line in enumerate(file, 1):
            if n > n_lines and line.partition("#")[0].strip():
                yield n, line.rstrip()


def even_step(t: NDArray[np.float64], least: int) -> float:
    """The step [s] of even, ascending times t (k,); raises ValueError where they are none, or fewer
    than `least`.

    Times that an instrument writes with few digits jump or repeat: they are even where all are
    within half of the last digit of a line through them, whose slope is the step.
    """
    if not np.isfinite(t).all():
        raise ValueError(f"the time of sample {int(np.argmin(np.isfinite(t))) + 1} is no number")
    if len(t) < least:
        raise ValueError(f"{len(t)} samples are too few, at least {least} are needed")
    steps = np.diff(t)
    i = np.arange(len(t)) - 0.5 * (len(t) - 1)
    dt, late = float(i @ (t - t.mean()) / (i @ i)), t[len(t) // 2 :]
    digits = (10.0**-k for k in range(10) if not np.any(np.abs(late * 10**k % 1 - 0.5) < 0.499))
    digit = next(digits, 0.0)
    # a sample that is missing is a jump of a step too, but a single one
    often = np.mean(np.abs(steps - dt) > UNEVEN * dt) > 0.05
    if often and np.abs(t - t.mean() - dt * i).max() <= 0.51 * digit < 0.01 * np.ptp(t):
        return dt

    if not (steps > 0).all():
        raise ValueError(f"time does not grow at sample {int(np.argmin(steps > 0)) + 2}")
    usual = float(np.median(steps))
    if steps.max() > 1.5 * usual:
        at = int(steps.argmax())
        raise ValueError(
            f"a gap of {steps[at] / usual:.3g} steps follows sample {at + 1}, at {t[at]:.6g} s"
        )
    if np.abs(t - np.linspace(t[0], t[-1], len(t))).max() > UNEVEN * usual:
        raise ValueError(
            f"times are not evenly spaced, steps are {steps.min():.3g} to {steps.max():.3g} s; "
            "resample them"
        )
    return float((t[-1] - t[0]) / (len(t) - 1))
