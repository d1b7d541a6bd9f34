"""The picture of the study of the reduction, and what it draws: a case for each reduced wall."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from workflows.report.plots import Line, Panel, panels

KINDS = ("free-modes", "craig-bampton")
CHOICES = ("contact", "lowest")


class Case(NamedTuple):
    """One reduced wall: what it gets wrong and the seconds it takes."""

    method: str
    n_modes: int
    reach: float  # [Hz] of the highest mode
    receptance: tuple[float, ...]  # relative rms error per band
    velocities: float  # relative to the striker
    reduce: float  # [s] of the processor
    march: float  # [s] of the processor


def method_name(kind: str, choice: str, bare: bool) -> str:
    """What the table calls a way to reduce."""
    lowest = "" if choice == CHOICES[0] else f" {choice}"
    return f"{kind}{lowest}{'' if bare else ' + residual'}"


def picture(cases: tuple[Case, ...], bands_hz: tuple[float, ...]) -> bytes:
    """PNG: errors and costs over the number of modes."""
    measures = [
        (f"receptance to {band / 1e3:g} kHz", lambda c, i=i: c.receptance[i])
        for i, band in enumerate(bands_hz)
    ]
    measures += [("velocities of the observed spheres", lambda c: c.velocities)]
    drawn = [
        Panel(name, "modes", "relative error", _lines(cases, error), "xy")
        for name, error in measures
    ]
    reduced = _lines(cases, lambda c: c.reduce)
    marched = _lines(cases, lambda c: 1e3 * c.march, named=True)
    drawn += [
        Panel("cost of the reduction", "modes", "seconds", reduced, "xy"),
        Panel("cost of the time integration", "modes", "milliseconds", marched, "xy"),
    ]
    return panels(drawn, columns=3, size=(4.6, 3.6), legend_apart=True)


def _lines(
    cases: tuple[Case, ...], value: Callable[[Case], float], *, named: bool = False
) -> list[Line]:
    """A kind of reduction has a colour, a choice of modes its dashes; named once for all panels."""
    styles = (("contact", False, "o-"), ("lowest", False, "o--"), ("contact", True, "o:"))
    return [
        Line(name if named else None, *_points(cases, name, value), style, i)
        for i, kind in enumerate(KINDS)
        for choice, bare, style in styles
        for name in (method_name(kind, choice, bare),)
    ]


def _points(cases, method: str, value: Callable[[Case], float]):
    chosen = [case for case in cases if case.method == method]
    return np.array([c.n_modes for c in chosen]), np.array([value(c) for c in chosen])
