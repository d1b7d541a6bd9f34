"""The chain of spheres.

Positions x are measured from the chain in which all neighbours just touch, velocities are positive
towards the wall. Contact i has the overlap delta = x_i - x_{i+1}; the last one, at the wall,
delta = x_N - u_w - s F with the modes' displacement u_w and the residual compliance s.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.checks import arrays, require, scalar, spread, vector, whole
from beadwave.dem.elastic import ElasticLaw
from beadwave.dem.kernels.arguments import Array, ForceTable
from beadwave.dem.kernels.laws import DAMPING_LAWS, ELASTIC_LAWS, SHAPE_PARAMETERS
from beadwave.dem.spheres import hertz_coefficient, mass
from beadwave.dem.walls import Wall, rigid_wall

PER_SPHERE = (
    "mass", "radius", "A", "gamma", "leaf_stiffness", "leaf_anchor", "yield_overlap", "friction",
    *SHAPE_PARAMETERS,
)  # fmt: skip


class Chain(NamedTuple):
    """Spheres 1..n from the striker to the wall; parts that are absent are None.

    Force of a closed contact with overlap delta, elastic force F_el = A delta^(3/2) (Hertz) or
    what `exponent` and `table` say, and rate of approach delta':

        none             F_el
        linear           F_el + gamma delta'            gamma [N s/m]; may pull at separation
        linear-clipped   the same, but never below 0
        hunt-crossley    F_el (1 + gamma delta')        gamma [s/m]; never below 0

    (Hunt and Crossley, J. Appl. Mech. 42 (1975) 440: the damping vanishes with the contact area,
    so that the force does not jump when the contact closes.) Where the wall has a residual
    compliance s, contact and spring are in series: delta' is 1 / (1 + s k) of the gap's rate, with
    the contact's stiffness k = dF_el/d delta, and the spring passes on the same share of the
    damping force, so that gamma acts as gamma / (1 + s k)^2 on the gap's rate. This is right to
    first order in the damping.

    Beyond its yield overlap a contact follows C. Thornton, J. Appl. Mech. 64 (1997) 383. Under
    gravity the first n_falling spheres are in flight at the start, just touching: the others do not
    carry them. Guides act by Coulomb friction, which is zero in the state of rest at the start.
    """

    mass: Array  # (n,) [kg]
    radius: Array  # (n,) [m]
    A: Array  # (n,) [N/m^1.5], the last one at the wall; (n - 1,) for a free chain
    dissipation: str = "none"
    gamma: Array | None = None  # one per contact
    leaf_stiffness: Array | None = None  # (n,) [N/m]
    leaf_anchor: Array | None = None  # (n,) [m] offset towards the wall; None: 0
    preload: float = 0.0  # [N] on the last sphere, towards the wall
    yield_overlap: Array | None = None  # [m] one per contact, where it turns plastic
    gravity: float = 0.0  # [m/s^2] along the chain, towards the wall
    n_falling: int = 0
    friction: Array | None = None  # (n,) [N] of the guides, against the motion of each sphere
    exponent: Array | None = None  # n of F_el = A delta^n, one per contact; A in N/m^n
    table: ForceTable | None = None  # F_el = A times the table's force (`dem.force_table`)

    @property
    def elastic(self) -> ElasticLaw:
        """The elastic law of the contacts, (n_contacts,) in all its arrays."""
        parameters = {name: getattr(self, name) for name in SHAPE_PARAMETERS}
        parameters = {name: values for name, values in parameters.items() if values is not None}
        return ElasticLaw(self.A, parameters, self.table)

    @property
    def jumps(self) -> bool:
        """True if the damping force jumps when a contact closes."""
        return not DAMPING_LAWS[self.dissipation].grows

    @property
    def steady(self) -> Array:
        """(n,) [N] steady force on each sphere: its weight, the preload."""
        force = self.gravity * np.asarray(self.mass, float)
        force[-1] += self.preload
        return force

    @property
    def slides(self) -> bool:
        """True if friction acts on any sphere."""
        return self.friction is not None and bool(np.any(self.friction))

    @property
    def springs(self) -> tuple[Array, Array]:
        """Stiffness and anchor of the leaf springs, (n,) each; zeros where there are none."""
        none = np.zeros(self.mass.size)
        springs = (self.leaf_stiffness, self.leaf_anchor)
        return tuple(none if values is None else np.asarray(values, float) for values in springs)


class State(NamedTuple):
    """Positions and velocities at an instant; those of modes, q and p, from the static state."""

    x: Array  # (n,) [m]
    v: Array  # (n,) [m/s]
    q: Array  # (n_modes,) [kg^1/2 m]
    p: Array  # (n_modes,) [kg^1/2 m/s]
    wall: Array  # (4,) u_w, v_w of the modes, displacement of the dashpot, work on the modes
    deepest: Array | None = None  # (n_contacts,) largest overlap so far, of plastic contacts

    def reversed(self) -> "State":
        """The positions with all velocities reversed."""
        wall = self.wall * [1.0, -1.0, 1.0, 1.0]
        return State(self.x, -self.v, self.q, -self.p, wall, self.deepest)


class Flat(NamedTuple):
    """Material of the flat that the last sphere touches."""

    young: float  # [Pa]
    poisson: float


RIGID = Flat(np.inf, 0.0)


def row_of_spheres(
    radius: ArrayLike,
    density: ArrayLike,
    young: ArrayLike,
    poisson: ArrayLike,
    *,
    count: int | None = None,
    flat: Flat | None = RIGID,
    stiffness_factor: ArrayLike = 1.0,
    **fields,
) -> Chain:
    """Chain of elastic spheres against a flat, or a free one (flat None).

    Radius [m], density [kg/m^3], young [Pa] and poisson are scalars or (n,), one per sphere;
    `count` is n where all are scalars. `stiffness_factor`, a scalar or (n_contacts,), multiplies
    Hertz' coefficients A, that at the wall last. `fields` are the further fields of `Chain`,
    scalars or one per sphere or contact. Values with a leading axis, (n_chains, 1) or
    (n_chains, n), make the chains of a batch, which `Chains` checks. Raises InvalidChain for
    numbers out of range, other counts, and a name that is no field.
    """
    properties = {"radius": radius, "density": density, "young": young, "poisson": poisson}
    if count is not None:
        whole("count", count)
    n = count or max(
        np.shape(values)[-1] if np.ndim(values) else 1 for values in properties.values()
    )
    R, rho, E, nu = (spread(name, values, n) for name, values in properties.items())
    for name, values in (("radius", R), ("density", rho), ("young", E)):
        vector(name, values.ravel(), values.size, positive=True)
    vector("poisson", nu.ravel(), nu.size, at_least=-1.0)
    R, rho, E, nu = np.broadcast_arrays(R, rho, E, nu)

    # contacts of neighbours, and of the last sphere with the flat; leading axes may differ
    first, second, last = (
        [values[..., spheres] for values in (R, E, nu)] for spheres in np.s_[:-1, 1:, -1:]
    )
    A = hertz_coefficient(*first, *second)
    if flat is not None:
        A_wall = hertz_coefficient(*last, np.inf, *flat)
        lead = np.broadcast_shapes(A.shape[:-1], A_wall.shape[:-1])
        A = np.concatenate(
            [np.broadcast_to(values, (*lead, values.shape[-1])) for values in (A, A_wall)], axis=-1
        )

    # further fields, one value for each sphere or each contact
    contacts = A.shape[-1]
    sizes = {
        "gamma": contacts, "leaf_stiffness": n, "leaf_anchor": n, "yield_overlap": contacts,
        "friction": n, **dict.fromkeys(SHAPE_PARAMETERS, contacts),
    }  # fmt: skip
    for name in sizes.keys() & fields.keys():
        if fields[name] is not None:
            fields[name] = spread(name, fields[name], sizes[name]).copy()
    factor = spread("stiffness_factor", stiffness_factor, contacts)
    further = ", ".join(name for name in Chain._fields if name not in ("mass", "radius", "A"))
    for name in fields:
        require(
            name in Chain._fields, f"{name!r} is no field of a dem.Chain; take one of {further}"
        )
    chain = Chain(mass(R, rho), R.copy(), A * factor, **fields)
    if all(np.ndim(values) < 2 for values in chain):  # `Chains` looks at those of a batch
        validate(chain, None if flat is None else rigid_wall(), np.zeros(n))
    return chain


def validate(chain: Chain, wall: Wall | None, v0: ArrayLike) -> None:
    """Raise InvalidChain with one sentence if anything of a chain, its wall and the velocities v0
    (n,) [m/s] is missing, not finite or out of range, or if parts do not go together."""
    require(isinstance(chain, Chain), f"the chain is a {type(chain).__name__}; give a dem.Chain")
    require(
        wall is None or isinstance(wall, Wall),
        f"the wall is a {type(wall).__name__}; give a dem.Wall, or None for a free chain",
    )
    arrays(chain, PER_SPHERE)
    n = np.size(chain.mass)
    n_contacts = n - 1 if wall is None else n
    require(n >= 1, "the chain has no sphere; give at least one mass")
    mass = vector("mass", chain.mass, n, positive=True)
    vector("radius", chain.radius, n, positive=True)
    vector("A", chain.A, n_contacts, positive=True)
    v0 = vector("initial velocity", v0, n)
    with np.errstate(over="ignore"):  # the sentence says so
        scalar("kinetic energy of the start", 0.5 * float(mass @ v0**2))
    require(
        chain.dissipation in DAMPING_LAWS,
        f"dissipation {chain.dissipation!r} is unknown; take one of {', '.join(DAMPING_LAWS)}",
    )
    if chain.dissipation != "none":
        vector("gamma", chain.gamma, n_contacts, at_least=0.0)

    # the shape of the elastic force
    law = chain.elastic
    for name in law.parameters:
        low, high = SHAPE_PARAMETERS[name].low, SHAPE_PARAMETERS[name].high
        largest = vector(name, getattr(chain, name), n_contacts, at_least=low).max(initial=low)
        require(largest <= high, f"{name} {largest:g} is above {high:g}; lower it")
    fields = [*law.parameters, *(["table"] if law.table is not None else [])]
    if fields:
        named = " and ".join(fields)
        require(
            law.name is not None,
            f"{named} belong to no law; leave some of them out: a law has "
            + ", or ".join(
                " and ".join(p.name for p in of.parameters) or "table"
                for of in ELASTIC_LAWS.values()
            ),
        )
        require(
            chain.yield_overlap is None,
            f"yield_overlap is of Hertz contacts; leave it out, or {named}",
        )
        require(
            wall is None or wall.mobility == 0.0,
            f"a dashpot wall takes Hertz contacts alone; take another wall, or leave out {named}",
        )

    # leaf springs and guides
    if chain.leaf_stiffness is not None:
        vector("leaf_stiffness", chain.leaf_stiffness, n, at_least=0.0)
    if chain.leaf_anchor is not None:
        vector("leaf_anchor", chain.leaf_anchor, n)
        require(chain.leaf_stiffness is not None, "leaf_anchor needs leaf_stiffness too")
    if chain.friction is not None:
        vector("friction", chain.friction, n, at_least=0.0)
        require(
            not (chain.slides and chain.springs[0].any()),
            "a sphere on a leaf spring touches no guides; leave out friction or leaf_stiffness",
        )

    # steady forces, spheres in flight, yield
    scalar("preload", chain.preload)
    scalar("gravity", chain.gravity)
    if chain.n_falling:
        whole("n_falling", chain.n_falling)
        require(chain.n_falling <= n, f"n_falling = {chain.n_falling}, the chain has {n} spheres")
        require(
            not chain.springs[0][: chain.n_falling].any(),
            "a sphere in flight hangs on no leaf spring; lower n_falling",
        )
    if chain.yield_overlap is not None:
        vector("yield_overlap", chain.yield_overlap, n_contacts, positive=True)

    if wall is None:
        return
    arrays(wall, ("omega", "zeta", "phi"))
    n_modes = np.size(wall.omega)
    vector("wall omega", wall.omega, n_modes, at_least=0.0)
    vector("wall zeta", wall.zeta, n_modes, at_least=0.0)
    vector("wall phi", wall.phi, n_modes)
    scalar("residual_compliance", wall.residual_compliance)
    scalar("mobility", wall.mobility, at_least=0.0)
    require(
        wall.mobility == 0.0 or chain.yield_overlap is None,
        "a dashpot wall takes no plastic contacts; leave out yield_overlap or the dashpot",
    )
    require(
        wall.mobility == 0.0 or chain.dissipation == "none" or chain.gamma[-1] == 0.0,
        f"a dashpot wall takes no damping at the last contact, found gamma = "
        f"{0.0 if chain.gamma is None else chain.gamma[-1]:g}; set it to 0",
    )
