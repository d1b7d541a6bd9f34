"""The plots of the study of thickness."""

import numpy as np

from workflows.report.plots import Line, Panel, panels

WAVES = (0.25, 2.0, 4.0, 6.0)  # D/t whose velocities are drawn
RATIO = "sphere diameter over thickness, D/t"


def picture(found, negligible: float, sphere: int) -> bytes:
    """ARR, energy lost, contact time and one sphere's rebound over D/t, and the waves."""
    over_thickness = (_arr(found, negligible), _lost(found), _rebound(found), _contact(found))
    return panels([*over_thickness, *_waves(found, sphere)], columns=2, size=(5.6, 3.4))


def _over(answers, value) -> tuple[np.ndarray, np.ndarray]:
    return np.array([a.ratio for a in answers]), np.array([value(a) for a in answers])


def _both(found, value) -> list[Line]:
    return [
        Line("infinite plate (Zener)", *_over(found.curve, value), colour=0),
        Line("solid plate, finite elements", *_over(found.solid, value), "o", 1),
    ]


def _level(name: str, found, value: float, colour: int = 2, style: str = "--") -> Line:
    ends = np.array([found.curve[0].ratio, found.curve[-1].ratio])
    return Line(name, ends, np.full(2, value), style, colour)


def _arr(found, negligible: float) -> Panel:
    lines = [
        *_both(found, lambda a: a.collision.arr),
        _level("half-space", found, found.half_space.arr),
        Line("thesis: negligible from here", np.full(2, negligible), np.array([0, 1.0]), ":", 4),
    ]
    return Panel("amplitude ratio (v_back / v_in)^(6/5)", RATIO, "ARR", lines, "x")


def _lost(found) -> Panel:
    lines = [
        *_both(found, lambda a: 100 * a.collision.lost),
        _level("half-space, radiated waves", found, 100 * found.radiated),
        _level("thesis: walls thicker than c T_c", found, 5.0, 4, ":"),
    ]
    return Panel("energy absorbed by the wall", RATIO, "% of the striker's", lines, "xy")


def _rebound(found) -> Panel:
    lines = [*_both(found, lambda a: a.restitution), _level("half-space", found, 1.0)]
    return Panel("one sphere alone", RATIO, "restitution", lines, "x")


def _contact(found) -> Panel:
    lines = [
        *_both(found, lambda a: 1e6 * a.collision.contact.seconds),
        _level("half-space", found, 1e6 * found.half_space.contact.seconds),
    ]
    return Panel("contact time of the last sphere", RATIO, "T_c [µs]", lines, "x")


def _waves(found, sphere: int) -> tuple[Panel, Panel]:
    shown = [
        (f"D/t = {a.ratio:g}", a.collision.trajectory) for a in found.solid if a.ratio in WAVES
    ]
    force = [Line(name, 1e3 * run.t, run.contact_force[:, -1]) for name, run in shown]
    speed = [Line(name, 1e3 * run.t, run.v[:, sphere - 1]) for name, run in shown]
    return (
        Panel(
            "force at solid plates; later collisions are echoes from the edges",
            "time [ms]",
            "force [N]",
            force,
        ),
        Panel(f"sphere {sphere}, the same", "time [ms]", "velocity [m/s]", speed),
    )
