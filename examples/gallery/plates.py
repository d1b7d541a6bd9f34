"""A chain against plates: the infinite one of Zener, and solid plates of finite elements.

Shared by `wall_thickness.py` and `boundary_distance.py`. The finite plate is loaded and read over
one patch, its half-space taken out, reduced to its modes and a residual. It is so large that
bending waves come back from its edges after the contact, and its elements and modes resolve the
shortest waves that the contact sends. The amplitude ratio of the reflected wave (ARR) is (2.9) of
the thesis, velocities to the power 6/5.
"""

from typing import NamedTuple

import numpy as np

from beadwave import coupling, dem, fem, geometry, rom
from beadwave.coupling.infinite_plate import Plate, group_speed, shear_speed, wavenumber
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.dem.spheres import time_scale
from beadwave.dem.waves import solitary
from beadwave.dem.waves.arrivals import crest, peaks
from beadwave.dem.waves.measures import CONTACT, ContactTime, contact_time, force_ratio
from beadwave.workflows.stages.chain.chain import initial_velocity
from observed import bare_chain, last

ERROR, N_SAVE = 1e-5, 6000  # of the velocities, relative to the striker's; instants of a record
PER_SPHERE = 4.0  # natural times: to the wall and slowly back past one sphere
AT_WALL = 10.0  # natural times that the contact with the wall may take
FAINT = 0.02  # of the incident wave's velocity: a fainter reflected wave counts as none

STRUCK = "plate:+x"
# waves of so many half periods in a contact must not come back from an edge; the plate is MARGIN
# times as wide as these need. A plate 1.5 times as wide changes an ARR of 0.316 (D/t = 4, as the
# effects below) by 1.5e-5
CARRIED, MARGIN = 3.0, 1.25
# half periods in a contact of the finest waves, and quadratic elements in a wavelength of them:
# modes up to twice the frequency change the ARR by 3.6e-5, halved elements by 5.7e-4
RESOLVED, ELEMENTS = 6.0, 4
COARSEST_PATCH = 2e-3  # [m] radius, a quarter of a thinner plate: halved, the ARR changes by 1.7e-4
COARSEST_SEED = 6e-3  # [m] elements at the contact, a third of a thinner plate


class Collision(NamedTuple):
    """The first collision of a chain with its wall."""

    arr: float  # (2.9) at the observed sphere, 0 where no wave comes back
    lost: float  # share of the striker's energy that the spheres have not when the contact ends
    contact: ContactTime
    peak_force: float  # [N]
    trajectory: dem.Trajectory


class PlateSizes(NamedTuple):
    """Of a plate's mesh [m], and the highest frequency [Hz] whose modes move one by one."""

    reach: float  # from the contact to the edges
    seed: float
    contact_seed: float
    patch: float
    cutoff_hz: float

    def scaled(self, **factors):
        """Sizes times factors by name, the others as they are."""
        return self._replace(**{name: x * getattr(self, name) for name, x in factors.items()})


def observed_sphere(rig):
    """The sphere at which waves are measured: fourth from the wall, as 14 of the thesis' 17.
    Farther away slow waves merge with those behind them."""
    return rig.chain.count - 3


def diameter(rig):
    """Of the last sphere [m]."""
    return 2 * last(rig.chain.radius)


def steel_plate(rig, thickness):
    """A plate of the last sphere's material."""
    of_last = (last(getattr(rig.chain, key)) for key in ("young", "poisson", "density"))
    return Plate(*of_last, thickness)


def collision(rig, wall):
    """The spheres' first collision with a wall, and what it sends back to the observed sphere."""
    row, v0, sphere = bare_chain(rig), initial_velocity(rig), observed_sphere(rig)
    passing = time_scale(row.mass.max(), row.A.min(), np.abs(v0).max())
    duration = (PER_SPHERE * len(row.mass) + AT_WALL) * passing
    run = coupling.impact(row, wall, v0, duration=duration, error=ERROR, n_save=N_SAVE).trajectory

    # what the spheres have not when the first contact ends is the wall's
    contact, second_start = first_contact(run.t, run.contact_force[:, -1])
    remaining = np.interp(contact.end, run.t, run.energy_kinetic + run.energy_contact)
    lost = float(1 - remaining / run.energy_kinetic[0])
    peak_force = float(run.contact_force[run.t <= contact.end, -1].max())

    # the incident wave at the sphere, and the first crest away from the wall behind it
    v, arr = run.v[:, sphere - 1], 0.0
    incident = peaks(v, 0.5 * v.max())[0]
    reflected = [k for k in peaks(-v, FAINT * v[incident]) if k > incident and v[k] < 0]

    # it belongs to this collision if it left the wall before the next one's wave could
    if reflected:
        time, speed = crest(run.t, -v, reflected[0])
        per_sphere = 1 / solitary.speed(speed, row.mass[-1], row.A[-2])
        if time - (len(row.mass) - sphere) * per_sphere <= second_start + contact.seconds:
            arr = float(force_ratio(crest(run.t, v, incident)[1], speed))
    return Collision(arr, lost, contact, peak_force, run)


def first_contact(t, force):
    """The first collision in a record of the force (k,), and when [s] the next one starts: an echo
    from a plate's edge may make the next one the harder."""
    closed = force > CONTACT * force.max()
    turns = np.flatnonzero(np.diff(closed, prepend=False))
    second = turns[2] if len(turns) > 2 else len(t)
    again = t[second] if len(turns) > 2 else np.inf
    return contact_time(t[:second], force[:second]), float(again)


def rebound(rig, wall):
    """Restitution of the last sphere alone, thrown at a wall with the striker's speed."""
    row, speed = bare_chain(rig), np.abs(initial_velocity(rig)).max()
    alone = dem.Chain(row.mass[-1:], row.radius[-1:], row.A[-1:])
    duration = AT_WALL * time_scale(alone.mass[0], alone.A[0], speed)
    run = coupling.impact(
        alone, wall, [speed], duration=duration, error=ERROR, n_save=N_SAVE
    ).trajectory
    end = contact_time(run.t, run.contact_force[:, -1], threshold=0.0).end
    return -float(np.interp(end, run.t, run.v[:, 0])) / speed


def sizes(plate, rise, until):
    """A mesh for the waves of a push that takes `rise` [s] on a half-space, so large that echoes
    come back after `until` [s]."""
    carried = group_speed(plate, CARRIED * np.pi / rise)
    omega = RESOLVED * np.pi / rise
    bending = 2 * np.pi / wavenumber(plate, omega)
    shear = 2 * np.pi * shear_speed(plate) / omega
    return PlateSizes(
        reach=MARGIN * carried * until / 2,
        seed=min(bending, shear) / ELEMENTS,
        contact_seed=min(COARSEST_SEED, plate.thickness / 3),
        patch=min(COARSEST_PATCH, plate.thickness / 4),
        cutoff_hz=RESOLVED / (2 * rise),
    )


def middle_wall(plate, size):
    """The plate struck in its middle, held at its edges; a quarter is meshed."""
    reach, mirrors = (0.0, size.reach), ("plate:-y", "plate:-z")
    mesh = geometry.plate_mesh(
        plate.thickness, geometry.Extent(reach, reach),
        seed=size.seed, contact_seed=size.contact_seed,
    )  # fmt: skip
    material = fem.Material(plate.young, plate.poisson, plate.density)
    structure = fem.assemble(geometry.by_body(mesh), {"plate": material})
    model = fem.mirrored(structure, ("plate:+y", "plate:+z"), mirrors)
    corner = (-size.reach / 2, -size.reach / 2)
    patch = fem.contact_patch(model, STRUCK, corner, size.patch, mirrors="yz")
    moving = rom.Selection(cutoff_hz=size.cutoff_hz)
    reduced = rom.free_modes(model.K, model.M, patch.w, moving, factorise=fem.factorised)

    # without the half-space under the patch, which Hertz' law holds already
    local = fem.half_space_on_mesh(model, STRUCK, patch, material, mirrors=mirrors, within=np.inf)
    return wall_from_reduced(reduced, half_space=local)


def edge_walls(plate, size, distances):
    """The plate struck at distances [m] from a clamped edge, the others held out of reach.

    A half is meshed, fine along the line of contacts, so that its modes are found once.
    """
    far, mirrors = max(distances) + size.reach, ("plate:-z",)
    mesh = geometry.plate_mesh(
        plate.thickness, geometry.Extent((0.0, far), (0.0, size.reach)),
        seed=size.seed, contact_seed=size.contact_seed, struck_y=(0.0, max(distances)),
    )  # fmt: skip
    material = fem.Material(plate.young, plate.poisson, plate.density)
    structure = fem.assemble(geometry.by_body(mesh), {"plate": material})
    model = fem.mirrored(structure, ("plate:-y", "plate:+y", "plate:+z"), mirrors)
    factor, modes = fem.factorised(model.K), None
    for distance in distances:
        at = (distance - far / 2, -size.reach / 2)
        patch = fem.contact_patch(model, STRUCK, at, size.patch, mirrors="z")
        moving = rom.Selection(cutoff_hz=size.cutoff_hz if modes is None else None, modes=modes)
        reduced = rom.free_modes(model.K, model.M, patch.w, moving, factorise=lambda A: factor)
        if modes is None:
            free = slice(0, len(reduced.w) - reduced.n_residual)
            modes = np.sqrt(np.diag(reduced.K)[free]), reduced.T[:, free]

        # the half-space under the patch is solved in 12 elements around it, which leaves 5e-6 of it
        within = 12 * size.contact_seed
        local = fem.half_space_on_mesh(
            model, STRUCK, patch, material, mirrors=mirrors, within=within
        )
        yield wall_from_reduced(reduced, half_space=local)
