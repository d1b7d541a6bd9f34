"""Plots of a study: panels of curves as PNG."""

from collections.abc import Iterable, Sequence
from io import BytesIO
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from workflows.figures import COLOURS, DASHES, MARKERS

FEW = 6  # values of a logarithmic axis that are ticks themselves


class Line(NamedTuple):
    """A curve: its name (None for no entry in the legend), points, how it is drawn."""

    name: str | None
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    style: str | None = None  # "-", "--", "o-", "o", "x", ...; None takes the next dashes
    colour: int | None = None  # of COLOURS, MARKERS and DASHES; None takes the next
    width: float = 1.3


class Panel(NamedTuple):
    """One set of axes; `logarithmic` names the axes that are, "x", "y" or "xy"."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    logarithmic: str = ""
    y_limits: tuple[float, float] | None = None


def panels(
    sets: Sequence[Panel],
    *,
    columns: int = 1,
    size: tuple[float, float] = (8, 3),
    legend_apart: bool = False,
) -> bytes:
    """The panels row by row, each of size (width, height) [inch].

    `legend_apart` sets the legend of the last panel into the place behind it where that is free.
    """
    rows = -(-len(sets) // columns)
    figure = Figure(figsize=(columns * size[0], rows * size[1]), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, axis in zip(sets, axes, strict=False):
        _drawn(panel, axis)
    for unused in axes[len(sets) :]:
        unused.set_axis_off()
    if legend_apart and len(sets) < len(axes):
        last = axes[len(sets) - 1]
        last.get_legend().remove()
        axes[len(sets)].legend(*last.get_legend_handles_labels(), frameon=False, loc="center left")
    raw = BytesIO()
    figure.savefig(raw, format="png", dpi=130, metadata={"Software": None})
    return raw.getvalue()


def matrix(values: NDArray[np.float64], names: Sequence[str], label: str) -> bytes:
    """A square matrix (n, n) with its numbers, dark where they are small."""
    figure = Figure(figsize=(2.4 + 0.62 * len(names), 1.6 + 0.5 * len(names)), layout="constrained")
    axis = figure.subplots()
    shown = axis.imshow(values, cmap="Blues_r", aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        dark = value < 0.5 * values.max()
        axis.text(
            j, i, f"{value:.2f}", ha="center", va="center", fontsize=8,
            color="white" if dark else "black",
        )  # fmt: skip
    axis.set_xticks(range(len(names)), names, rotation=40, ha="right", fontsize=8)
    axis.set_yticks(range(len(names)), names, fontsize=8)
    axis.spines[:].set_visible(False)
    figure.colorbar(shown, label=label, shrink=0.7)
    raw = BytesIO()
    figure.savefig(raw, format="png", dpi=130, metadata={"Software": None})
    return raw.getvalue()


def _log_ticks(axis, values: Iterable[NDArray[np.float64]], *, plain: bool) -> None:
    """Few values are ticks themselves; else 1, 2 and 5 in a wide span, more of them in a narrow
    one; beyond, `plain` or powers."""
    every = np.concatenate([np.ravel(some) for some in values])
    every = np.unique(every[np.isfinite(every)])
    span = every[-1] / every[0] if every.size and every[0] > 0 else np.inf
    if plain and every.size <= FEW and span < 200:
        axis.set_major_locator(FixedLocator(every))
        axis.set_minor_locator(NullLocator())
    if plain or span < 200:
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("{x:g}" if span < 200 else NullFormatter())
    if span < 200 and not (plain and every.size <= FEW):
        axis.set_minor_locator(LogLocator(subs=(2, 5) if span >= 6 else (2, 3, 4, 6, 8)))


def _look(style: str | None, place: int) -> dict:
    """Curves differ by colour, dashes and markers: also on paper without colour."""
    if style is None:
        return {"linestyle": DASHES[place % len(DASHES)]}
    if style.startswith("o"):
        return {"linestyle": style[1:] or "none", "marker": MARKERS[place % len(MARKERS)]}
    if style in (*MARKERS, "x"):
        return {"linestyle": "none", "marker": style}
    return {"linestyle": style}


def _drawn(panel: Panel, axis) -> None:
    for i, line in enumerate(panel.lines):
        place = i if line.colour is None else line.colour
        axis.plot(
            line.x, line.y, color=COLOURS[place % len(COLOURS)], linewidth=line.width, markersize=4,
            label=line.name, **_look(line.style, place),
        )  # fmt: skip
    if "x" in panel.logarithmic:
        axis.set_xscale("log")
        _log_ticks(axis.xaxis, (line.x for line in panel.lines), plain=True)
    if "y" in panel.logarithmic:
        axis.set_yscale("log")
        _log_ticks(axis.yaxis, (line.y for line in panel.lines), plain=False)
    if panel.y_limits:
        axis.set_ylim(*panel.y_limits)
    axis.set_title(panel.title, fontsize=9, loc="left")
    axis.set_xlabel(panel.x_label)
    axis.set_ylabel(panel.y_label)
    if any(line.name for line in panel.lines):
        axis.legend(frameon=False, fontsize=8)
    axis.margins(x=0.02)
    axis.grid(alpha=0.3, linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
