"""The chain's stages: what it leans on, and the impact. Nothing of the assembly is loaded here."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import coupling
import dem
from dem import spheres
from dem.wave_measures import contact_time
from workflows.scene import (
    Contact,
    DashpotWall,
    InvalidScene,
    OneDofWall,
    RigidWall,
    RomWall,
    Scene,
)

PRUNED_AT = 1e-4  # error of the velocities where the scene gives a step instead
THIN = 0.65  # k h up to which Zener's plate takes the energy of a solid one within a tenth
MOST_WORK = 1e10  # steps of spheres, minutes to an hour
ROUGH = 0.01  # error of a given step that deserves a warning


class Surface(NamedTuple):
    """Material that the last sphere touches."""

    young: float  # [Pa]
    poisson: float


def surface(scene: Scene) -> Surface:
    """The wall's material at the contact; a rigid wall has an infinite modulus."""
    if isinstance(scene.wall, RigidWall):
        return Surface(np.inf, 0.0)
    return Surface(scene.wall.young, scene.wall.poisson)


def chain(scene: Scene) -> dem.Chain:
    """The spheres, their contacts and what holds them."""
    c, contact, leaf = scene.chain, scene.contact, scene.leaf_springs
    touched = Surface(np.inf, 0.0) if scene.wall is None else surface(scene)
    row = dem.row_of_spheres(
        c.radius,
        c.density,
        c.young,
        c.poisson,
        count=c.count,
        wall_young=touched.young,
        wall_poisson=touched.poisson,
        free=scene.wall is None,
        stiffness_factor=np.asarray(contact.stiffness_factor),
        **dissipation(contact),
        leaf_stiffness=np.asarray(leaf.stiffness) if leaf else None,
        leaf_anchor=np.asarray(leaf.offset) if leaf else None,
        preload=scene.preload.force if scene.preload else 0.0,
    )
    if scene.preload:
        row.mass[-1] += scene.preload.mass
    if contact.yield_pressure is None:
        return row
    return row._replace(yield_overlap=yield_overlaps(row, contact.yield_pressure))


def yield_overlaps(row: dem.Chain, pressure: Any) -> np.ndarray:
    """(n_contacts,) [m] at which the contacts, as stiff as they are, reach the pressure [Pa]."""
    R = spheres.radii_of_contacts(row.radius)[: row.A.size]
    E_star = spheres.modulus_of_contact(row.A, R)
    return spheres.yield_overlap(R, E_star, np.broadcast_to(pressure, R.shape))


def require_start(scene: Scene) -> None:
    """Raise InvalidScene where the chain has no state of rest, the step no meaning or the run no
    end, of all walls but those that are yet to be reduced."""
    if isinstance(scene.wall, RomWall):
        return
    row, leant_on, v0 = chain(scene), wall(scene), initial_velocity(scene)
    try:
        dem.require_march(row, leant_on, v0, dt=scene.time.dt)
        _require_end(scene, dem.stability_limit(row, leant_on, v0))
    except (dem.InvalidChain, dem.NoEquilibrium, dem.UnstableStep) as error:
        raise InvalidScene(f"{scene.name}: {str(error).rstrip('.')}.") from None


def _require_end(scene: Scene, longest: float) -> None:
    """The same where steps as long [s] as they may be make more work than days hold."""
    steps, n = scene.time.duration / longest, scene.chain.count
    if steps * n > MOST_WORK:
        raise InvalidScene(
            f"{scene.name}: time.duration = {scene.time.duration:g} s takes more than {steps:.1e} "
            f"steps of {longest:.2g} s, allowed for {n} spheres are {MOST_WORK / n:.1e}; take less."
        )


def dissipation(contact: Contact) -> dict[str, Any]:
    """The law and its coefficients; a coefficient of zero is no law, and costs nothing."""
    gamma = np.asarray(contact.coefficient)
    if contact.dissipation == "none" or not np.any(gamma):
        return {}
    return {"dissipation": contact.dissipation, "gamma": gamma}


def initial_velocity(scene: Scene) -> np.ndarray:
    """(n,) [m/s]"""
    if scene.chain.initial_velocity is not None:
        return np.array(scene.chain.initial_velocity)
    return np.array([scene.striker.velocity] + [0.0] * (scene.chain.count - 1))


def impact(scene: Scene, wall: dem.Wall | coupling.CoupledWall | None) -> coupling.Impact:
    """The coupled run to the error asked for, or at the step given."""
    time, observed = scene.time, scene.output.spheres
    wanted = {"dt": time.dt}
    if time.dt is None:
        wanted = {"error": time.error}
    if time.dt is None and not isinstance(wall, coupling.CoupledWall):
        wanted["observed"] = [sphere - 1 for sphere in observed] or None
        wanted["horizon"] = time.horizon
    row, v0 = chain(scene), initial_velocity(scene)
    found = coupling.impact(
        row, wall, v0, duration=time.duration, n_save=scene.output.samples - 1, **wanted
    )
    if not isinstance(wall, coupling.CoupledWall):
        return found
    estimated = coupling.with_coupled_error(row, wall, v0, found.trajectory, error=time.error)
    return found._replace(trajectory=estimated)


def wall(scene: Scene, reduction: Any = None) -> dem.Wall | coupling.CoupledWall | None:
    """What the chain leans on; None for a free chain."""
    match scene.wall:
        case None:
            return None
        case OneDofWall(frequency=frequency, mass=mass, damping_ratio=ratio):
            return dem.one_dof_wall(frequency, mass, ratio)
        case DashpotWall(coefficient=None, plate_thickness=thickness, density=density):
            return dem.plate_wall(scene.wall.young, scene.wall.poisson, density, thickness)
        case DashpotWall(coefficient=coefficient):
            return dem.dashpot_wall(coefficient)
        case RomWall():
            from workflows.reduced_wall import wall_of

            return wall_of(scene, reduction)
    return dem.rigid_wall()


class PrunedWall(NamedTuple):
    """A wall of fewer modes, and what was left out in sentences."""

    wall: dem.Wall
    sentences: tuple[str, ...]


def pruning(scene: Scene, whole_wall: dem.Wall) -> PrunedWall:
    """The wall without the modes that do not matter at the error asked for."""
    if isinstance(whole_wall, coupling.CoupledWall):
        raise ValueError("wall.prune needs a wall that is read where it is pushed; drop the key.")
    v0 = initial_velocity(scene)
    error = PRUNED_AT if scene.time.error is None else scene.time.error
    found = coupling.prune(chain(scene), whole_wall, v0, duration=scene.time.duration, error=error)
    return PrunedWall(found.wall, found.sentences)


def pruned_wall(scene: Scene, pruning: PrunedWall) -> dem.Wall:
    """What is left of the wall."""
    return pruning.wall


def spoilt(scene: Scene, impact: coupling.Impact) -> tuple[str, ...]:
    """What a run has left of its model, and a step that was given too large."""
    run = impact.trajectory
    found = dem.strain(chain(scene), scene.chain.young, run.contact_force, run.v)
    told = rough(run.error_estimate), chaotic(scene), odd_file(scene), between_samples(scene)
    spoilt_by = (*told, thick(scene, run))
    return (*dem.outside(found), *(sentence for sentences in spoilt_by for sentence in sentences))


def odd_file(scene: Scene) -> tuple[str, ...]:
    """Sentences on a wall's file that can be run but was probably meant otherwise."""
    if not isinstance(scene.wall, RomWall) or scene.wall.file is None:
        return ()
    from workflows.wall_doubts import doubts

    return doubts(scene.wall)


def thick(scene: Scene, run: dem.Trajectory) -> tuple[str, ...]:
    """A sentence where a plate is not thin against the bending waves of the contact."""
    wall = scene.wall
    if not isinstance(wall, DashpotWall) or wall.plate_thickness is None:
        return ()
    plate = coupling.Plate(wall.young, wall.poisson, wall.density, wall.plate_thickness)
    seconds = contact_time(run.t, run.contact_force[:, -1]).seconds
    slender = coupling.slenderness(plate, seconds) if 0 < seconds < np.inf else 0.0
    if slender < THIN:
        return ()
    return (
        f"The plate is thick against its bending waves (k h = {slender:.2f}, thin is below "
        f"{THIN:g}); a solid one takes over a tenth more energy, see beadwave study "
        "wall-thickness.",
    )


def chaotic(scene: Scene) -> tuple[str, ...]:
    """A sentence where a run goes on beyond the time up to which its velocities are held."""
    time = scene.time
    if time.dt is not None or time.duration <= time.horizon:
        return ()
    return (
        f"The velocities are held to the error until {1e3 * time.horizon:g} ms; beyond, only the "
        "energy is, since spheres move chaotically after tens of impacts. time.horizon moves it.",
    )


def between_samples(scene: Scene) -> tuple[str, ...]:
    """A sentence where the samples to save lie closer than the step that was given."""
    spacing = scene.time.duration / (scene.output.samples - 1)
    if scene.time.dt is None or scene.time.dt <= spacing * (1 + 1e-9):
        return ()
    return (
        f"time.dt = {scene.time.dt:g} s is longer than the spacing of the saved samples, which is "
        f"the step that was taken, {spacing:g} s; lower output.samples to march with time.dt.",
    )


def rough(error: float | None) -> tuple[str, ...]:
    """A sentence where a given step left too much."""
    if error is None or error <= ROUGH:
        return ()
    return (
        f"The step leaves an error of {error:.2g} in the velocities; take a smaller time.dt, or "
        "ask for time.error.",
    )


def yielded(scene: Scene, run: dem.Trajectory) -> tuple[str, ...]:
    """A sentence on the contacts that a run has pressed beyond their yield."""
    row = chain(scene)
    if row.yield_overlap is None:
        return ()
    first = row.A * row.yield_overlap**1.5
    ratio = run.contact_force.max(axis=0) / first
    worst, n = int(ratio.argmax()), ratio.size
    if not ratio[worst] > 1.0:
        return ("No contact yields.",)
    where = "at the wall" if worst == len(row.mass) - 1 else f"of spheres {worst + 1}, {worst + 2}"
    return (
        f"{(ratio > 1.0).sum()} of {n} contacts yield; the one {where} most, pressed to "
        f"{ratio[worst]:.3g} times the {first[worst]:.3g} N at which it starts to.",
    )


def contact_radius(scene: Scene, force: float) -> float:
    """Radius of the contact at the wall [m]."""
    if scene.contact.law == "thornton":
        last = chain(scene)
        return float(
            spheres.yielded_radius(force, last.radius[-1], last.A[-1], last.yield_overlap[-1])
        )
    row, touched = scene.chain, surface(scene)
    R, E, nu = (np.atleast_1d(value)[-1] for value in (row.radius, row.young, row.poisson))
    E_star = spheres.contact_modulus(E, nu, touched.young, touched.poisson)
    return float(spheres.contact_radius(force, R, E_star))


def save_trajectory(path: Path, trajectory: dem.Trajectory) -> None:
    """Write every array of a trajectory over its saved times."""
    k = len(trajectory.t)
    arrays = {name: value for name, value in trajectory._asdict().items() if _over_time(value, k)}
    np.savez_compressed(path, **arrays)


def _over_time(value: Any, k: int) -> bool:
    return isinstance(value, np.ndarray) and len(value) == k
