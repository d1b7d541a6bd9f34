"""A run's single numbers, TOF, ARR, peak force, arrivals and peaks, with their errors by cause.

What a number changes by between two runs is its error, and a share of what the change of the record
could do to it, as a number may stay where it is by accident.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import dem
from beadwave.dem.waves.chain_waves import ChainWaves, chain_waves
from beadwave.workflows.report.summary import NumberError
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start

if TYPE_CHECKING:  # a chain before a simple wall loads no reduced model
    from beadwave import coupling


# Errors of single numbers from those of whole records
# of what the change of the record could do to a time, added to its own change, which may be
# zero by accident. Of ten structures of `examples/mesh_errors.py` times and amplitudes were
# stated down to 0.56 of the true error with none and down to 0.72 with 0.1; with 0.3 peak
# forces were stated up to 13 times too large
TIME_FLOOR = 0.1
# the same of amplitudes, which are where the record is flat: with 0.1 peak velocities were
# stated 3.3 times too large in the median (seed 77), with 0.05 2.7, but down to 0.62 of the
# true error (seed 555, a plate)
AMPLITUDE_FLOOR = 0.08
# the same of the amplitude ratio, whose two waves may change alike: of a plate (seed 31) it was
# stated at 0.48 of its true error with 0.05, at 0.60 with 0.1 and at 0.85 with 0.2
RATIO_FLOOR = 0.2


# by name the value, unit, width of the wave [s] and sphere, None of those at the wall
Numbers = dict[str, tuple[float, str, float, int | None]]


class MarchedPair(NamedTuple):
    """Two runs that differ in their walls alone, and the share of their difference that is an
    error."""

    first: dem.Trajectory
    second: dem.Trajectory
    share: float


class Comparison(NamedTuple):
    """Runs before the better walls of one cause."""

    cause: str
    pairs: tuple[MarchedPair, ...]


def instants(scene: Scene, run: dem.Trajectory) -> int:
    """Instants of a run up to the scene's horizon."""
    return max(1, int(np.searchsorted(run.t, scene.time.horizon, "right")))


def number_errors(
    scene: Scene,
    start: Start,
    impact: coupling.Impact,
    waves: ChainWaves,
    *comparisons: Comparison,
) -> tuple[NumberError, ...]:
    """TOF, ARR, peak force, arrivals and peaks with their errors: of the time step, and by the
    causes that are compared."""
    pairs = {comparison.cause: comparison.pairs for comparison in comparisons}
    return numbers_with_errors(scene, start, impact, waves, pairs)


def numbers_with_errors(
    scene: Scene,
    start: Start,
    impact: coupling.Impact,
    waves: ChainWaves,
    pairs: Mapping[str, Sequence[MarchedPair]],
) -> tuple[NumberError, ...]:
    """Every number of the waves with its errors: of the time step and of the instants that are
    kept, and by cause the sum of those of its pairs."""
    run, speed = impact.trajectory, float(np.abs(start.velocity).max())
    at_wall, spheres = scene.wall is not None, scene.output.spheres
    numbers = {id(run): numbers_of(run, waves)}
    for pair in (pair for of_cause in pairs.values() for pair in of_cause):
        for compared in (pair.first, pair.second):
            if id(compared) not in numbers:
                others = chain_waves(compared, start.chain, spheres, at_wall=at_wall)
                numbers[id(compared)] = numbers_of(compared, others)
    collision = during_largest_collision(run, waves)
    estimate, of_run = run.error_estimate or 0.0, numbers[id(run)]

    # read from every second instant: what lies between the instants of the record costs a third of
    # this change, its error falling with their distance squared; the rest is for instants that lie
    # luckily. Without it the time of flight of `rig-rigid` was stated 24 times too well, 0.03 us
    sparse = run._replace(t=run.t[::2], v=run.v[::2], contact_force=run.contact_force[::2])
    read_sparsely = numbers_of(sparse, chain_waves(sparse, start.chain, spheres, at_wall=at_wall))

    rows = []
    for name, (value, unit, width, sphere) in of_run.items():
        # what a relative change of the record does to the number: of a time a part of the width of
        # the wave, of all else as much
        scale = width if unit == "s" else abs(value)
        wave = name.rpartition(":")[0]
        crest = abs(of_run[f"{wave}: peak_velocity_m_s"][0]) if wave else speed
        if name in read_sparsely:
            between = abs(read_sparsely[name][0] - value)
        else:  # a wave that every second instant does not show: what one instant may be off by
            between = scale * float(run.t[1]) / max(width, float(run.t[1]))
        errors = dict.fromkeys(pairs, 0.0)
        errors["time"] = estimate * scale * speed / crest + between
        for cause, of_cause in pairs.items():
            for a, b, share in of_cause:
                record_a, record_b = (
                    r.contact_force[:, -1] if sphere is None else r.v[:, sphere - 1] for r in (a, b)
                )
                if sphere is not None:
                    time = of_run[f"{wave}: time_s"][0]
                    at = np.abs(run.t - time) <= max(width, run.t[1])
                else:
                    at = collision
                largest = float(np.abs(record_a[at]).max(initial=0.0)) or 1.0
                change = float(np.abs(record_b[at] - record_a[at]).max(initial=0.0)) / largest
                first, second, moved = numbers[id(a)], numbers[id(b)], np.nan
                if name in first and name in second:
                    by_summand = np.subtract(summands(name, second), summands(name, first))
                    moved = float(np.abs(by_summand).sum())
                floors = {"s": TIME_FLOOR, "1": RATIO_FLOOR}
                floor = floors.get(unit, AMPLITUDE_FLOOR)
                errors[cause] += share * (moved + floor * change * scale)
        rows.append(with_errors(name, value, unit, errors))
    return tuple(rows)


def summands(name: str, numbers: Numbers) -> tuple[float, ...]:
    """A number, or what it is the sum of: the time of flight of the contact time and of the time
    along the chain, (2.7) of the thesis. These may move against each other, by amounts of which
    neither is exact: of a bolted cover (`examples/mesh_errors.py 90217`, the eighth) by -0.89 and
    +0.49 us, where the mesh left an error of 1.0 us in the sum."""
    value = numbers[name][0]
    if name != "tof_s":
        return (value,)
    contact_time = numbers["contact_time_s"][0]
    return contact_time, value - contact_time


def during_largest_collision(run: dem.Trajectory, waves: ChainWaves) -> NDArray[np.bool_]:
    """Mask (k,) of the instants from half a contact time before the largest collision with the wall
    to as long behind it; of all where there is none. By changes of the whole record, in which later
    collisions differ by far more, contact times and peak forces were stated 6.0 and 4.8 times too
    large in the median, by those of this collision 2.9 and 2.4 times (`examples/mesh_errors.py
    4021`), and the amplitude ratio of a bracket 33 times (seed 77)."""
    contact = waves.contact and waves.contact.contact_time
    if contact is None or not np.isfinite(contact.seconds):
        return np.ones(len(run.t), bool)
    beside = max(0.5 * contact.seconds, float(run.t[1]))
    return (run.t >= contact.start - beside) & (run.t <= contact.end + beside)


def with_errors(name: str, value: float, unit: str, errors: Mapping[str, float]) -> NumberError:
    """A number with its errors by cause, in its unit; one that is not finite is not known."""
    known = {cause: float(error) for cause, error in errors.items() if np.isfinite(error)}
    return NumberError(name=name, value=value, unit=unit, total=sum(known.values()), **known)


def numbers_of(run: dem.Trajectory, waves: ChainWaves) -> Numbers:
    """Value, unit, width of the wave [s] and sphere of each number, None of those at the wall."""
    numbers: Numbers = {}
    if (wall := waves.contact) is not None:
        width = wall.contact_time.seconds
        numbers["tof_s"] = wall.tof, "s", width, None
        numbers["arr_2_9"] = wall.arr, "1", width, None
        numbers["peak_wall_force_N"] = float(run.contact_force[:, -1].max()), "N", width, None
        # its ends are where the force sets in and dies away, which small changes of the force move
        # far: of four tubes and profiles of `examples/mesh_errors.py 77` the least stated error of
        # it was 0.45 of the true one with one width, 0.62 with three, 0.79 with five
        numbers["contact_time_s"] = width, "s", 5 * width, None
    widths = [label.arrival.width for labels in waves.labels.values() for label in labels]
    widest = max(filter(np.isfinite, widths), default=float(run.t[-1]))
    for sphere, labels in waves.labels.items():
        for label in labels:
            wave, key = label.arrival, f"{sphere}: {label.name or 'unnamed'}"
            # a sphere that flies off keeps its velocity: its wave has no width of its own
            width = wave.width if np.isfinite(wave.width) else widest
            numbers[f"{key}: time_s"] = wave.time, "s", width, sphere
            numbers[f"{key}: peak_velocity_m_s"] = wave.peak_velocity, "m/s", width, sphere
    return {name: entry for name, entry in numbers.items() if np.isfinite(entry[0])}
