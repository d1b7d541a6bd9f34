"""The chain of a scene, and the velocities that it starts with. Its wall is in `walls`."""

from typing import Any, NamedTuple

import numpy as np

from beadwave import coupling, dem
from beadwave.dem import spheres
from beadwave.dem.kernels.laws import ELASTIC_LAWS, SHAPE_PARAMETERS
from beadwave.workflows.files.force_file import force_table
from beadwave.workflows.scene import ContactTable, InvalidScene, RigidWall, RomWall, Scene
from beadwave.workflows.scene.tables.gravity import friction
from beadwave.workflows.stages.chain.walls import simple_wall

STEEL = dem.Flat(210e9, 0.3)  # Pa; material of a wall whose file and scene state none


class Start(NamedTuple):
    """The chain before the impact."""

    chain: dem.Chain
    velocity: np.ndarray  # (n,) [m/s]
    ellipse: coupling.EllipticalContact = coupling.PLANE  # of the last sphere on the wall
    flat: dem.Flat | None = None  # material of the wall at the contact


def start(scene: Scene, surface: Any = None) -> Start:
    """The chain and its velocities before the impact; `surface` (rom.Contact) is the face struck of
    a reduced wall, None for other walls."""
    scene = on_surface(scene, surface)
    return Start(chain(scene), initial_velocity(scene), ellipse(scene), flat(scene))


def on_surface(scene: Scene, surface: Any) -> Scene:
    """The scene whose wall has the curvatures, the modulus and Poisson's ratio of the face struck
    (rom.Contact or None), as far as these are known."""
    values = {key: getattr(surface, key, None) for key in ("young", "poisson", "curvatures")}
    update = {key: value for key, value in values.items() if value is not None}
    if not update:
        return scene
    return scene.model_copy(update={"wall": scene.wall.model_copy(update=update)})


def ellipse(scene: Scene) -> coupling.EllipticalContact:
    """The contact of the last sphere with the wall. Raises InvalidScene for a hollow whose radius
    is not larger than the sphere's, and for a yielding contact on a curved face."""
    curvatures = getattr(scene.wall, "curvatures", None)
    if not curvatures or not any(curvatures):
        return coupling.PLANE
    if scene.contact.yield_pressure is not None:
        raise InvalidScene(
            f"{scene.name}: contact.yield_pressure is of circular contacts, the face struck is "
            "curved; drop it, or strike a plane face."
        )
    try:
        return coupling.elliptical_contact(np.atleast_1d(scene.chain.radius)[-1], curvatures)
    except ValueError as error:
        raise InvalidScene(f"{scene.name}: {error}") from None


TOGETHER = {
    "chain": ("radius", "density", "young", "poisson"),
    "striker": ("velocity",),
    "contact": ("stiffness_factor", "coefficient", "stiffness", *SHAPE_PARAMETERS),
    "leaf_springs": ("stiffness", "offset"),
    "preload": ("force", "mass"),
    "wall": ("frequency", "mass", "damping_ratio", "coefficient", "young", "poisson"),
}


def together(scene: Scene, columns: dict[str, np.ndarray], wall: Any) -> dem.Chains:
    """Chains that are marched together. `columns` has the keys in which they differ, of those in
    TOGETHER, with a value (n_chains,) for each chain.

    Every chain has the wall of its own keys, or all have the one that is given. Raises
    dem.InvalidChain.
    """
    for key, values in columns.items():
        table, name = key.split(".")
        varied = {name: np.asarray(values, float)[:, None]}
        scene = scene.model_copy(update={table: getattr(scene, table).model_copy(update=varied)})
    row, v0 = chain(scene), initial_velocity(scene)
    # a varied key may have no effect, as the coefficient of a contact without dissipation: then
    # the velocities, and not the arrays of the chain, say how many chains there are
    n_chains = max(map(len, columns.values()), default=1)
    v0 = np.array(np.broadcast_to(v0, (n_chains, scene.chain.count)))
    wall = simple_wall(scene) if wall is None else wall
    if wall is not None:
        wall = wall._replace(mobility=_flat(wall.mobility))
    return dem.Chains(row._replace(preload=_flat(row.preload)), wall, v0)


def _flat(value: Any) -> Any:
    """(n_chains,) of a value (n_chains, 1); one value as it is."""
    return np.ravel(value) if np.ndim(value) else value


def chain(scene: Scene) -> dem.Chain:
    """Spheres, contacts, leaf springs, preload, weight and friction of the scene, as arrays.

    Raises InvalidScene for a file of forces that is no table, and for what `flat` and `ellipse`
    refuse.
    """
    c, contact, leaf = scene.chain, scene.contact, scene.leaf_springs
    along = scene.gravity.along if scene.gravity else 0.0
    row = dem.row_of_spheres(
        c.radius,
        c.density,
        c.young,
        c.poisson,
        count=c.count,
        flat=flat(scene),
        stiffness_factor=np.asarray(contact.stiffness_factor),
        **dissipation(contact),
        leaf_stiffness=np.asarray(leaf.stiffness) if leaf else None,
        leaf_anchor=np.asarray(leaf.offset) if leaf else None,
        preload=scene.preload.force if scene.preload else 0.0,
        gravity=along,
        n_falling=n_falling(scene) if along else 0,
    )

    # Hertz' law of a curved face, or another law in the place of Hertz'
    match contact.law:
        case "table":
            factor = np.asarray(contact.stiffness_factor, float)
            A = np.broadcast_to(factor, np.broadcast_shapes(factor.shape, row.A.shape)).copy()
            row = row._replace(A=A, table=force_table(contact.file))
        case law if law in ELASTIC_LAWS:
            names = [parameter.name for parameter in ELASTIC_LAWS[law].parameters]
            keys = ("stiffness", "stiffness_factor", *names)
            of_contacts = (np.asarray(getattr(contact, key), float) for key in keys)
            _, stiffness, factor, *parameters = np.broadcast_arrays(row.A, *of_contacts)
            parameters = (values.copy() for values in parameters)
            row = row._replace(A=stiffness * factor, **dict(zip(names, parameters, strict=True)))
        case _:
            row.A[-1] *= ellipse(scene).stiffness

    # the preload's arm moves with the last sphere
    if scene.preload:
        last = np.arange(c.count) == c.count - 1
        row = row._replace(mass=row.mass + np.multiply(scene.preload.mass, last))
    if scene.guides:
        row = row._replace(friction=friction(scene.guides, scene.gravity, row.mass))

    # Hertz' law up to the overlap at which the mean pressure reaches the yield pressure
    if contact.yield_pressure is None:
        return row
    overlap = spheres.yield_overlaps(row.radius, row.A, contact.yield_pressure)
    return row._replace(yield_overlap=overlap)


def dissipation(contact: ContactTable) -> dict[str, Any]:
    """Law and coefficients of contact damping, as `dem.row_of_spheres` takes them; none for a
    coefficient of 0, since kernels without damping are faster."""
    gamma = np.asarray(contact.coefficient)
    if contact.dissipation == "none" or not np.any(gamma):
        return {}
    return {"dissipation": contact.dissipation, "gamma": gamma}


def n_falling(scene: Scene) -> int:
    """Number of spheres in flight: those from the striker on that move at the start and hang on no
    leaf spring."""
    moving = np.atleast_2d(initial_velocity(scene))[0] != 0.0
    if scene.leaf_springs:
        moving &= np.broadcast_to(np.asarray(scene.leaf_springs.stiffness) == 0.0, moving.shape)
    return int(np.append(moving, False).argmin())


def initial_velocity(scene: Scene) -> np.ndarray:
    """Velocity of each sphere at the start, (n,) [m/s]."""
    if scene.chain.initial_velocity is not None:
        return np.array(scene.chain.initial_velocity)
    if scene.striker is None:  # a wall that shakers move, and nothing strikes
        return np.zeros(scene.chain.count)
    velocity = np.asarray(scene.striker.velocity, float)
    start = np.zeros((*velocity.shape[:-1], scene.chain.count))
    start[..., :1] = velocity
    return start


def flat(scene: Scene) -> dem.Flat | None:
    """Modulus [Pa] and Poisson's ratio of the wall at the contact, an infinite modulus for a rigid
    wall; None without a wall.

    Raises InvalidScene for an orthotropic material, unless `on_surface` has set its modulus.
    """
    wall = scene.wall
    if wall is None or isinstance(wall, RigidWall):
        return wall and dem.RIGID
    states_surface = None not in (wall.young, wall.poisson)
    if isinstance(wall, RomWall) and wall.file is None and not states_surface:
        wall = scene.struck_material
    if isinstance(wall.young, tuple):
        raise InvalidScene(
            f"{scene.name}: strike.on = {scene.strike.on!r} is of an orthotropic material, which "
            "this command does not take; strike an isotropic body."
        )
    return dem.Flat(
        STEEL.young if wall.young is None else wall.young,
        STEEL.poisson if wall.poisson is None else wall.poisson,
    )


def contact_radius(scene: Scene, start: Start, force: float) -> float:
    """Radius [m] of the contact with a plane wall under a force [N], yielded or by its law."""
    row, table = start.chain, scene.chain
    if row.yield_overlap is not None:
        return float(
            spheres.yielded_radius(force, row.radius[-1], row.A[-1], row.yield_overlap[-1])
        )
    law = row.elastic.at(-1)
    if law.shape is not None:  # a^2 = R delta, as in Hertz' law
        return float(np.sqrt(row.radius[-1] * law.overlap(force)))
    E, nu = (np.atleast_1d(value)[-1] for value in (table.young, table.poisson))
    E_star = spheres.contact_modulus(E, nu, *start.flat)
    return float(spheres.contact_radius(force, row.radius[-1], E_star))
