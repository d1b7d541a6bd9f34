"""The errors of the single numbers of a run, by cause: TOF, ARR, peak force, arrivals, peaks.

Each cause is a pair of walls: the reduced and the finer model, and the structure on its mesh and
without what the mesh misses. The chain is marched before both; what a number changes by is its
error, and a share of what the change of the record could do to it, as a number may stay where it is
by accident.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

import coupling
import dem
import rom
from dem.waves.chain_waves import ChainWaves, chain_waves
from workflows.report.summary import NumberError, QuantityErrors
from workflows.scene import Scene
from workflows.stages.chain import Start
from workflows.stages.errors import MARGIN, SHORTER, observed, velocities
from workflows.stages.mesh_error import MissedByMesh
from workflows.stages.walls import wall_of


class QuantityOptions(NamedTuple):
    """How errors of single numbers are found beside those of whole records."""

    # of what the change of the record could do to a number, added to the number's own change, which
    # may be zero by accident. Of ten structures of `examples/mesh_errors.py` times and amplitudes
    # were stated down to 0.56 of the true error with none and down to 0.72 with 0.1; with 0.3 peak
    # forces were stated up to 13 times too large
    floor: float = 0.1


class MarchedPair(NamedTuple):
    """Two runs that differ in their walls alone, and the share of their difference that is an
    error."""

    first: dem.Trajectory
    second: dem.Trajectory
    share: float


def quantity_errors(
    scene: Scene,
    start: Start,
    missed: MissedByMesh,
    reduction: rom.ReducedModel,
    impact: coupling.Impact,
    waves: ChainWaves,
) -> QuantityErrors:
    """Changes of every number of the waves between two walls: of the reduced and of the finer
    model, and of the mesh and without the energy that the mesh misses."""
    on_mesh, without = (
        marched(scene, start, wall, impact) for wall in missed.walls(reduction.contact)
    )
    pairs = {
        "reduction": (of_reduction(scene, start, reduction, impact),),
        "mesh": (MarchedPair(on_mesh, without, missed.share),),
    }
    run, speed = impact.trajectory, float(np.abs(start.velocity).max())
    n, columns = instants(scene, run), observed(scene)
    of_mesh = missed.share * float(np.abs((without.v - on_mesh.v)[:n, columns]).max()) / speed
    numbers = numbers_with_errors(scene, start, impact, waves, pairs)
    explained = tuple(
        number.model_copy(update={"why": missed.at_contact(scene, number.mesh / abs(number.value))})
        if number.mesh and number.value
        else number
        for number in numbers
    )
    return QuantityErrors(explained, of_mesh)


def marched(
    scene: Scene,
    start: Start,
    reduced: rom.ReducedModel,
    impact: coupling.Impact,
    shorter: int = 1,
) -> dem.Trajectory:
    """The impact before another wall, at its instants, by steps so many times as short."""
    run = impact.trajectory
    return dem.march(
        start.chain, wall_of(scene.but(wall={"cutoff": None}), reduced), start.velocity,
        dt=run.dt / shorter, duration=float(run.t[-1]), n_save=len(run.t) - 1,
    )  # fmt: skip


def of_reduction(
    scene: Scene, start: Start, reduction: rom.ReducedModel, impact: coupling.Impact
) -> MarchedPair:
    """The run, and the same before the finer model."""
    finer = marched(scene, start, reduction.finer, impact, SHORTER)
    return MarchedPair(impact.trajectory, finer, MARGIN)


def instants(scene: Scene, run: dem.Trajectory) -> int:
    """Instants of a run up to the scene's horizon."""
    return max(1, int(np.searchsorted(run.t, scene.time.horizon, "right")))


def numbers_with_errors(
    scene: Scene,
    start: Start,
    impact: coupling.Impact,
    waves: ChainWaves,
    pairs: Mapping[str, Sequence[MarchedPair]],
    options: QuantityOptions = QuantityOptions(),
) -> tuple[NumberError, ...]:
    """Every number of the waves with its errors: of the time step, and by cause the sum of those
    of its pairs."""
    run, speed = impact.trajectory, float(np.abs(start.velocity).max())
    at_wall, spheres = scene.wall is not None, scene.output.spheres
    numbers = {id(run): numbers_of(run, waves)}
    for pair in (pair for of_cause in pairs.values() for pair in of_cause):
        for other in (pair.first, pair.second):
            if id(other) not in numbers:
                others = chain_waves(other, start.chain, spheres, at_wall=at_wall)
                numbers[id(other)] = numbers_of(other, others)
    n, estimate, of_run = instants(scene, run), run.error_estimate or 0.0, numbers[id(run)]

    rows = []
    for name, (value, unit, width, sphere) in of_run.items():
        # what a relative change of the record does to the number: of a time a part of the width of
        # the wave, of all else as much
        scale = width if unit == "s" else abs(value)
        wave = name.rpartition(":")[0]
        crest = abs(of_run[f"{wave}: peak_velocity_m_s"][0]) if wave else speed
        errors = dict.fromkeys(pairs, 0.0) | {"time": estimate * scale * speed / crest}
        for cause, of_cause in pairs.items():
            for a, b, share in of_cause:
                record_a, record_b = (
                    r.contact_force[:, -1] if sphere is None else r.v[:, sphere - 1] for r in (a, b)
                )
                at = slice(None, n)
                if sphere is not None:
                    time = of_run[f"{wave}: time_s"][0]
                    at = np.abs(run.t - time) <= max(width, run.t[1])
                largest = float(np.abs(record_a[at]).max(initial=0.0)) or 1.0
                change = float(np.abs(record_b[at] - record_a[at]).max(initial=0.0)) / largest
                first, second, moved = numbers[id(a)], numbers[id(b)], np.nan
                if name in first and name in second:
                    moved = abs(second[name][0] - first[name][0])
                errors[cause] += share * (moved + options.floor * change * scale)
        rows.append(with_errors(name, value, unit, errors))
    return tuple(rows)


def with_errors(name: str, value: float, unit: str, errors: Mapping[str, float]) -> NumberError:
    """A number with its errors by cause, in its unit; one that is not finite is not known."""
    known = {cause: float(error) for cause, error in errors.items() if np.isfinite(error)}
    return NumberError(name=name, value=value, unit=unit, total=sum(known.values()), **known)


def numbers_of(
    run: dem.Trajectory, waves: ChainWaves
) -> dict[str, tuple[float, str, float, int | None]]:
    """Value, unit, width of the wave [s] and sphere of each number, None of those at the wall."""
    numbers: dict[str, tuple[float, str, float, int | None]] = {}
    if (wall := waves.contact) is not None:
        width = wall.contact_time.seconds
        numbers["tof_s"] = wall.tof, "s", width, None
        numbers["arr_2_9"] = wall.arr, "1", width, None
        numbers["peak_wall_force_N"] = float(run.contact_force[:, -1].max()), "N", width, None
        numbers["contact_time_s"] = width, "s", width, None
    for sphere, labels in waves.labels.items():
        for label in labels:
            wave, key = label.arrival, f"{sphere}: {label.name or 'unnamed'}"
            width = wave.width if np.isfinite(wave.width) else 0.0
            numbers[f"{key}: time_s"] = wave.time, "s", width, sphere
            numbers[f"{key}: peak_velocity_m_s"] = wave.peak_velocity, "m/s", width, sphere
    return {name: entry for name, entry in numbers.items() if np.isfinite(entry[0])}


def velocity_error_of_mesh(
    scene: Scene,
    start: Start,
    missed: MissedByMesh,
    contact: rom.Contact,
    impact: coupling.Impact,
) -> float:
    """What the mesh leaves in the observed velocities up to the horizon, relative to the striker's
    speed; raises ValueError where nothing is known."""
    whole = scene.but(wall={"cutoff": None})
    on_mesh, without = (
        velocities(scene, start, wall_of(whole, wall), impact) for wall in missed.walls(contact)
    )
    return missed.share * float(np.abs(without - on_mesh).max() / np.abs(start.velocity).max())


def error_of_mesh(scene: Scene, errors: QuantityErrors) -> float:
    """The mesh's error of all observed velocities, relative to the striker's speed."""
    return errors.mesh
