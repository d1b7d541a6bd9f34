"""A chain against plates: the infinite one of Zener, and plates of finite elements.

The finite plate is solid, loaded and read over one patch, its half-space taken out, reduced to its
modes and a residual; it is so large that bending waves come back from its edges after the contact.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

import coupling
import dem
import fem
import geometry
import rom
from coupling.plate import Plate, shear_speed, wavenumber
from coupling.wall import wall_from_reduced
from dem import solitary
from dem.wave_measures import CONTACT, ContactTime, contact_time, force_ratio
from dem.waves import crest, peaks
from workflows.chain_stages import initial_velocity
from workflows.scene import InvalidScene, Scene

STRUCK = "plate:+x"
FEWEST = 5  # spheres that make a wave
ERROR = 1e-5  # of the velocities
N_SAVE = 6000
BACK, AT_WALL = 4.0, 10.0  # natural times of a sphere: there and slowly back, and at the wall
FAINT = 0.02  # of the incident wave: below it there is no reflected one
FAINTEST_ARR = FAINT**1.2
CARRIED = 3.0  # half periods in a contact of the waves that must not come back from an edge
RESOLVED = 6.0  # half periods in a contact of the finest waves: modes that move, elements
ELEMENTS = 4  # quadratic ones in a wavelength of those
MARGIN = 1.25  # of the plate's size
NEAR = 12  # elements at the contact in which its half-space is solved; leaves 5e-6 of it
COARSEST_PATCH, COARSEST_SEED = 2e-3, 6e-3  # m


class Blow(NamedTuple):
    """A chain's collision with a wall."""

    arr: float  # (2.9) at the sphere watched, 0 where no wave comes back
    lost: float  # share of the striker's energy that the spheres have not when the contact ends
    contact: ContactTime  # the first
    peak_force: float  # [N] of it
    trajectory: dem.Trajectory


class Sizes(NamedTuple):
    """Of a plate's mesh [m], and the highest frequency [Hz] whose modes move one by one."""

    reach: float  # from the contact to the edges
    seed: float
    contact_seed: float
    patch: float
    cutoff_hz: float


def verdict(holds: bool) -> str:
    """On a statement of the thesis."""
    return "Holds" if holds else "Does not hold"


def require_chain(scene: Scene) -> None:
    """Raise InvalidScene unless the scene has a chain long enough for a wave."""
    if scene.chain is None:
        raise InvalidScene(f"the scene {scene.name} has no [chain]; add one, or take rig-rom.")
    if scene.chain.count < FEWEST:
        raise InvalidScene(
            f"chain.count = {scene.chain.count} makes no wave; take {FEWEST} spheres or more."
        )


def watched(scene: Scene) -> int:
    """The sphere, counted from 1, at which waves are measured: fourth from the wall, as 14 of the
    thesis' 17. Farther away slow waves merge with those behind them."""
    return scene.chain.count - 3


def steel(scene: Scene, thickness: float) -> Plate:
    """A plate of the last sphere's material."""
    of_last = (np.atleast_1d(getattr(scene.chain, k))[-1] for k in ("young", "poisson", "density"))
    return Plate(*map(float, of_last), thickness)


def diameter(scene: Scene) -> float:
    """Of the last sphere [m]."""
    return 2 * float(np.atleast_1d(scene.chain.radius)[-1])


def spheres(scene: Scene) -> dem.Chain:
    """The scene's spheres before a flat of their own material, elastic, nothing else holding."""
    row, flat = scene.chain, steel(scene, 1.0)
    return dem.row_of_spheres(
        row.radius, row.density, row.young, row.poisson, count=row.count,
        wall_young=flat.young, wall_poisson=flat.poisson,
    )  # fmt: skip


def blow(scene: Scene, wall: dem.Wall) -> Blow:
    """The chain against a wall, until even a slow wave is back at the striker."""
    row, v0 = spheres(scene), initial_velocity(scene)
    passing = dem.spheres.time_scale(row.mass.max(), row.A.min(), np.abs(v0).max())
    duration = (BACK * len(row.mass) + AT_WALL) * passing
    run = coupling.impact(row, wall, v0, duration=duration, error=ERROR, n_save=N_SAVE).trajectory
    contact, again = first_contact(run.t, run.contact_force[:, -1])
    left = np.interp(contact.end, run.t, run.energy_kinetic + run.energy_contact)
    lost = float(1 - left / run.energy_kinetic[0])
    peak = run.contact_force[run.t <= contact.end, -1].max()
    latest = again + contact.seconds
    return Blow(_ratio(scene, run, latest), lost, contact, float(peak), run)


def first_contact(t: np.ndarray, force: np.ndarray) -> tuple[ContactTime, float]:
    """The first collision in a record of the force (k,), and when [s] the next one starts.

    An echo from a plate's edge may make the next one the harder.
    """
    closed = force > CONTACT * force.max()
    turns = np.flatnonzero(np.diff(closed, prepend=False))
    second = turns[2] if len(turns) > 2 else len(t)
    again = t[second] if len(turns) > 2 else np.inf
    return contact_time(t[:second], force[:second]), float(again)


def _ratio(scene: Scene, run: dem.Trajectory, latest: float) -> float:
    """ARR of the first wave that comes back, 0 if its crest left the wall after `latest` [s]."""
    sphere = watched(scene)
    v = run.v[:, sphere - 1]
    there = peaks(v, 0.5 * v.max())[0]
    back = [k for k in peaks(-v, FAINT * v[there]) if k > there and v[k] < 0]
    if not back:
        return 0.0
    row, (time, speed) = spheres(scene), crest(run.t, -v, back[0])
    passing = 1 / solitary.speed(speed, row.mass[-1], row.A[-2])
    if time - (scene.chain.count - sphere) * passing > latest:
        return 0.0
    return float(force_ratio(crest(run.t, v, there)[1], speed))


def rebound(scene: Scene, wall: dem.Wall) -> float:
    """Restitution of the last sphere alone, thrown at a wall with the striker's speed."""
    whole = spheres(scene)
    last = dem.Chain(whole.mass[-1:], whole.radius[-1:], whole.A[-1:])
    speed = np.abs(initial_velocity(scene)).max()
    natural = dem.spheres.time_scale(last.mass[0], last.A[0], speed)
    run = coupling.impact(
        last, wall, [speed], duration=10 * natural, error=ERROR, n_save=N_SAVE
    ).trajectory
    end = contact_time(run.t, run.contact_force[:, -1], threshold=0.0).end
    return -float(np.interp(end, run.t, run.v[:, 0])) / speed


def sizes(plate: Plate, rise: float, until: float) -> Sizes:
    """A mesh for the waves of a push that takes `rise` [s] on a half-space, so large that echoes
    come back after `until` [s].
    """
    carried = coupling.group_speed(plate, CARRIED * np.pi / rise)
    omega = RESOLVED * np.pi / rise
    bending = 2 * np.pi / wavenumber(plate, omega)
    shear = 2 * np.pi * shear_speed(plate) / omega
    return Sizes(
        reach=MARGIN * carried * until / 2,
        seed=min(bending, shear) / ELEMENTS,
        contact_seed=min(COARSEST_SEED, plate.thickness / 3),
        patch=min(COARSEST_PATCH, plate.thickness / 4),
        cutoff_hz=RESOLVED / (2 * rise),
    )


def refined(size: Sizes) -> Sizes:
    """Elements of half the size, everything else the same."""
    return size._replace(seed=size.seed / 2, contact_seed=size.contact_seed / 2)


def with_more_modes(size: Sizes) -> Sizes:
    """Modes up to twice the frequency: in a plate twice as many."""
    return size._replace(cutoff_hz=2 * size.cutoff_hz)


def widened(size: Sizes) -> Sizes:
    """Edges half as far away again."""
    return size._replace(reach=1.5 * size.reach)


def with_half_the_patch(size: Sizes) -> Sizes:
    """A patch of half the radius."""
    return size._replace(patch=size.patch / 2)


def middle_wall(plate: Plate, size: Sizes) -> dem.Wall:
    """The plate struck in its middle, held at its edges; a quarter is meshed."""
    reach = (0.0, size.reach)
    mesh = geometry.plate_mesh(
        plate.thickness, geometry.Extent(reach, reach),
        seed=size.seed, contact_seed=size.contact_seed,
    )  # fmt: skip
    mirrors = ("plate:-y", "plate:-z")
    model = fem.mirrored(_structure(mesh, plate), ("plate:+y", "plate:+z"), mirrors)
    corner = (-size.reach / 2, -size.reach / 2)
    patch = fem.contact_patch(model, STRUCK, corner, size.patch, mirrors="yz")
    reduced = rom.free_modes(
        model.K, model.M, patch.w, cutoff_hz=size.cutoff_hz, factorise=fem.factorised
    )
    return _wall(model, plate, patch, mirrors, reduced)


def edge_walls(plate: Plate, size: Sizes, distances: Sequence[float]) -> Iterator[dem.Wall]:
    """The plate struck at distances [m] from a clamped edge, the others held out of reach.

    A half is meshed, fine along the line of contacts, so that its modes are found once.
    """
    far = max(distances) + size.reach
    mesh = geometry.plate_mesh(
        plate.thickness, geometry.Extent((0.0, far), (0.0, size.reach)),
        seed=size.seed, contact_seed=size.contact_seed, struck_y=(0.0, max(distances)),
    )  # fmt: skip
    mirrors = ("plate:-z",)
    held = ("plate:-y", "plate:+y", "plate:+z")
    model = fem.mirrored(_structure(mesh, plate), held, mirrors)
    factor, modes = fem.factorised(model.K), None
    for distance in distances:
        at = (distance - far / 2, -size.reach / 2)
        patch = fem.contact_patch(model, STRUCK, at, size.patch, mirrors="z")
        cutoff = {"cutoff_hz": size.cutoff_hz} if modes is None else {"modes": modes}
        reduced = rom.free_modes(model.K, model.M, patch.w, factorise=lambda A: factor, **cutoff)
        modes = modes or _modes(reduced)
        near = NEAR * size.contact_seed
        yield _wall(model, plate, patch, mirrors, reduced, within=near)


def _structure(mesh, plate: Plate) -> fem.Structure:
    return fem.assemble(mesh, {"plate": fem.Material(plate.young, plate.poisson, plate.density)})


def _modes(reduced: rom.ReducedModel) -> tuple[np.ndarray, np.ndarray]:
    kept = slice(0, len(reduced.w) - reduced.n_residual)
    return np.sqrt(np.diag(reduced.K)[kept]), reduced.T[:, kept]


def _wall(model, plate: Plate, patch, mirrors, reduced, *, within=np.inf) -> dem.Wall:
    material = fem.Material(plate.young, plate.poisson, plate.density)
    local = fem.half_space_on_mesh(model, STRUCK, patch, material, mirrors=mirrors, within=within)
    return wall_from_reduced(reduced, half_space=local)
