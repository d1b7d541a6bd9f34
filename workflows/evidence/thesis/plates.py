"""A chain against plates: the infinite one of Zener, and plates of finite elements.

The finite plate is solid, loaded and read over one patch, its half-space taken out, reduced to its
modes and a residual. It is so large that bending waves come back from its edges after the contact,
and its elements and modes resolve the shortest waves that the contact sends.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from beadwave import dem, fem, geometry, rom
from beadwave.coupling.plate import Plate, group_speed, shear_speed, wavenumber
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.workflows.evidence.thesis import collision as collisions
from beadwave.workflows.evidence.thesis.collision import Collision
from beadwave.workflows.evidence.thesis.requirements import bare, last
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain import initial_velocity

STRUCK = "plate:+x"


class PlateSizeRules(NamedTuple):
    """Rules for size and mesh of a plate; the effects named are those that the study wall-thickness
    prints for D/t = 4, where ARR is 0.316."""

    # waves of so many half periods in a contact must not come back from an edge; the plate is
    # `margin` times as wide as these need. A plate 1.5 times as wide changes the ARR by 1.5e-5
    carried: float = 3.0
    margin: float = 1.25
    # half periods in a contact of the finest waves, and quadratic elements in a wavelength of
    # them: modes up to twice the frequency change ARR by 3.6e-5, halved elements by 5.7e-4
    resolved: float = 6.0
    elements: int = 4
    # [m] radius of the patch, a quarter of a thinner plate: halved, ARR changes by 1.7e-4
    coarsest_patch: float = 2e-3
    coarsest_seed: float = 6e-3  # [m] elements at the contact, a third of a thinner plate


class PlateSizes(NamedTuple):
    """Of a plate's mesh [m], and the highest frequency [Hz] whose modes move one by one."""

    reach: float  # from the contact to the edges
    seed: float
    contact_seed: float
    patch: float
    cutoff_hz: float

    def scaled(self, **factors: float) -> "PlateSizes":
        """Sizes times factors by name, the others as they are."""
        return self._replace(
            **{name: factor * getattr(self, name) for name, factor in factors.items()}
        )


def sizes(
    plate: Plate, rise: float, until: float, rules: PlateSizeRules = PlateSizeRules()
) -> PlateSizes:
    """A mesh for the waves of a push that takes `rise` [s] on a half-space, so large that echoes
    come back after `until` [s].
    """
    carried = group_speed(plate, rules.carried * np.pi / rise)
    omega = rules.resolved * np.pi / rise
    bending = 2 * np.pi / wavenumber(plate, omega)
    shear = 2 * np.pi * shear_speed(plate) / omega
    return PlateSizes(
        reach=rules.margin * carried * until / 2,
        seed=min(bending, shear) / rules.elements,
        contact_seed=min(rules.coarsest_seed, plate.thickness / 3),
        patch=min(rules.coarsest_patch, plate.thickness / 4),
        cutoff_hz=rules.resolved / (2 * rise),
    )


def observed_sphere(scene: Scene) -> int:
    """The sphere, counted from 1, at which waves are measured: fourth from the wall, as 14 of the
    thesis' 17. Farther away slow waves merge with those behind them."""
    return scene.chain.count - 3


def steel(scene: Scene, thickness: float) -> Plate:
    """A plate of the last sphere's material."""
    of_last = (last(getattr(scene.chain, key)) for key in ("young", "poisson", "density"))
    return Plate(*of_last, thickness)


def diameter(scene: Scene) -> float:
    """Of the last sphere [m]."""
    return 2 * last(scene.chain.radius)


def collision(scene: Scene, wall: dem.Wall) -> Collision:
    """The first collision of the scene's spheres with a wall."""
    return collisions.collision(bare(scene), wall, initial_velocity(scene), observed_sphere(scene))


def rebound(scene: Scene, wall: dem.Wall) -> float:
    """Restitution of the last sphere alone, thrown at a wall with the striker's speed."""
    speed = np.abs(initial_velocity(scene)).max()
    return collisions.restitution(bare(scene), wall, speed)


def middle_wall(plate: Plate, size: PlateSizes) -> dem.Wall:
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
    moving = rom.Selection(cutoff_hz=size.cutoff_hz)
    reduced = rom.free_modes(model.K, model.M, patch.w, moving, factorise=fem.factorised)
    return _wall(model, plate, patch, mirrors, reduced)


def edge_walls(plate: Plate, size: PlateSizes, distances: Sequence[float]) -> Iterator[dem.Wall]:
    """The plate struck at distances [m] from a clamped edge, the others held out of reach.

    A half is meshed, fine along the line of contacts, so that its modes are found once.
    """
    far = max(distances) + size.reach
    mesh = geometry.plate_mesh(
        plate.thickness, geometry.Extent((0.0, far), (0.0, size.reach)),
        seed=size.seed, contact_seed=size.contact_seed, struck_y=(0.0, max(distances)),
    )  # fmt: skip
    mirrors = ("plate:-z",)
    edges = ("plate:-y", "plate:+y", "plate:+z")
    model = fem.mirrored(_structure(mesh, plate), edges, mirrors)
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
        yield _wall(model, plate, patch, mirrors, reduced, within=12 * size.contact_seed)


def _structure(mesh, plate: Plate) -> fem.Structure:
    """Stiffness and mass of a mesh of the plate."""
    meshes = geometry.by_body(mesh)
    return fem.assemble(meshes, {"plate": fem.Material(plate.young, plate.poisson, plate.density)})


def _wall(model, plate: Plate, patch, mirrors, reduced, *, within=np.inf) -> dem.Wall:
    """The reduced plate without the half-space under its patch, which Hertz' law holds already."""
    material = fem.Material(plate.young, plate.poisson, plate.density)
    local = fem.half_space_on_mesh(model, STRUCK, patch, material, mirrors=mirrors, within=within)
    return wall_from_reduced(reduced, half_space=local)
