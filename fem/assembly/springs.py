"""Springs between points of faces, or from one to the ground: cords, foam, soft mounts.

A spring of stiffness k and dashpot c along a unit vector d joins the rigid motions q = C u nearest
to the displacements of two discs (RBE3, `fem.assembly.joints.distributing`), both taken at the
middle s between the discs:

    r = d . (q_first(s) - q_second(s)) = b^T u,    K := K + k b b^T,    C := C + c b b^T

No rigid motion of both bodies together elongates it; the ground does not move, and s is the first
disc's own point there. Discs stay as flexible as they were.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from beadwave.fem.assembly.attached_mass import N_AROUND, N_RADIAL
from beadwave.fem.assembly.elasticity import Dent, PointSprings, Structure
from beadwave.fem.assembly.joints import distributing
from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.model import Model
from beadwave.fem.assembly.trace import OffFace, trace
from beadwave.fem.contact.contact_patch import disc_quadrature
from beadwave.fem.contact.disc_room import room_on_face
from beadwave.fem.contact.impact_point import SurfacePoint, planar_spot


class SpringEnd(NamedTuple):
    """A disc on a plane face where a spring begins or ends."""

    face: str  # "body:face"
    at: tuple[float, float] | None  # [m] from the middle of the face; None: nearest to the other
    radius: float  # [m] of the disc


class PointSpring(NamedTuple):
    """A spring between two discs, or from one to the ground."""

    name: str  # equal for springs that share their stiffness
    first: SpringEnd
    second: SpringEnd | None  # None is the ground
    stiffness: float  # [N/m]
    # (3,) of any length; "normal" out of the first face; None: from the first disc to the second
    direction: NDArray[np.float64] | str | None
    dashpot: float = 0.0  # [N s/m]


def with_springs(structure: Structure, springs: Iterable[PointSpring]) -> Structure:
    """The structure with these springs in `springs`, equal names together; `fem.joined` adds them
    to K.

    Raises OffFace where a disc leaves its face; ValueError for a face that is not plane, and for a
    spring without a direction between two discs at one point.
    """
    rows: dict[str, list[csr_matrix]] = {}
    dents: dict[str, list[tuple[Dent, ...]]] = {}
    constants: dict[str, tuple[float, float]] = {}
    for spring in springs:
        # both discs, and the middle between them; an end without a place lies opposite to the other
        first, second = spring.first, spring.second
        spot = planar_spot(structure, first.face, first.at or (0.0, 0.0))
        ends = [(1.0, first, spot)]
        middle = spot.point
        if second is not None:
            opposite = planar_spot(structure, second.face, second.at or (0.0, 0.0))
            if second.at is None:
                nearest = np.round(opposite.axes @ (spot.point - opposite.point), 9) + 0.0
                second = second._replace(at=tuple(nearest.tolist()))
                opposite = planar_spot(structure, second.face, second.at)
            ends.append((-1.0, second, opposite))
            middle = (spot.point + opposite.point) / 2

        # b: what the first disc moves along d less what the second does, both at the middle
        direction = spring.direction
        if isinstance(direction, str):
            direction = -spot.inward
        elif direction is None:
            direction = ends[-1][2].point - spot.point
            if not np.linalg.norm(direction) > 1e-9:
                raise ValueError(
                    f"both ends lie at {np.round(spot.point, 9).tolist()} m and give no direction; "
                    "give one, or stiffnesses along x, y and z."
                )
        d = np.asarray(direction, float) / np.linalg.norm(direction)
        b = sum(sign * along_disc(structure, end, s, middle, d) for sign, end, s in ends)
        rows.setdefault(spring.name, []).append(csr_matrix(b))
        constants[spring.name] = spring.stiffness, spring.dashpot

        # mean displacement of a disc under an even pressure, and its turn under the moment of a
        # force with a lever
        under = []
        for _, end, s in ends:
            a, lever = end.radius, np.linalg.norm(np.cross(middle - s.point, d))
            per_length = 16 / (3 * np.pi**2 * a) + 0.75 * lever**2 / a**3
            under.append(Dent(end.face.partition(":")[0], float(per_length)))
        dents.setdefault(spring.name, []).append(tuple(under))
    of_names = tuple(
        PointSprings(name, vstack(b, format="csr"), *constants[name], tuple(dents[name]))
        for name, b in rows.items()
    )
    return structure._replace(springs=structure.springs + of_names)


def missed_in_dents(
    model: Model, materials: Mapping[str, Material | Orthotropic], u: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Strain energy (k, k) [J] that a mesh can miss in the dents under springs, for displacements u
    (n, k) of a model's free dofs: sum F F^T c with forces F = k b^T u and the whole compliance c of
    a half-space, of which elements as large as the discs have next to nothing. A bound.

    c = 16 (1 - nu^2) / (3 pi^2 E a) of the mean under an even pressure, times (2 - nu) / (2 - 2 nu)
    along the face; 3 (1 - nu^2) lever^2 / (4 E a^3) of a turn (Johnson, Contact Mechanics (1985),
    sec. 3.4 to 3.6 and 5.3).
    """
    missed = np.zeros((u.shape[1], u.shape[1]))
    for spring in model.structure.springs:
        F = spring.stiffness * (spring.B @ (model.T @ u))
        c = [
            sum(d.per_length * _softness(materials[d.body]) for d in ends) for ends in spring.dents
        ]
        missed += (F.T * np.array(c)) @ F
    for part, at in model.measured:
        F = part.stiffness @ (part.B @ (model.T @ u) - part.phi @ u[at])
        c = [d.per_length * _softness(materials[d.body]) for d in part.dents]
        missed += (F.T * np.array(c)) @ F
    return missed


def _softness(material: Material | Orthotropic) -> float:
    """(1 - nu^2) / E [1/Pa], times what a surface is softer along itself; of the softest axis."""
    if isinstance(material, Orthotropic):
        return 1.5 / min(material.young)
    nu = material.poisson
    return (1 - nu**2) / material.young * max(1.0, (2 - nu) / (2 - 2 * nu))


def along_disc(
    structure: Structure,
    end: SpringEnd,
    spot: SurfacePoint,
    middle: NDArray[np.float64],
    d: NDArray[np.float64],
) -> csr_matrix:
    """d . q(middle) of a disc's rigid motion, (1, ndof): middle (3,) [m], d (3,) a unit vector.

    Raises OffFace, with where the disc would have room, where it leaves its face.
    """
    disc, share = disc_quadrature("area", N_RADIAL, N_AROUND)
    on_face = spot.point + end.radius * disc @ spot.axes
    try:
        P = trace(structure, end.face, on_face)
    except OffFace:
        at = end.at or (0.0, 0.0)
        room = room_on_face(structure, end.face, at, end.radius)
        raise OffFace(
            f"a disc of radius {end.radius:g} m at {list(at)} m from the middle of {end.face!r} "
            f"leaves that face; {room}; move it or make it smaller."
        ) from None
    return csr_matrix(d @ distributing(on_face, share, middle)[:3]) @ P
