"""The crystal in the summary, and the files of its arrays."""

from collections.abc import Iterator

import numpy as np

from beadwave.dem.space import SpaceTrajectory
from beadwave.dem.space.waves import Arrivals, arrivals, front_speed
from beadwave.dem.spheres import contact_radius, max_pressure, modulus_of_contact, relative_radius
from beadwave.dem.validity import HARD, SLOW, SMALL_CONTACT
from beadwave.workflows.files.npz import npz
from beadwave.workflows.report.summary import ChainNumbers, CrystalNumbers
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.crystal.linear import crystal_band_edges
from beadwave.workflows.stages.crystal.packing import CrystalStart


def waves(scene: Scene, start: CrystalStart, march: SpaceTrajectory) -> Arrivals:
    """Arrivals at the saved spheres."""
    return arrivals(march.t, march.velocity)


def crystal_numbers(
    scene: Scene, start: CrystalStart, march: SpaceTrajectory, waves: Arrivals
) -> ChainNumbers:
    """Numbers and warnings of the march."""
    packing = start.packing
    struck = np.flatnonzero(start.moving[march.saved])
    speeds = [None] * 3
    if struck.size:
        centre = packing.rest[march.saved]
        speeds = front_speed(centre, struck, waves.time, start.spacing)
    wall = on_last_wall(scene, start, march)
    crystal = CrystalNumbers(
        n_spheres=len(packing.mass),
        n_contacts=len(packing.A),
        front_speed_m_s=dict(zip("xyz", speeds, strict=True)),
        band_edges_hz=crystal_band_edges(scene),
        peak_structure_force_N=None if wall is None else float(wall.max()),
    )
    errors = march.errors
    numbers = {
        "dt_s": march.dt,
        "n_steps": march.n_steps,
        "n_wall_modes": march.wall_q.shape[1],
        "energy_error": march.energy_error,
        "error_spheres": tuple(int(n) for n in start.number[march.saved][:1000]),
        "sphere_errors_m_s": () if errors is None else tuple(map(float, errors.velocity[:1000])),
        "peak_wall_force_N": crystal.peak_structure_force_N,
        "crystal": crystal,
    }
    warned = (*outside(scene, start, march), *step_given(march))
    return ChainNumbers(numbers, warned, march.error_estimate, coupled=False)


def on_last_wall(scene: Scene, start: CrystalStart, march: SpaceTrajectory) -> np.ndarray | None:
    """(k,) [N] of all saved contacts of the last row with what is behind it; None where nothing
    is, or where not all of the row is saved."""
    leans = scene.wall is not None or scene.crystal.on is not None
    if not leans or not np.isin(start.last, march.saved).all():
        return None
    packing = start.packing
    behind = (packing.pairs[:, 1] < 0) & (packing.arm[:, start.axis] > 0.5)
    return march.pair_force[:, behind[march.contacts]].sum(axis=1)


def outside(scene: Scene, start: CrystalStart, march: SpaceTrajectory) -> Iterator[str]:
    """A sentence for each limit of Hertz' law that the run has passed, as of a chain."""
    packing, pairs = start.packing, march.pairs
    if pairs.size:
        radius, young = packing.radius[march.saved], start.young[march.saved]
        other = np.where(pairs[:, 1] >= 0, radius[pairs[:, 1]], np.inf)
        smaller = np.minimum(radius[pairs[:, 0]], other)
        peak = march.pair_force.max(axis=0)
        R = relative_radius(radius[pairs[:, 0]], other)
        E = modulus_of_contact(packing.A[march.contacts], R)
        ratio = float((contact_radius(peak, R, E) / smaller).max())
        if ratio > SMALL_CONTACT:
            yield (
                f"A contact grows to {ratio:.2g} of the sphere's radius, where Hertz' law requires "
                f"less than {SMALL_CONTACT:g}; reduce the striker's velocity or take a stiffer "
                "material."
            )
        beyond = np.where(pairs[:, 1] >= 0, young[pairs[:, 1]], np.inf)
        softest = np.minimum(young[pairs[:, 0]], beyond)
        pressure = max_pressure(peak, R, E)
        worst = int((pressure / softest).argmax())
        if pressure[worst] > 1.6 * HARD * softest[worst]:
            yield (
                f"The pressure of a contact reaches {1e-9 * pressure[worst]:.3g} GPa, at which its "
                f"softer side would yield with a yield stress of {100 * HARD:g} % of Young's "
                "modulus, which few materials reach; the elastic contact is too stiff there: "
                "reduce the striker's velocity."
            )
    sound = np.sqrt(start.young / start.density)[march.saved]
    fastest = float((np.linalg.norm(march.velocity, axis=2).max(axis=0) / sound).max())
    if fastest > SLOW:
        yield (
            f"A sphere moves at {fastest:.2g} of the speed of sound in it, where a static contact "
            f"law requires less than {SLOW:g}; reduce the striker's velocity."
        )


def step_given(march: SpaceTrajectory) -> Iterator[str]:
    """A sentence on a step that was given and has no error."""
    if march.error_estimate is None:
        yield (
            "The error of a given time.dt is not estimated for a crystal; give time.error to have "
            "it stated."
        )


def crystal_arrays(start: CrystalStart, march: SpaceTrajectory) -> dict[str, np.ndarray]:
    """Arrays of trajectory.npz by name; spheres bear their numbers, contacts the rows of their
    spheres, -1 and -2 for a plane."""
    named = {
        name: values
        for name, values in march._asdict().items()
        if isinstance(values, np.ndarray) and name not in ("saved", "contacts") and values.size
    }
    arrays = named | {
        "rest": start.packing.rest[march.saved],
        "radius": start.packing.radius[march.saved],
        "saved": start.number[march.saved],
    }
    if march.errors is not None:
        arrays |= {f"error_{name}": values for name, values in march.errors._asdict().items()}
    return arrays


def arrivals_csv(start: CrystalStart, march: SpaceTrajectory, waves: Arrivals) -> str:
    """A line for each saved sphere; empty cells where no wave arrives, or no error is known."""
    lines = ["sphere,x,y,z,arrival_s,peak_velocity_m_s,error"]
    errors = None if march.errors is None else march.errors.velocity
    rest = start.packing.rest[march.saved]
    for row, number in enumerate(start.number[march.saved]):
        x, y, z = rest[row].tolist()
        arrival = "" if np.isnan(waves.time[row]) else f"{waves.time[row]:.9g}"
        error = "" if errors is None else f"{errors[row]:.3g}"
        lines.append(f"{number},{x:.9g},{y:.9g},{z:.9g},{arrival},{waves.peak[row]:.9g},{error}")
    return "\n".join(lines) + "\n"


def crystal_files(
    scene: Scene, start: CrystalStart, march: SpaceTrajectory, waves: Arrivals
) -> dict[str, bytes]:
    """Content of trajectory.npz and arrivals.csv by name."""
    return {
        "trajectory.npz": npz(crystal_arrays(start, march)),
        "arrivals.csv": arrivals_csv(start, march, waves).encode(),
    }
