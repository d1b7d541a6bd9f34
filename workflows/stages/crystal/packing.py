"""The packing of a scene's crystal, and the velocities that it starts with."""

from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem import space
from beadwave.dem.spheres import (
    hertz_coefficient,
    hertz_overlap,
    modulus_of_contact,
    yield_overlap,
)
from beadwave.workflows.files.drive_file import drive_motion
from beadwave.workflows.files.network_file import network
from beadwave.workflows.scene import InvalidScene, OneDofWall, Scene
from beadwave.workflows.stages.chain.chain import dissipation, flat
from beadwave.workflows.stages.chain.walls import simple_wall

LINK_GAP = 1e-3  # of the smaller radius: centres of a link may be so far apart, or overlap so much


class CrystalStart(NamedTuple):
    """The crystal before it is struck."""

    packing: space.Packing
    velocity: np.ndarray  # (s, 3) [m/s]
    number: np.ndarray  # (s,) of each sphere: from 1 in a lattice, its file's in a network
    axis: int  # of the rows
    last: np.ndarray  # spheres of the last row
    young: np.ndarray  # (s,) [Pa]
    density: np.ndarray  # (s,) [kg/m^3]
    spacing: float  # [m] of touching centres

    @property
    def moving(self) -> np.ndarray:
        """(s,) whether a sphere is struck or driven."""
        moving = np.any(self.velocity, axis=1)
        if self.packing.driven is not None:
            moving[self.packing.driven.spheres] = True
        return moving


def start(scene: Scene) -> CrystalStart:
    """The crystal and its velocities. Raises InvalidScene for a lattice or a network that cannot
    be, and for a place without a sphere that is struck."""
    try:
        return _of_network(scene) if scene.crystal.nodes else _of_lattice(scene)
    except (dem.InvalidChain, dem.NoEquilibrium) as error:
        raise InvalidScene(f"{scene.name}: crystal: {str(error).rstrip('.')}.") from None


def wall(scene: Scene) -> dem.Wall | None:
    """The wall behind the last row that moves; None where there is none."""
    return simple_wall(scene) if isinstance(scene.wall, OneDofWall) else None


def _of_lattice(scene: Scene) -> CrystalStart:
    """Spheres on a lattice, in a Y included."""
    crystal = scene.crystal
    periodic = crystal.sides == "periodic"
    if crystal.lattice == "y":
        lattice = space.y_chain(*crystal.size, crystal.half_angle)
    else:
        lattice = space.lattice(crystal.lattice, crystal.size, periodic=periodic)

    # spheres one by one: inclusions, scatter
    sites = {tuple(place): row for row, place in enumerate(lattice.place.tolist())}
    n = len(sites)
    radius, density, young, poisson = (
        np.full(n, getattr(crystal, key)) for key in ("radius", "density", "young", "poisson")
    )
    if crystal.scatter:
        radius *= 1.0 + crystal.scatter * np.random.default_rng(crystal.seed).standard_normal(n)
    for inclusion in crystal.inclusions:
        row = sites[tuple(inclusion.at)]
        for key, values in {
            "radius": radius, "density": density, "young": young, "poisson": poisson
        }.items():  # fmt: skip
            if getattr(inclusion, key) is not None:
                values[row] = getattr(inclusion, key)
    there = np.ones(n, bool)
    there[[sites[tuple(place)] for place in crystal.missing]] = False
    if not there.any():
        raise InvalidScene(f"{scene.name}: crystal.missing leaves no sphere; list fewer places.")

    # neighbours of the lattice, so far apart that none of them press
    pairs, arm = space.touching(lattice.centre, lattice.period, 1.0 + space.CLOSE)
    keep = there[pairs].all(axis=1)
    pairs, arm = pairs[keep], arm[keep]
    regular = not crystal.scatter or not len(pairs)
    spacing = 2.0 * crystal.radius if regular else float(radius[pairs].sum(axis=1).max())
    wide = next(
        (i for i in crystal.inclusions if (i.radius or 0.0) > crystal.radius and regular), None
    )
    if wide is not None:
        raise InvalidScene(
            f"{scene.name}: crystal.inclusions has a radius of {wide.radius:g} m at "
            f"{list(wide.at)}, which presses its neighbours apart; give up to {crystal.radius:g} m."
        )
    place, centre = lattice.place[there], spacing * lattice.centre[there]
    R, rho, E, nu = radius[there], density[there], young[there], poisson[there]
    guides = None if lattice.guide is None else space.line_guides(lattice.guide[there])
    last = np.flatnonzero(place[:, -1] == place[:, -1].max())
    first = np.flatnonzero(place[:, -1] == place[:, -1].min())
    pairs, arm = (np.cumsum(there) - 1)[pairs], spacing * arm
    planes = _planes(scene, centre, R, lattice.axis, last)
    pressed = crystal.precompression or crystal.force
    if pressed:
        scale = _shortening(scene, spacing, lattice.axis)
        centre, arm = centre * scale, arm * scale
        if crystal.precompression:
            before = -np.eye(3)[lattice.axis]
            gap = R[first] - centre[first, lattice.axis]
            planes.append(space.Plane(first, before, gap - gap.max()))

    def packing_of(planes: list[space.Plane]) -> space.Packing:
        """The packing with these planes, its factor of stiffness and its damping."""
        packing = space.packing_of(
            centre, R, rho, E, nu, pairs=pairs, arm=arm, planes=planes, guides=guides
        )
        return _damped(scene, packing)

    packing = packing_of(planes)
    if pressed:
        packing = packing_of(_pressing(packing, planes))
    weight = np.zeros((len(R), 3))
    weight[:, lattice.axis] = packing.mass * (scene.gravity.along if scene.gravity else 0.0)
    if pressed or weight.any():
        load = weight.copy()
        if crystal.force:
            load[first, lattice.axis] += crystal.force / len(first)
        packing = space.at_rest(packing, load)
    if weight.any():
        packing = packing._replace(weight=weight)
    along = np.tile(np.eye(3)[lattice.axis], (len(R), 1))
    if lattice.guide is not None:
        along = lattice.guide[there]
    packing, velocity = _set_in_motion(scene, packing, place, along)
    number = np.flatnonzero(there) + 1
    return CrystalStart(packing, velocity, number, lattice.axis, last, E, rho, spacing)


def _planes(scene: Scene, centre, radius, axis: int, last) -> list[space.Plane]:
    """Planes that the last row and the sides lean on, just touching."""
    planes = []
    gap = (centre[last, axis] + radius[last]).max() - centre[last, axis] - radius[last]
    if scene.crystal.on is not None:
        # each sphere touches the structure at a point of its own
        body = scene.made_of(scene.struck_body)
        if isinstance(body.young, tuple):
            raise InvalidScene(
                f"{scene.name}: crystal.on = {scene.crystal.on!r} is of an orthotropic material, "
                "which is not taken here; lean the crystal on an isotropic body."
            )
        material, along = (body.young, body.poisson), np.eye(3)[axis]
        planes.append(space.Plane(last, along, -gap, *material, point=np.arange(len(last))))
    if scene.wall is not None:
        material, along = flat(scene), np.eye(3)[axis]
        point = 0 if isinstance(scene.wall, OneDofWall) else None
        planes.append(space.Plane(last, along, -gap, *material, point=point))
    if scene.crystal.sides == "rigid":
        for across in range(axis):
            for sign in (-1.0, 1.0):
                reach = sign * centre[:, across] + radius
                at = np.flatnonzero(reach > reach.max() - 0.1 * radius)
                normal = sign * np.eye(3)[across]
                planes.append(space.Plane(at, normal, reach[at] - reach.max()))
    return planes


def pressed_overlap(scene: Scene) -> float:
    """Overlap [m] at rest of the contacts of the scene's perfect lattice; 0 where nothing presses:
    that asked for, or of contacts that bear their share of the force on the first row."""
    crystal = scene.crystal
    if not crystal.force:
        return crystal.precompression or 0.0
    # contacts of a sphere with the next row, and how far they point along the axis
    axis = 1 if crystal.dimensions == 2 else 2
    near = space.neighbours(crystal.lattice)
    along = near[near[:, axis] > 1e-9, axis].sum()
    A = hertz_coefficient(*2 * (crystal.radius, crystal.young, crystal.poisson))
    share = crystal.force / np.prod(crystal.size[:-1])
    return float(hertz_overlap(share / along, A * scene.contact.stiffness_factor))


def _shortening(scene: Scene, spacing: float, axis: int) -> np.ndarray:
    """(3,) factors of the lattice pressed evenly to that overlap."""
    scale = np.full(3, 1.0 - pressed_overlap(scene) / spacing)
    if scene.crystal.sides == "free":  # columns that stand on their own
        scale[:axis] = 1.0
    return scale


def _pressing(packing: space.Packing, planes: list[space.Plane]) -> list[space.Plane]:
    """The planes so near that they bear what the pressed spheres at them lack, in the mean."""
    still = packing._replace(A=np.where(packing.pairs[:, 1] < 0, 0.0, packing.A))
    lacking, _ = space.resultants(still, np.zeros_like(packing.rest))
    moved, at = [], packing.n_pairs
    for plane in planes:
        A = packing.A[at : at + plane.spheres.size].mean()
        force = (lacking[plane.spheres] @ plane.normal).mean()
        nearer = hertz_overlap(max(force, 0.0), A)
        moved.append(plane._replace(overlap=plane.overlap + nearer))
        at += plane.spheres.size
    return moved


def _damped(scene: Scene, packing: space.Packing) -> space.Packing:
    """The packing with the scene's factor of stiffness, its damping and its friction."""
    contact, friction = scene.contact, scene.friction
    fields = dissipation(contact)
    if fields:
        fields["gamma"] = np.full(len(packing.A), contact.coefficient)
    if friction is not None:
        fields["friction"] = np.full(len(packing.A), friction.coefficient)
        if friction.between_spheres is not None:
            fields["friction"][: packing.n_pairs] = friction.between_spheres
    packing = packing._replace(A=packing.A * contact.stiffness_factor, **fields)
    if contact.yield_pressure is None:
        return packing
    R = packing.relative_radius
    overlap = yield_overlap(R, modulus_of_contact(packing.A, R), contact.yield_pressure)
    return packing._replace(yield_overlap=overlap)


def _moved(scene: Scene, name: str, place) -> np.ndarray:
    """The spheres of crystal.striker or crystal.drive, by the places (s, d) of all."""
    table = getattr(scene.crystal, name)
    if table.at is not None:
        found = np.flatnonzero((place == np.array(table.at)).all(axis=1))
        key, value = "at", list(table.at)
    else:
        key = "row" if table.row is not None else "plane"
        value = getattr(table, key)
        found = np.flatnonzero(place[:, -1] == value)
    if not found.size:
        raise InvalidScene(
            f"{scene.name}: crystal.{name}.{key} = {value} has no sphere; change it, or leave it "
            "out of crystal.missing."
        )
    return found


def _set_in_motion(
    scene: Scene, packing: space.Packing, place, along
) -> tuple[space.Packing, np.ndarray]:
    """The packing with its driven spheres, and the velocities (s, 3) [m/s] of the struck ones;
    `along` (s, 3) is the direction of each where the scene gives none."""
    crystal, guides = scene.crystal, packing.guides
    velocity = np.zeros((len(place), 3))
    for name in ("striker", "drive"):
        table = getattr(crystal, name)
        if table is None:
            continue
        spheres = _moved(scene, name, place)
        direction = np.asarray(table.direction or along[spheres[0]], float)
        if not direction.any():
            raise InvalidScene(
                f"{scene.name}: crystal.{name} needs a direction, as no guide says where the "
                "sphere moves; give [x, y, z]."
            )
        unit = direction / np.linalg.norm(direction)
        allowed = unit[None]
        if guides is not None:
            allowed = guides.motion[spheres] @ unit
        if np.linalg.norm(allowed, axis=1).min() < 1e-6:
            raise InvalidScene(
                f"{scene.name}: crystal.{name}.direction = {unit.tolist()} is across the guide of "
                "the sphere, which cannot move so; turn it."
            )
        if name == "striker":
            velocity[spheres] = table.velocity * allowed
        else:
            motion = drive_motion(table.file, table.quantity, scene.time.duration)
            driven = space.drive(spheres, allowed[0], *motion, table.quantity)
            packing = packing._replace(driven=driven)
    return packing, velocity


def _of_network(scene: Scene) -> CrystalStart:
    """Spheres and pairs of two files."""
    crystal = scene.crystal
    net = network(crystal.nodes, crystal.links)
    s = len(net.number)
    values = {key: np.full(s, getattr(crystal, key)) for key in ("density", "young", "poisson")}
    radius = net.radius.copy()
    row_of = {int(n): row for row, n in enumerate(net.number)}
    for inclusion in crystal.inclusions:
        row = row_of.get(inclusion.at[0])
        if row is None:
            raise InvalidScene(
                f"{scene.name}: crystal.inclusions.at = {list(inclusion.at)} is no sphere of "
                "crystal.nodes; take one of its numbers."
            )
        for key in values:
            if getattr(inclusion, key) is not None:
                values[key][row] = getattr(inclusion, key)
        radius[row] = inclusion.radius or radius[row]
    away = np.zeros(s, bool)
    for (n,) in crystal.missing:
        if n not in row_of:
            raise InvalidScene(
                f"{scene.name}: crystal.missing has {n}, which is no sphere of crystal.nodes; take "
                "one of its numbers."
            )
        away[row_of[n]] = True

    # a link joins spheres that touch, or nearly so
    i, j = net.pairs.T
    gap = np.linalg.norm(net.centre[j] - net.centre[i], axis=1) - radius[i] - radius[j]
    apart = np.abs(gap) > LINK_GAP * np.minimum(radius[i], radius[j])
    if len(gap) and apart[~away[net.pairs].any(axis=1)].any():
        worst = int(np.argmax(np.abs(gap) * ~away[net.pairs].any(axis=1)))
        a, b = net.number[net.pairs[worst]]
        raise InvalidScene(
            f"{scene.name}: crystal.links joins the spheres {a} and {b}, whose surfaces are "
            f"{gap[worst]:.3g} m apart (< 0: into each other); allowed are {LINK_GAP:g} of the "
            "smaller radius, move them."
        )
    there = ~away
    row = np.cumsum(there) - 1
    keep = there[net.pairs].all(axis=1)
    guides = space.line_guides(net.guide[there]) if np.any(net.guide) else None
    arm = (net.centre[net.pairs[:, 1]] - net.centre[net.pairs[:, 0]])[keep]
    # what files round of touching spheres is no overlap
    i, j = net.pairs[keep].T
    touch = np.abs(gap[keep]) < 1e-9 * (radius[i] + radius[j])
    arm *= np.where(touch, 1.0 - gap[keep] / np.linalg.norm(arm, axis=1), 1.0)[:, None]
    packing = space.packing_of(
        net.centre[there], radius[there], values["density"][there], values["young"][there],
        values["poisson"][there], pairs=row[net.pairs[keep]], arm=arm, guides=guides,
    )  # fmt: skip
    packing, velocity = _set_in_motion(
        scene, _damped(scene, packing), net.number[there, None], net.guide[there]
    )
    moving = velocity.any(axis=1)
    axis = int(np.abs(velocity[moving.argmax()]).argmax())
    E, rho = values["young"][there], values["density"][there]
    spacing = 2.0 * float(np.median(radius))
    return CrystalStart(
        _damped(scene, packing),
        velocity,
        net.number[there],
        axis,
        np.zeros(0, int),
        E,
        rho,
        spacing,
    )
