"""Several chains in the summary: the numbers of each, warnings, and the files of their arrays."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from beadwave import dem
from beadwave.dem import space
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.workflows.files.npz import npz
from beadwave.workflows.report.summary import (
    ChainNumbers,
    ChainOnStructureNumbers,
    ErrorEstimate,
)
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages import warnings
from beadwave.workflows.stages.chain.chain import contact_radius
from beadwave.workflows.stages.chain.friction import numbers_across
from beadwave.workflows.stages.chain.several import ChainsStart
from beadwave.workflows.stages.chain.waves import chain_contact, sphere_waves

if TYPE_CHECKING:
    from beadwave.coupling.sensors import SensorRecord  # scipy's filters, a second

UNPRESSED = 1e-6  # of the largest force in a chain, what does not press on the structure
Runs = tuple[tuple[space.RowRun, ChainWaves], ...]


def chains_numbers(
    scene: Scene,
    start: ChainsStart,
    structure: space.Structure,
    march: space.SpaceTrajectory,
    waves: Runs,
) -> ChainNumbers:
    """Numbers and warnings of all chains, and of each by its name."""
    names, of_each = [row.name for row in scene.chains], scene.of_each_chain
    errors = None if march.errors is None else march.errors.velocity
    each, warned = {}, []
    for i, (name, (run, tracked)) in enumerate(zip(names, waves, strict=True)):
        one, first = of_each[name], start.starts[i]
        peak = float(run.contact_force[:, -1].max())
        friction = None
        if run.across is not None:
            friction = numbers_across(one, first, run, run.across, march.dt, march.error_estimate)
        each[name] = ChainOnStructureNumbers(
            peak_wall_force_N=peak,
            contact_radius_m=first.ellipse.size * contact_radius(one, first, peak),
            waves={str(s): sphere_waves(tracked, run.t, run.v, s) for s in tracked.labels},
            wall_contact=chain_contact(one, tracked),
            friction=friction,
            errors=ErrorEstimate(time=march.error_estimate),
            sphere_errors_m_s=(
                () if errors is None else tuple(map(float, errors[start.rows.row == i]))
            ),
        )
        warned += [f"chains.{name}: {sentence}" for sentence in _warnings(one, first, run, tracked)]
    numbers = {
        "n_wall_modes": len(structure.omega),
        "dt_s": march.dt,
        "n_steps": march.n_steps,
        "energy_error": march.energy_error,
        "peak_wall_force_N": max(numbers.peak_wall_force_N for numbers in each.values()),
        "chains": each,
    }
    if scene.gravity and not march.work_gravity.any():
        warned.append(
            "[gravity] acts across all chains, whose guides carry their weight: it changes "
            "nothing; turn gravity.direction, or drop it."
        )
    if march.error_estimate is None:
        warned.append(
            "The error of a given time.dt is not estimated for several chains; give time.error to "
            "have it stated."
        )
    return ChainNumbers(numbers, tuple(warned), march.error_estimate, coupled=False)


def _warnings(scene: Scene, start, run: space.RowRun, waves: ChainWaves) -> Iterator[str]:
    """Warnings on one of several chains."""
    # a wave announces itself by forces of 1e-300 N
    if run.contact_force[:, -1].max() <= UNPRESSED * run.contact_force.max():
        yield (
            f"Nothing presses on the structure within time.duration = {scene.time.duration:g} s; "
            "take longer, or a faster striker."
        )
    yield from dem.outside(warnings.strain(scene, start, run))
    yield from dem.yielding(start.chain, run)
    yield from warnings.unequal_spheres(start)
    yield from warnings.overlapping_waves(waves)
    if run.across is not None:
        yield from warnings.unbalanced(run.across)
        yield from warnings.high_friction(scene)
        yield from warnings.neglected_coupling(scene, start)


def chains_arrays(
    scene: Scene,
    start: ChainsStart,
    structure: space.Structure,
    march: space.SpaceTrajectory,
    waves: Runs,
) -> dict[str, np.ndarray]:
    """Arrays of trajectory.npz by name, all chains in order; `chain` (n,) is which one each sphere
    is of, from 0."""
    rows = start.rows
    runs = [run for run, _ in waves]
    along = np.searchsorted(structure.point, np.arange(structure.n_points))
    arrays = {
        "t": march.t,
        **{name: np.hstack([getattr(run, name) for run in runs])
           for name in ("x", "v", "contact_force")},
        "chain": rows.row,
        **{name: getattr(march, name)[:, along] for name in ("wall_x", "wall_v", "wall_force")},
        "wall_q": march.wall_q.astype(np.float32),
        "wall_omega": structure.omega,
        "wall_phi": structure.phi[along],
        # where each sphere touches the next, and along what it moves
        "rest": rows.packing.rest - rows.start[:, None] * rows.direction,
        "direction": rows.direction,
        "radius": rows.packing.radius,
    }  # fmt: skip
    arrays |= {
        name: values for name, values in march._asdict().items()
        if name.startswith(("energy_", "dissipated_", "work_"))
        and isinstance(values, np.ndarray) and values.any()
    }  # fmt: skip
    # of the chains with friction in turn
    if across := [(i, run.across) for i, run in enumerate(runs) if run.across is not None]:
        arrays |= {
            name: np.stack([getattr(of_row, name) for _, of_row in across], axis=1)
            for name in space.AcrossRun._fields
            if name not in ("dissipated_friction", "cycle")
        }
        arrays["rubbing"] = np.array([i for i, _ in across])
        if (first := across[0][1].cycle) is not None:
            cycles = [of_row.cycle._asdict() for _, of_row in across]
            arrays |= {
                f"cycle_{name}": np.stack([cycle[name] for cycle in cycles], axis=1)
                for name in ("friction_force", "slip", "sphere_t", "stick_share")
            } | {"cycle_t": first.t}
    if march.errors is not None:
        arrays |= {
            "error_x": march.errors.displacement,
            "error_v": march.errors.velocity,
            "error_contact_force": march.errors.pair_force[rows.contact],
        }
    return arrays


def chains_files(
    scene: Scene,
    start: ChainsStart,
    structure: space.Structure,
    march: space.SpaceTrajectory,
    waves: Runs,
    record: SensorRecord | None = None,
) -> dict[str, bytes]:
    """Content of trajectory.npz, and of signals.csv where sensors record, by name."""
    files = {"trajectory.npz": npz(chains_arrays(scene, start, structure, march, waves))}
    if record is not None:
        from beadwave.workflows.stages.chain.sensor_signals import csv_text

        files["signals.csv"] = csv_text(scene, record).encode()
    return files
