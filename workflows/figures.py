"""Plots of a run as PNG: velocities, energies, the frequency response at the contact."""

from collections.abc import Sequence
from io import BytesIO
from typing import NamedTuple

import numpy as np
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

Array = NDArray[np.float64]
# told apart by lightness as well, and where that is not enough by dashes and markers
COLOURS = ("#0b3c7d", "#e0522d", "#1b7f4b", "#e3a008", "#5b3a9e", "#2aa1b3", "#7f4f24", "#c2458f")
DASHES = ("-", (0, (6, 2)), (0, (6, 2, 1.5, 2)), (0, (1.5, 1.5)), (0, (10, 3)))
MARKERS = "os^Dv"
LEGIBLE = 0.05  # smallest MAC written into its cell
LEDGER = {
    "energy_kinetic": "spheres, kinetic",
    "energy_contact": "contacts",
    "energy_leaf": "leaf springs",
    "energy_wall": "wall modes",
    "energy_residual": "wall, static",
    "dissipated_contact": "dissipated in contacts",
    "dissipated_wall": "dissipated in the wall",
    "work_preload": "work of the preload",
}


class Curve(NamedTuple):
    """Points of a method, ours or somebody else's."""

    name: str
    x: Array
    y: Array
    ours: bool


class Mark(NamedTuple):
    """A wave in a record."""

    name: str
    time: float  # [s]
    velocity: float  # [m/s]


def velocities(
    t: Array, v: Array, spheres: tuple[int, ...], marks: dict[int, list[Mark]] | None = None
) -> bytes:
    """Velocities of the observed spheres, one panel each; t (k,) [s], v (k, n) [m/s]."""
    figure = Figure(figsize=(8, 1 + 1.7 * len(spheres)), layout="constrained")
    panels = figure.subplots(len(spheres), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, sphere, colour in zip(panels, spheres, _colours(len(spheres)), strict=True):
        panel.plot(1e3 * t, v[:, sphere - 1], color=colour, linewidth=1.2)
        for mark in (marks or {}).get(sphere, []):
            _marked(panel, mark)
        panel.set_ylabel(f"sphere {sphere}\nvelocity [m/s]")
        panel.margins(y=0.15)
        _plain(panel)
    panels[-1].set_xlabel("time [ms]")
    return _png(figure)


def train_mark(wave) -> str:
    """A wave's number, after an i if it is incident."""
    if wave.kind == "reflected":
        return str(wave.number)
    return "i" if wave.number == 1 else f"i{wave.number}"


def _marked(panel, mark: Mark) -> None:
    up = 1 if mark.velocity > 0 else -1
    panel.annotate(
        mark.name, (1e3 * mark.time, mark.velocity), (0, 3 * up), textcoords="offset points",
        ha="center", va="bottom" if up > 0 else "top", fontsize=8,
    )  # fmt: skip


def space_time(t: Array, v: Array, trains: Sequence) -> bytes:
    """Velocity of every sphere over time, v (k, n), with the waves that were followed."""
    figure = Figure(figsize=(8, 4.6), layout="constrained")
    panel, n = figure.subplots(), v.shape[1]
    top = np.abs(v).max() or 1.0
    every = max(1, len(t) // 1500)  # no more than the picture's columns
    norm = SymLogNorm(0.05 * top, vmin=-top, vmax=top)
    shown = panel.imshow(
        v[::every].T, aspect="auto", cmap="RdBu_r", norm=norm,
        extent=(1e3 * t[0], 1e3 * t[-1], n + 0.5, 0.5), interpolation="nearest",
    )  # fmt: skip
    for train in trains:
        places = [pulse.contact + 0.5 for pulse in train.pulses]
        times = [1e3 * pulse.time for pulse in train.pulses]
        panel.plot(times, places, color="black", linewidth=0.8, linestyle=(0, (3, 2)))
        late = times[-1] > 1e3 * (0.97 * t[-1] + 0.03 * t[0])
        panel.annotate(
            train_mark(train), (times[-1], places[-1]), (-4 if late else 4, 0),
            textcoords="offset points", fontsize=8, va="center", ha="right" if late else "left",
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "linewidth": 0},
        )  # fmt: skip
    panel.set_xlim(1e3 * t[0], 1e3 * t[-1])
    panel.set_ylim(n + 0.5, 0.5)
    panel.set_xlabel("time [ms]")
    panel.set_ylabel("sphere, 1 = striker, the wall below")
    bar = figure.colorbar(shown, label="velocity [m/s], towards the wall", shrink=0.9)
    bar.ax.minorticks_off()
    return _png(figure)


def energies(t: Array, ledger: dict[str, Array]) -> bytes:
    """The ledger over time and its closure; t (k,) [s], each term (k,) [J]."""
    figure = Figure(figsize=(8, 5.6), layout="constrained")
    terms, closure = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    shown = {name: value for name, value in ledger.items() if name in LEDGER and np.any(value)}
    for i, (name, value) in enumerate(shown.items()):
        terms.plot(
            1e3 * t, 1e3 * value, color=COLOURS[i % len(COLOURS)], linewidth=1.2,
            linestyle=DASHES[i % len(DASHES)], label=LEDGER[name],
        )  # fmt: skip
    total = ledger["energy_total"]
    terms.plot(1e3 * t, 1e3 * total, color="black", linewidth=1, linestyle="--", label="total")
    terms.set_ylabel("energy [mJ]")
    terms.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4, fontsize=8, frameon=False)
    gap = (total - total[0]) / max(ledger["energy_kinetic"][0], 1e-300)
    power = int(np.floor(np.log10(np.abs(gap).max(initial=0.0) or 1.0)))
    closure.plot(1e3 * t, gap / 10.0**power, color="black", lw=0.9)
    closure.set_ylabel(f"closure error\n[1e{power} of the\nstriker's]")
    closure.set_xlabel("time [ms]")
    for panel in (terms, closure):
        _plain(panel)
    return _png(figure)


def frequency_response(
    frequency: Array, reduced: Array, full_frequency: Array, full: Array, damping: str
) -> bytes:
    """Displacement per force at the contact, reduced model (line) against full order (dots)."""
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    panel = figure.subplots()
    panel.loglog(frequency, np.abs(reduced), color=COLOURS[0], linewidth=1.3, label="reduced model")
    panel.loglog(
        full_frequency, np.abs(full), "o", color=COLOURS[1], markersize=5, fillstyle="none",
        label="full model, direct solution",
    )  # fmt: skip
    panel.set_xlabel("frequency [Hz]")
    panel.set_ylabel("displacement per force [m/N]")
    panel.set_title(damping, fontsize=9, loc="left")
    panel.legend(frameon=False)
    _plain(panel)
    return _png(figure)


def work_precision(curves: list[Curve], title: str) -> bytes:
    """Error over run time; x warm time [ms], y relative velocity error."""
    figure = Figure(figsize=(8, 5.2), layout="constrained")
    panel = figure.subplots()
    _curves(panel, curves)
    panel.set_xlabel("run time, warm [ms]")
    panel.set_ylabel("velocity error, relative to the fastest sphere at the start")
    panel.set_title(title, fontsize=9, loc="left")
    panel.set_ylim(top=1.0)
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    return _png(figure)


def growth(curves: list[Curve], xlabel: str) -> bytes:
    """Run time over a size; y [ms]."""
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    panel = figure.subplots()
    _curves(panel, curves)
    panel.set_xlabel(xlabel)
    panel.set_ylabel("run time, warm [ms]")
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    return _png(figure)


def _curves(panel, curves: list[Curve]) -> None:
    """Ours as full lines in colour, others dashed in greys."""
    ours = [curve for curve in curves if curve.ours]
    others = [curve for curve in curves if not curve.ours]
    for i, (curve, colour) in enumerate(zip(ours, [*COLOURS, "black"], strict=False)):
        marker = MARKERS[i % len(MARKERS)]
        panel.loglog(
            curve.x, curve.y, marker=marker, color=colour, ms=3.5, lw=1.4, label=curve.name
        )
    for i, curve in enumerate(others):
        grey = str(0.25 + 0.45 * i / max(len(others) - 1, 1))
        marker = "sD^v<>PX"[i % 8]
        panel.loglog(
            curve.x, curve.y, linestyle="--", marker=marker, color=grey, ms=4, lw=1,
            label=curve.name,
        )  # fmt: skip
    _plain(panel)


def mesh_convergence(seed: Array, error: dict[str, Array]) -> bytes:
    """Relative error of the four modes (k, 4) against the element size (k,) [m], by constraint."""
    figure = Figure(figsize=(8, 3.8), layout="constrained")
    panels = figure.subplots(1, len(error), sharey=True, squeeze=False)[0]
    for panel, (constraint, values) in zip(panels, error.items(), strict=True):
        shown = np.where(values > 0, values, np.nan)
        for i, colour in enumerate(_colours(values.shape[1])):
            panel.loglog(
                1e3 * seed, 100 * shown[:, i], marker=MARKERS[i], color=colour, markersize=4,
                linewidth=1.2, label=f"mode {i + 1}",
            )  # fmt: skip
        panel.set_title(constraint, fontsize=10, loc="left")
        panel.set_xlabel("element size in the sheets [mm]")
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter("{x:g}")
        panel.yaxis.set_minor_formatter(NullFormatter())
        panel.tick_params(which="both", labelsize=8)
        _plain(panel)
    panels[0].set_ylabel("frequency error [%]")
    panels[0].legend(frameon=False, fontsize=8)
    return _png(figure)


def mac_matrix(alike: Array, frequency_hz: Array) -> bytes:
    """MAC (k, 4) of modes at frequencies (k,) [Hz] with the four of stiff joints."""
    figure = Figure(figsize=(5, 1.2 + 0.26 * len(alike)), layout="constrained")
    panel = figure.subplots()
    shown = panel.imshow(alike, vmin=0, vmax=1, cmap="Blues", aspect="auto")
    for (i, j), value in np.ndenumerate(alike):
        if value >= LEGIBLE:
            colour = "white" if value > 0.6 else "black"
            panel.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=8, color=colour)
    panel.set_xticks(range(4), [f"mode {i}" for i in range(1, 5)])
    panel.set_yticks(range(len(alike)), [f"{hz:.0f} Hz" for hz in frequency_hz], fontsize=8)
    panel.set_xlabel("with stiff joints")
    panel.spines[:].set_visible(False)
    figure.colorbar(shown, label="MAC", shrink=0.6)
    return _png(figure)


def component_effects(
    effects: dict[str, tuple[tuple[str, ...], Array, Array]],
) -> bytes:
    """Percent that each component adds to the four modes, ours beside the thesis'.

    By constraint: names of the components (c,), ours (c, 4), the thesis' (c, 4) [%].
    """
    figure = Figure(figsize=(8, 3.8), layout="constrained")
    panels = figure.subplots(1, len(effects), sharey=True, squeeze=False)[0]
    for panel, (constraint, (components, ours, thesis)) in zip(
        panels, effects.items(), strict=True
    ):
        place = np.arange(len(components))
        for i, colour in enumerate(_colours(4)):
            at = place + 0.19 * (i - 1.5)
            panel.bar(at - 0.045, ours[:, i], 0.085, color=colour, label=f"mode {i + 1}")
            panel.bar(
                at + 0.045, thesis[:, i], 0.085, color=colour, alpha=0.35,
                label="thesis, pale" if i == 3 else None,
            )  # fmt: skip
        panel.set_xticks(place, components)
        panel.set_title(constraint, fontsize=10, loc="left")
        panel.axhline(0, color="black", linewidth=0.8)
        _plain(panel)
    panels[0].set_ylabel("change of the frequency [%]")
    panels[0].legend(frameon=False, fontsize=8)
    return _png(figure)


def _colours(n: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(n)]


def _plain(panel) -> None:
    panel.margins(x=0.01)
    panel.grid(alpha=0.3, linewidth=0.6)
    panel.spines[["top", "right"]].set_visible(False)


def _png(figure: Figure) -> bytes:
    raw = BytesIO()
    figure.savefig(raw, format="png", dpi=130, metadata={"Software": None})
    return raw.getvalue()
