"""One sphere in several runs: its velocities as a panel, its waves as cells of a table."""

from collections.abc import Iterable

from workflows.evidence.thesis.observed_run import Observed
from workflows.report.plots import Line, Panel


def record(title: str, runs: Iterable[Observed], sphere: int) -> Panel:
    """Velocity of a sphere over time, a curve for each run."""
    lines = [Line(run.name, run.milliseconds, run.velocity(sphere)) for run in runs]
    return Panel(title, "time [ms]", "velocity [m/s]", lines)


def wave_columns(numbers: Iterable[int]) -> list[str]:
    """Headings of `wave_cells`: time and peak velocity of each reflected wave."""
    return [f"{what}{k}" for k in numbers for what in ("t_ms_", "v_m_s_")]


def wave_cells(run: Observed, sphere: int, numbers: Iterable[int]) -> list[float | None]:
    """Time [ms] and peak velocity [m/s] of the reflected waves, None for one that is not seen."""
    waves = [run.wave(sphere, "reflected", k) for k in numbers]
    pairs = [(1e3 * w.arrival.time, w.arrival.peak_velocity) if w else (None, None) for w in waves]
    return [value for pair in pairs for value in pair]
