"""One vocabulary of plots: palette, lines, panels of curves, maps with numbers, all as PNG.

Whatever else draws takes its figure, its colours and its axes from here.
"""

from collections.abc import Iterable, Sequence
from io import BytesIO
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import (
    FixedLocator,
    LogLocator,
    MaxNLocator,
    NullFormatter,
    NullLocator,
)
from numpy.typing import NDArray

Array = NDArray[np.float64]
# they differ in lightness as well, and where that is not enough in dashes and markers
COLOURS = ("#0b3c7d", "#e0522d", "#1b7f4b", "#e3a008", "#5b3a9e", "#2aa1b3", "#7f4f24", "#c2458f")
DASHES = ("-", (0, (6, 2)), (0, (6, 2, 1.5, 2)), (0, (1.5, 1.5)), (0, (10, 3)))
MARKERS = "os^Dv<>PX"


class Line(NamedTuple):
    """A curve: its name (None for no entry in the legend), points, how it is drawn."""

    name: str | None
    x: Array
    y: Array
    style: str | tuple | None = None  # "-", "o-", "o", "x", dashes ...; None: the next of DASHES
    # index into COLOURS, MARKERS and DASHES, or the name of a colour; None: the next ones
    colour: int | str | None = None
    width: float = 1.3  # [pt]


class Panel(NamedTuple):
    """One set of axes; `logarithmic` names the axes that are, "x", "y" or "xy"."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    logarithmic: str = ""
    y_limits: tuple[float | None, float | None] | None = None
    legend: str = "inside"  # "above" the axes, "aside" of the figure


def panels(sets: Sequence[Panel], **layout) -> bytes:
    """PNG of the panels row by row; layout as in `drawn`."""
    return png(drawn(sets, **layout)[0])


def drawn(
    sets: Sequence[Panel],
    *,
    columns: int = 1,
    size: tuple[float, float] = (8, 3),
    legend_apart: bool = False,
    **shared: bool | str | Sequence[float],
) -> tuple[Figure, list[Axes]]:
    """Figure and axes of the panels row by row, each of size (width, height) [inch].

    `legend_apart` sets the legend of the last panel into the place behind it where that is free;
    `shared` goes to `subplots`. Places of the grid without a panel stay empty.
    """
    rows = -(-len(sets) // columns)
    figure, axes = subplots(rows, columns, (columns * size[0], rows * size[1]), **shared)
    for panel, axis in zip(sets, axes, strict=False):
        for i, line in enumerate(panel.lines):
            place = line.colour if isinstance(line.colour, int) else i
            named = line.colour if isinstance(line.colour, str) else None
            axis.plot(
                line.x, line.y, color=named or COLOURS[place % len(COLOURS)],
                linewidth=line.width, markersize=4, label=line.name,
                **_dashes_and_markers(line.style, place),
            )  # fmt: skip
        if "x" in panel.logarithmic:
            axis.set_xscale("log")
            log_ticks(axis.xaxis, (line.x for line in panel.lines), plain=True)
        if "y" in panel.logarithmic:
            axis.set_yscale("log")
            log_ticks(axis.yaxis, (line.y for line in panel.lines), plain=False)
        if panel.y_limits:
            axis.set_ylim(*panel.y_limits)
        axis.set_title(panel.title, fontsize=9, loc="left")
        axis.set_xlabel(panel.x_label)
        axis.set_ylabel(panel.y_label)
        if any(line.name for line in panel.lines):
            legend(axis, panel.legend)
        frame(axis)

    for unused in axes[len(sets) :]:
        unused.set_axis_off()
    if legend_apart and len(sets) < len(axes):
        last = axes[len(sets) - 1]
        last.get_legend().remove()
        axes[len(sets)].legend(*last.get_legend_handles_labels(), frameon=False, loc="center left")
    return figure, axes


def subplots(
    rows: int, columns: int, inches: tuple[float, float], **shared
) -> tuple[Figure, list[Axes]]:
    """A figure and its axes, row by row."""
    figure = Figure(figsize=inches, layout="constrained")
    return figure, list(figure.subplots(rows, columns, squeeze=False, **shared).ravel())


def _dashes_and_markers(style: str | tuple | None, place: int) -> dict:
    """Curves differ by colour, dashes and markers: also on paper without colour."""
    if style is None:
        return {"linestyle": DASHES[place % len(DASHES)]}
    if isinstance(style, tuple):
        return {"linestyle": style}
    if style.startswith("o"):
        return {"linestyle": style[1:] or "none", "marker": MARKERS[place % len(MARKERS)]}
    if style in (*MARKERS, "x"):
        return {"linestyle": "none", "marker": style}
    return {"linestyle": style}


def legend(axis: Axes, where: str = "inside") -> None:
    """The names of an axis's curves inside of it, above it, or aside of the whole figure."""
    if where == "aside":
        axis.figure.legend(loc="outside right upper", fontsize=8, frameon=False)
        return
    size, columns = 8, 4  # letters [pt]
    if where != "above":
        axis.legend(fontsize=size, frameon=False)
        return
    # the title is left, or above the legend where both need more than the width
    names = axis.legend(
        fontsize=size, frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns
    )
    title = axis.get_title(loc="left")
    letters = 0.6 * 9 * len(title) * axis.figure.dpi / 72  # [pixel] at most, of the title
    if title and letters + names.get_window_extent().width > axis.get_window_extent().width:
        # rows of letters, half a line between them, and the legend's margins
        rows = -(-len(names.get_texts()) // columns)
        axis.set_title(title, fontsize=9, loc="left", pad=size * (1.5 * rows + 1.2))


def frame(axis: Axes) -> None:
    """A pale grid, no box."""
    axis.margins(x=0.02)
    axis.grid(alpha=0.3, linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)


def log_ticks(axis: Axis, values: Iterable[Array], *, plain: bool) -> None:
    """Ticks of a logarithmic axis of these values, arrays of any shape. Within a factor of 200 up
    to six values are ticks themselves where `plain`; else ticks are at 1, 2 and 5, closer within a
    factor of 6. Beyond 200 they are powers of ten, written as numbers where `plain`."""
    ticks = np.concatenate([np.ravel(array) for array in values])
    ticks = np.unique(ticks[np.isfinite(ticks)])
    span = ticks[-1] / ticks[0] if ticks.size and ticks[0] > 0 else np.inf
    are_few = plain and ticks.size <= 6
    if are_few and span < 200:
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_minor_locator(NullLocator())
    if plain or span < 200:
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("{x:g}" if span < 200 else NullFormatter())
    if span < 200 and not are_few:
        axis.set_minor_locator(LogLocator(subs=(2, 5) if span >= 6 else (2, 3, 4, 6, 8)))


def matrix(values: Array, names: Sequence[str], label: str) -> bytes:
    """PNG of a square matrix (n, n) of distances with its numbers, dark where they are small."""
    inches = (2.4 + 0.62 * len(names), 1.6 + 0.5 * len(names))
    figure, (axis,) = subplots(1, 1, inches)
    heat_map(axis, values, (names, names), label, cmap="Blues_r", legible=-np.inf)
    axis.tick_params(axis="x", rotation=40)
    return png(figure)


def heat_map(
    axis: Axes,
    values: Array,
    names: tuple[Sequence[str], Sequence[str]],
    label: str,
    *,
    cmap: str = "Blues",
    legible: float = np.inf,
    limits: tuple[float | None, float | None] = (None, None),
) -> None:
    """Values (r, c) as colours with names of rows and columns; numbers from `legible` on."""
    image = axis.imshow(values, cmap=cmap, aspect="auto", vmin=limits[0], vmax=limits[1])
    for (i, j), value in np.ndenumerate(values):
        if value >= legible:
            dark = np.mean(image.cmap(image.norm(value))[:3]) < 0.55
            axis.text(
                j, i, f"{value:.2f}", ha="center", va="center", fontsize=8,
                color="white" if dark else "black",
            )  # fmt: skip
    axis.set_yticks(range(len(names[0])), names[0], fontsize=8)
    axis.set_xticks(range(len(names[1])), names[1], fontsize=8)
    axis.spines[:].set_visible(False)
    axis.figure.colorbar(image, ax=axis, label=label, shrink=0.7)


def correlation_map(axis: Axes, values: Array, names: Sequence[str]) -> None:
    """Correlations (n, n) between -1, blue, and 1, red."""
    heat_map(axis, values, (names, names), "correlation", cmap="RdBu_r", limits=(-1, 1))


def residual_pairs(n: int, height: float) -> tuple[Figure, list[tuple[Axes, Axes]]]:
    """A figure of n pairs of axes over one time: a record, and a third as high its residual below;
    height [inch] of a pair."""
    inches = (9, 1.2 + height * n)
    figure, axes = subplots(2 * n, 1, inches, sharex=True, height_ratios=[3, 1] * n)
    return figure, list(zip(axes[::2], axes[1::2], strict=True))


def outlined_map(
    borders: Sequence[Array], values: Array, edges: Array, names: Sequence[str], label: str
) -> bytes:
    """PNG of values (r, c) as tiles between borders (r + 1,) and (c + 1,) to scale, with edges
    (m, 2, 2) drawn over them; names of the picture and of both axes."""
    width, height = np.ptp(edges.reshape(-1, 2), axis=0)
    figure, (axis,) = subplots(1, 1, (7.5, np.clip(6 * height / width + 1, 2.5, 9)))
    tiles = axis.pcolormesh(*borders, values.T, cmap="viridis")
    axis.add_collection(LineCollection(edges, colors="black", linewidths=1.2))
    axis.set_title(names[0], fontsize=9, loc="left")
    axis.set_xlabel(names[1])
    axis.set_ylabel(names[2])
    axis.set_aspect("equal")
    axis.autoscale_view()
    axis.spines[:].set_visible(False)
    figure.colorbar(tiles, ax=axis, label=label, shrink=0.8)
    return png(figure)


def space_time(axis: Axes, t: Array, v: Array) -> None:
    """Velocity of every sphere v (k, n) [m/s] over time t (k,) [s], linear below a twentieth of the
    largest and logarithmic above: faint waves are visible as well."""
    names = "sphere, 1 = striker, the wall below", "velocity [m/s], towards the wall"
    over_time(axis, t, v, names)
    axis.set_xlabel("time [ms]")


def over_time(
    axis: Axes, t: Array, values: Array, names: tuple[str, str], *, signed: bool = True
) -> None:
    """Values (k, n) of n rows over time t (k,) [s]; names of the rows and the values. Signed ones
    are linear below a twentieth of the largest and logarithmic above, others linear."""
    top, n = np.abs(values).max(initial=0.0) or 1.0, values.shape[1]
    step = max(1, len(t) // 1500)  # no more columns than pixels across the picture
    image = axis.imshow(
        values[::step].T, aspect="auto", cmap="RdBu_r" if signed else "magma_r",
        norm=SymLogNorm(0.05 * top, vmin=-top, vmax=top) if signed else None,
        interpolation="nearest", extent=(1e3 * t[0], 1e3 * t[-1], n + 0.5, 0.5),
    )  # fmt: skip
    axis.set_ylabel(names[0])
    axis.yaxis.set_major_locator(MaxNLocator(integer=True))
    bar = axis.figure.colorbar(image, ax=axis, label=names[1], shrink=0.9)
    bar.ax.minorticks_off()


def spheres(
    axis: Axes, centre: Array, radius: Array, values: Array, label: str, *,
    cmap: str = "viridis", limits: tuple[float, float] | None = None, bar: bool = True,
) -> None:  # fmt: skip
    """Spheres as discs to scale at centres (s, 2) [m] with radii (s,) [m], coloured by values (s,);
    those that are nan are pale."""
    discs = EllipseCollection(
        2e3 * radius, 2e3 * radius, np.zeros(len(radius)), units="xy", offsets=1e3 * centre,
        transOffset=axis.transData, cmap=colormaps[cmap].with_extremes(bad="#e4e4e4"),
        linewidths=0.0,
    )  # fmt: skip
    discs.set_array(np.ma.masked_invalid(values))
    if limits is not None:
        discs.set_clim(*limits)
    axis.add_collection(discs)
    low, high = centre.min(axis=0) - radius.max(), centre.max(axis=0) + radius.max()
    margin = 0.02 * (high - low).max()
    axis.set_xlim(1e3 * (low[0] - margin), 1e3 * (high[0] + margin))
    axis.set_ylim(1e3 * (high[1] + margin), 1e3 * (low[1] - margin))  # the wave runs down the page
    axis.set_aspect("equal")
    axis.spines[["top", "right"]].set_visible(False)
    if bar:
        axis.figure.colorbar(discs, ax=axis, label=label, shrink=0.8)


def discs(axis: Axes, at: Array, diameter: Array, **colours) -> EllipseCollection:
    """Discs of diameters (n,) at points (n, 2), both in the units of the axes, by keywords of
    matplotlib's collections."""
    drawn = EllipseCollection(
        diameter, diameter, np.zeros(len(diameter)), units="xy", offsets=at,
        offset_transform=axis.transData, linewidths=0, **colours,
    )  # fmt: skip
    axis.add_collection(drawn)
    return drawn


def png(figure: Figure, banner: str = "") -> bytes:
    """The picture, under a red banner where it needs one."""
    if banner:
        figure.suptitle(banner, color="#990000", fontsize=10, fontweight="bold")
    raw = BytesIO()
    figure.savefig(raw, format="png", dpi=130, metadata={"Software": None})
    return raw.getvalue()
