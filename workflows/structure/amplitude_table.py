"""Frequency and loss of modes over amplitude: rows, sentences, arrays and pictures."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from beadwave.fem.contact.modal_backbone import ModalBackbone
from beadwave.fem.contact.preloaded_contact import OPEN, SLIDING, STUCK, PreloadedContact
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.tables import aligned_text

N_SHOWN = 4  # amplitudes of a mode in the text; files have all
# facets that do not slip in a loop: colour and word by their state under the preload
UNSLIPPED = {
    OPEN: ("0.92", "open"),
    STUCK: ("0.6", "sticks"),
    SLIDING: ("tab:orange", "slides under the preload"),
}
READING = """\
amplitude: displacement of the point that moves most;  loss factor: twice the damping ratio, of the
friction alone;  ±: standard deviation by the load steps and by the facets, of which few slip at
small amplitudes;  slips: share of the zone"""


class AmplitudeRow(BaseModel):
    """A mode at one amplitude."""

    mode: int
    displacement_m: float  # of the point that moves most
    frequency_hz: float
    loss_factor: float
    dissipated_J: float  # in a cycle
    slip_share: float  # of the zone's area
    loss_deviation: float  # of the loss factor, by load steps and facets
    error: float  # relative, of frequency or loss factor, the larger one


def amplitude_rows(backbones: Mapping[int, ModalBackbone]) -> list[AmplitudeRow]:
    """A row for each mode and amplitude."""
    return [
        AmplitudeRow(
            mode=mode, displacement_m=x, frequency_hz=hz, loss_factor=eta, dissipated_J=D,
            slip_share=share, error=error, loss_deviation=deviation,
        )
        for mode, b in backbones.items()
        for x, hz, eta, D, share, error, deviation in zip(
            *(column.tolist() for column in b[:7]), strict=True
        )
    ]  # fmt: skip


def amplitudes_text(rows: Sequence[AmplitudeRow]) -> str:
    """Some rows of each mode as a table, with how to read its columns."""
    cells = []
    for mode in dict.fromkeys(row.mode for row in rows):
        of_mode = [row for row in rows if row.mode == mode]
        shown = np.unique(np.linspace(0, len(of_mode) - 1, N_SHOWN).round().astype(int))
        cells += [
            (
                mode if i == shown[0] else "",
                f"{1e6 * of_mode[i].displacement_m:.3g}",
                f"{of_mode[i].frequency_hz:.2f}",
                f"{_without_rounding(of_mode[i].loss_factor):.2g}",
                f"{_without_rounding(of_mode[i].loss_deviation):.1g}",
                f"{100 * of_mode[i].slip_share:.0f} %",
            )
            for i in shown
        ]
    head = ("mode", "amplitude [um]", "Hz", "loss factor", "±", "slips")
    return f"{aligned_text(head, cells)}\n{READING}"


def _without_rounding(value: float) -> float:
    """0 for what rounding alone makes."""
    return value if value > 1e-9 else 0.0


def slip_sentences(contact: PreloadedContact, backbones: Mapping[int, ModalBackbone]) -> list[str]:
    """Modes whose faces slip as a whole, and modes whose faces cannot slip or are not sheared."""
    if not contact.friction[contact.state != OPEN].any():
        return [
            "All of the zone slides under the preload, with friction that holds nothing: no facet "
            "is left that could slip in a mode; frequency and loss are those of the first table."
        ]
    whole = [(mode, b.displacement[-1:]) for mode, b in backbones.items() if b.slips_whole]
    sentences = [
        f"Mode {mode}: the faces of a bolt slip as a whole"
        + (f" above {1e6 * at[0]:.3g} um, and nothing else carries the load." if len(at) else ".")
        for mode, at in whole
    ]
    sentences += [
        f"Mode {mode}: bodies roll on their faces"
        + (f" above {1e6 * b.displacement[-1]:.3g} um" if len(b.displacement) else "")
        + ", which loops about one place of contact do not follow."
        for mode, b in backbones.items()
        if b.rolls
    ]
    none = [
        str(mode)
        for mode, b in backbones.items()
        if not (len(b.displacement) or b.slips_whole or b.rolls)
    ]
    if none:
        sentences.append(
            f"Mode{'s' * (len(none) > 1)} {', '.join(none)}: the faces are not sheared; frequency "
            "and loss do not depend on the amplitude."
        )
    return sentences


def slip_displacements(backbones: Mapping[int, ModalBackbone]) -> NDArray[np.float64]:
    """(modes, n) displacement [m] of the point that moves most from which on a facet slips."""
    return np.array([b.first_slip for b in backbones.values()])


def amplitude_picture(rows: Sequence[AmplitudeRow]) -> Picture:
    """Frequency over its value at the least amplitude, and loss factor, over amplitude."""
    from beadwave.workflows.report import plots  # matplotlib takes a third of a second

    figure, (above, below) = plots.subplots(2, 1, (7, 6), sharex=True)
    # three decades of losses; those of single facets below them tell nothing
    least = max(1e-3 * max((row.loss_factor for row in rows), default=0.0), 1e-7)
    for mode in dict.fromkeys(row.mode for row in rows):
        of_mode = [row for row in rows if row.mode == mode]
        x = [1e6 * row.displacement_m for row in of_mode]
        hz = [row.frequency_hz for row in of_mode]
        name = f"mode {mode}, {hz[0]:.4g} Hz"
        above.plot(x, [100 * (f / hz[0] - 1) for f in hz], ".-", label=name)
        (line,) = below.plot(
            x, [_without_rounding(row.loss_factor) or np.nan for row in of_mode], ".-"
        )
        bounds = [
            [max(row.loss_factor + sign * row.loss_deviation, least) for row in of_mode]
            for sign in (-1, 1)
        ]
        below.fill_between(x, *bounds, color=line.get_color(), alpha=0.12, linewidth=0)
    above.set_xscale("log")
    below.set_yscale("log")
    below.set_ylim(bottom=least)
    above.set_ylabel("change of frequency [%]")
    below.set_ylabel("loss factor")
    below.set_xlabel("amplitude of the point that moves most [um]")
    figure.legend(loc="outside upper right", ncols=3, fontsize=8, frameon=False)
    return Picture("amplitude", plots.png(figure))


def slip_picture(contact: PreloadedContact, backbones: Mapping[int, ModalBackbone]) -> Picture:
    """The facets of each mode by the amplitude from which on they slip."""
    from beadwave.workflows.report import plots  # matplotlib takes a third of a second

    facets = contact.facets
    slipping = {mode: b for mode, b in backbones.items() if np.isfinite(b.first_slip).any()}
    n_columns = min(3, max(len(slipping), 1))
    n_rows = -(-max(len(slipping), 1) // n_columns)
    figure, axes = plots.subplots(n_rows, n_columns, (4.2 * n_columns, 3.6 * n_rows))
    first, second = facets.spanned
    at = 1e3 * facets.points[:, [first, second]]
    size = 2e3 * np.sqrt(facets.area / np.pi)
    for axis in axes[len(slipping) :]:
        axis.set_axis_off()
    for axis, (mode, backbone) in zip(axes, slipping.items(), strict=False):
        slips = np.isfinite(backbone.first_slip)
        for state, (colour, _) in UNSLIPPED.items():
            of = ~slips & (contact.state == state)
            plots.discs(axis, at[of], size[of], facecolors=colour)
        coloured = plots.discs(
            axis, at[slips], size[slips], array=np.log10(1e6 * backbone.first_slip[slips]),
            cmap="viridis_r",
        )  # fmt: skip
        bar = figure.colorbar(coloured, ax=axis, label="slips from [um]", shrink=0.8)
        bar.formatter = lambda power, _: f"{10**power:.2g}"
        bar.update_ticks()
        axis.autoscale_view()
        axis.set_aspect("equal")
        axis.set_title(f"mode {mode}", fontsize=9)
        axis.set_xlabel(f"{'xyz'[first]} [mm]")
        axis.set_ylabel(f"{'xyz'[second]} [mm]")
    for colour, word in UNSLIPPED.values():
        axes[0].plot([], [], "o", color=colour, label=word)
    figure.legend(loc="outside upper right", ncols=3, fontsize=8, frameon=False)
    return Picture("slip", plots.png(figure))
