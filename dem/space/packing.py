"""Packings: spheres in space, the contacts between them and with planes, and what holds them.

A contact keeps the arm between its bodies at rest, so that sides may be periodic, and its overlap
there, below 0 for a gap. A sphere that leans on a plane has the plane's normal in place of the arm.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.checks import InvalidChain, require, vector
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.laws import DAMPING_LAWS
from beadwave.dem.space.kernel import Arms, Drive, Guides, HoldingSprings, Numbers
from beadwave.dem.spheres import (
    hertz_coefficient,
    mass,
    mindlin_coefficient,
    relative_radius,
)

# in the place of a contact's second sphere: a plane, and point k of a structure as MOVING - k
AT_REST, MOVING = -1, -2
NO_YIELD = 1.0  # [m] of overlap to yield that no contact reaches


class Plane(NamedTuple):
    """Plane that spheres lean on, of their contacts at rest."""

    spheres: Numbers  # (p,) that lean on it
    normal: Array  # (3,) from the spheres to the plane
    overlap: Array  # (p,) [m] at rest
    young: float = np.inf  # [Pa]; inf is rigid
    poisson: float = 0.0
    # of the structure behind it: one for all spheres, or (p,); None: at rest
    point: ArrayLike | None = None


class RubbingContacts(NamedTuple):
    """m contacts whose tangential force is that of exact springs in two directions."""

    contact: Numbers  # (m,) which they are
    frame: Array  # (m, 2, 3) unit vectors across each
    law: tuple[Array, Array, Array]  # (m,) each: modulus, bound and radius of `TangentialLaw`
    # of the first division of the contact's area, see `coupling.spatial_march.SpatialSearch`
    n_cells: int = 256


class Packing(NamedTuple):
    """s spheres and c contacts, those of two spheres first; parts that are absent are None.

    The forces of contacts, dampers and yield follow `dem.Chain`. `load` is steady: the weights, and
    what holds a packing that is pressed at rest.
    """

    rest: Array  # (s, 3) [m] centres
    radius: Array  # (s,) [m]
    mass: Array  # (s,) [kg]
    pairs: Numbers  # (c, 2) the second is AT_REST for a plane, MOVING - k for point k
    n_pairs: int
    arm: Array  # (c, 3) [m] from centre to centre at rest; the normal of a plane
    overlap: Array  # (c,) [m] at rest
    A: Array  # (c,) [N/m^1.5]
    shear: Array  # (c,) [N/m^1.5] K of Mindlin's tangential stiffness K sqrt(overlap)
    friction: Array | None = None  # (c,) coefficients; with it spheres spin
    springs: RubbingContacts | None = None  # in place of it; with these spheres spin
    dissipation: str = "none"
    gamma: Array | None = None  # (c,)
    yield_overlap: Array | None = None  # (c,) [m]
    guides: Guides | None = None
    load: Array | None = None  # (s, 3) [N]
    weight: Array | None = None  # (s, 3) [N], part of the load
    held: HoldingSprings | None = None  # springs of the spheres from their places at rest
    arms: Arms | None = None  # springs against their turns
    added_inertia: Array | None = None  # (s,) [kg m^2] of what turns with them
    driven: Drive | None = None  # spheres whose motion is given

    @property
    def inertia(self) -> Array:
        """(s,) [kg m^2] of solid spheres and what turns with them."""
        solid = 0.4 * self.mass * self.radius**2
        return solid if self.added_inertia is None else solid + self.added_inertia

    @property
    def relative_radius(self) -> Array:
        """(c,) [m] R* of the contacts."""
        i, j = self.pairs.T
        other = np.where(j < 0, np.inf, self.radius[np.maximum(j, 0)])
        return relative_radius(self.radius[i], other)

    @property
    def length(self) -> Array:
        """(c,) [m] from centre to centre at rest; to a plane the radius."""
        length = np.linalg.norm(self.arm, axis=1)
        length[self.n_pairs :] = self.radius[self.pairs[self.n_pairs :, 0]]
        return length

    @property
    def fastest_drive(self) -> float:
        """Largest speed [m/s] of driven spheres at the knots of their motion."""
        if self.driven is None:
            return 0.0
        # the power before the last is the rate at a knot
        return float(np.abs(self.driven.coefficients[-2]).max())

    @property
    def rubs(self) -> bool:
        """True if any contact has friction."""
        return self.friction is not None and bool(np.any(self.friction))

    @property
    def spins(self) -> bool:
        """True if anything turns spheres."""
        return self.rubs or self.springs is not None

    @property
    def jumps(self) -> bool:
        """True if the damping force jumps when a contact closes."""
        return not DAMPING_LAWS[self.dissipation].grows


def packing_of(
    rest: ArrayLike,
    radius: ArrayLike,
    density: ArrayLike,
    young: ArrayLike,
    poisson: ArrayLike,
    *,
    pairs: ArrayLike,
    arm: ArrayLike | None = None,
    planes: Sequence[Plane] = (),
    **fields,
) -> Packing:
    """Packing of elastic spheres with centres `rest` (s, 3) [m] and contacts `pairs` (c, 2) of
    spheres from 0 on; radius [m], density [kg/m^3], young [Pa] and poisson are scalars or (s,).

    `arm` (c, 3) [m] leads from the first to the second centre of each pair, by default as the
    centres lie: across a periodic side it does not. `planes` carry further contacts. `fields` are
    those of `Packing`; friction, gamma, yield_overlap (c,) are of all contacts, planes' last.
    Raises InvalidChain for numbers out of range.
    """
    rest = np.ascontiguousarray(rest, float)
    require(
        rest.ndim == 2 and rest.shape[1] == 3 and len(rest) > 0,
        f"rest has shape {np.shape(rest)}; give centres (s, 3)",
    )
    vector("rest", rest.ravel(), rest.size)
    s = len(rest)
    R, rho, E, nu = (
        np.broadcast_to(np.asarray(x, float), s) for x in (radius, density, young, poisson)
    )
    for name, values in (("radius", R), ("density", rho), ("young", E)):
        vector(name, values, s, positive=True)
    vector("poisson", nu, s, at_least=-1.0)
    pairs = np.asarray(pairs, np.int64).reshape(-1, 2)
    if pairs.size and not (0 <= pairs.min() and pairs.max() < s):
        raise InvalidChain(f"pairs name the sphere {pairs.max()}, there are 0 to {s - 1}")
    if arm is None:  # across a periodic side a sphere may touch its own image
        with_itself = pairs[:, 0] == pairs[:, 1]
        require(not np.any(with_itself), "a pair has one sphere twice; give two spheres")
    arm = rest[pairs[:, 1]] - rest[pairs[:, 0]] if arm is None else np.asarray(arm, float)

    # contacts of two spheres: the overlap at rest by the difference of numbers that are alike
    i, j = pairs.T
    overlap = R[i] + R[j] - np.linalg.norm(arm, axis=1)
    A = hertz_coefficient(R[i], E[i], nu[i], R[j], E[j], nu[j])
    K = mindlin_coefficient(R[i], E[i], nu[i], R[j], E[j], nu[j])
    tables = [(pairs, arm, overlap, A, K)]
    for plane in planes:
        k = np.asarray(plane.spheres, np.int64)
        second = np.full(k.size, AT_REST)
        if plane.point is not None:
            second = np.broadcast_to(MOVING - np.asarray(plane.point, np.int64), k.size)
        normal = np.broadcast_to(np.asarray(plane.normal, float), (k.size, 3))
        of_plane = hertz_coefficient(R[k], E[k], nu[k], np.inf, plane.young, plane.poisson)
        leaning = np.broadcast_to(np.asarray(plane.overlap, float), k.size)
        sideways = mindlin_coefficient(R[k], E[k], nu[k], np.inf, plane.young, plane.poisson)
        tables.append((np.column_stack([k, second]), normal, leaning, of_plane, sideways))
    all_pairs, arms, overlaps, coefficients, shear = (
        np.concatenate(parts) for parts in zip(*tables, strict=True)
    )
    return Packing(
        rest, R.copy(), mass(R, rho), np.ascontiguousarray(all_pairs), len(pairs),
        np.ascontiguousarray(arms), overlaps, coefficients, shear, **fields,
    )  # fmt: skip


def validate(packing: Packing, v0: ArrayLike) -> Array:
    """The velocities v0 (s, 3) [m/s] in a copy; raises InvalidChain with one sentence if anything
    of a packing and the velocities is not finite or out of range."""
    s, c = len(packing.mass), len(packing.A)
    vector("mass", packing.mass, s, positive=True)
    vector("radius", packing.radius, s, positive=True)
    vector("A", packing.A, c, positive=True)
    vector("overlap", packing.overlap, c)
    v0 = np.array(v0, float)
    require(v0.shape == (s, 3), f"initial velocity has shape {v0.shape}; give ({s}, 3) numbers")
    vector("initial velocity", v0.ravel(), v0.size)
    smaller = packing.radius[packing.pairs[:, 0]]
    require(
        np.all(packing.overlap < smaller),
        "spheres overlap at rest by more than a radius; move their centres apart",
    )
    require(
        packing.dissipation in DAMPING_LAWS,
        f"dissipation {packing.dissipation!r} is unknown; take one of {', '.join(DAMPING_LAWS)}",
    )
    if packing.dissipation != "none":
        vector("gamma", packing.gamma, c, at_least=0.0)
    if packing.friction is not None:
        vector("friction", packing.friction, c, at_least=0.0)
    if packing.yield_overlap is not None:
        vector("yield_overlap", packing.yield_overlap, c, positive=True)
    if packing.springs is not None:
        require(
            packing.friction is None,
            "contacts rub by springs or by Mindlin's increments; give springs or friction",
        )
        contact = packing.springs.contact
        require(
            packing.dissipation in ("none", "hunt-crossley") or not packing.gamma[contact].any(),
            "contacts that rub by springs are elastic or damped by hunt-crossley; take one of them",
        )
        require(
            packing.yield_overlap is None or np.all(packing.yield_overlap[contact] >= NO_YIELD),
            "contacts that rub by springs are elastic; give them no yield",
        )
    return v0


def drive(
    spheres: ArrayLike, direction: ArrayLike, t: ArrayLike, values: ArrayLike, quantity: str
) -> Drive:
    """Motion of spheres (numbers from 0) along a direction (3,) from its values at times t (n,)
    [s]: "displacement" [m], "velocity" [m/s] or "acceleration" [m/s^2], by a cubic spline; the two
    last begin without displacement, the last without velocity. Raises InvalidChain."""
    from scipy.interpolate import CubicSpline  # a tenth of a second

    t, values = np.asarray(t, float), np.asarray(values, float)
    require(t.size >= 4 and np.all(np.diff(t) > 0.0), "a drive needs four ascending times at least")
    vector("values of the drive", values, t.size)
    spline = CubicSpline(t, values)
    for _ in range(("displacement", "velocity", "acceleration").index(quantity)):
        spline = spline.antiderivative()
    unit = np.asarray(direction, float) / np.linalg.norm(direction)
    return Drive(
        np.unique(spheres).astype(np.int64), unit, t, np.ascontiguousarray(spline.c), np.zeros(1)
    )  # fmt: skip


def line_guides(direction: ArrayLike) -> Guides:
    """Guides that leave each sphere the motion along its direction (s, 3), and no spin; a zero
    direction guides nothing."""
    d = np.asarray(direction, float)
    size = np.linalg.norm(d, axis=1)
    unit = d / np.where(size > 0.0, size, 1.0)[:, None]
    free = (size == 0.0)[:, None, None] * np.eye(3)
    return Guides(
        np.ascontiguousarray(free + unit[:, :, None] * unit[:, None, :]),
        np.ascontiguousarray(free),
    )


def plane_guides(normal: ArrayLike, s: int) -> Guides:
    """Guides of s spheres that move in the plane across a normal (3,) and spin about it."""
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    across = np.outer(n, n)
    return Guides(*(np.tile(P, (s, 1, 1)) for P in (np.eye(3) - across, across)))
