"""The chain in the summary: its numbers and warnings, and the files of its arrays.

They are stages of their own since they are small against the march that they are made from: a run
whose results are kept loads neither the march nor the libraries that its types belong to.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from beadwave import coupling, dem
from beadwave.coupling.saved_run import arrays
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.workflows.files.npz import npz
from beadwave.workflows.report.summary import ChainNumbers
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages import warnings
from beadwave.workflows.stages.chain.chain import Start, contact_radius
from beadwave.workflows.stages.chain.waves import chain_contact, sphere_waves

if TYPE_CHECKING:
    from beadwave.coupling.sensor_record import SensorRecord  # scipy's filters, a second
    from beadwave.dem.lateral import LateralTrajectory


def chain_numbers(
    scene: Scene,
    start: Start,
    wall: dem.Wall | coupling.CoupledWall | None,
    impact: coupling.Impact,
    waves: ChainWaves,
) -> ChainNumbers:
    """Numbers and warnings of a march and its waves."""
    run, verdict, *_ = impact
    numbers = {
        "n_wall_modes": 0 if wall is None else len(wall.omega),
        "dt_s": run.dt,
        "n_steps": run.n_steps,
        "energy_error": run.energy_error,
        "error_spheres": scene.output.spheres or tuple(range(1, start.velocity.size + 1)),
        "sphere_errors_m_s": () if run.errors is None else tuple(map(float, run.errors.v)),
        "verdict": (*verdict.sentences, *dem.yielding(start.chain, run)),
        "waves": {str(s): sphere_waves(waves, run.t, run.v, s) for s in waves.labels},
        "wall_contact": chain_contact(scene, waves),
    }
    if wall is not None:
        peak = float(run.contact_force[:, -1].max())
        radius = start.ellipse.size * contact_radius(scene, start, peak)
        numbers |= {"peak_wall_force_N": peak, "contact_radius_m": radius}
    return ChainNumbers(
        numbers,
        tuple(warnings.of_chain(scene, start, impact, waves)),
        run.error_estimate,
        isinstance(wall, coupling.CoupledWall),
    )


def chain_files(
    scene: Scene,
    impact: coupling.Impact,
    wall: dem.Wall | coupling.CoupledWall | None,
    record: SensorRecord | None = None,
    *,
    lateral: LateralTrajectory | None = None,
) -> dict[str, bytes]:
    """Content of trajectory.npz, with the motion across the chain where there is one, and of
    signals.csv where sensors record, by name."""
    files = {"trajectory.npz": npz(arrays(impact.trajectory, wall, lateral))}
    if record is not None:
        from beadwave.workflows.stages.chain.sensor_signals import csv_text

        files["signals.csv"] = csv_text(scene, record).encode()
    return files
