"""Masses that a face carries: sensors, stingers, magnets.

A body of mass m and moments of inertia J moves with the rigid motion q = C u nearest to the
displacements of a disc of the face (RBE3, `fem.assembly.joints.distributing`), taken at its own
centre, so that it adds mass and no stiffness:

    M := M + C^T diag(m, m, m, J_x, J_y, J_z) C.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csr_matrix

from beadwave.fem.assembly.elasticity import AttachedMass, FastenerMass, Structure
from beadwave.fem.assembly.joints import distributing
from beadwave.fem.assembly.trace import OffFace, face_quadrature, trace
from beadwave.fem.contact.contact_patch import disc_quadrature
from beadwave.fem.contact.disc_room import room_on_face
from beadwave.fem.contact.impact_point import planar_spot


class CarriedMass(NamedTuple):
    """A rigid body on a disc of a plane face."""

    name: str
    face: str  # "body:face"
    at: tuple[float, float]  # [m] from the middle of the face, along the axes that span it
    radius: float  # [m] of the disc
    mass: float  # [kg]
    height: float = 0.0  # [m] of its centre of mass over the face
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [kg m^2] about x, y, z through it


# Points that average over the disc; rigid motions are exact with any number of them.
N_RADIAL = 16
N_AROUND = 48


def with_carried(structure: Structure, masses: Iterable[CarriedMass]) -> Structure:
    """The structure with these masses in M, and each of them alone in `carried`.

    Raises OffFace where a disc leaves its face, ValueError for a face that is not plane.
    """
    carried = []
    disc, share = disc_quadrature("area", N_RADIAL, N_AROUND)
    for body in masses:
        # displacements of the disc's points by those of the mesh, u_disc = P u
        spot = planar_spot(structure, body.face, body.at)
        on_face = spot.point + body.radius * disc @ spot.axes
        try:
            P = trace(structure, body.face, on_face)
        except OffFace:
            room = room_on_face(structure, body.face, body.at, body.radius)
            raise OffFace(
                f"a disc of radius {body.radius:g} m at {list(body.at)} m from the middle of "
                f"{body.face!r} leaves that face; {room}; move it or make it smaller."
            ) from None

        centre = spot.point - body.height * spot.inward
        C = csr_matrix(distributing(on_face, share, centre)) @ P
        M = _inertia(csr_matrix(C), [body.mass] * 3 + list(body.inertia))
        carried.append(AttachedMass(body.name, M))
    M = sum((mass.M for mass in carried), start=structure.M).tocsr()
    return structure._replace(M=M, carried=structure.carried + tuple(carried))


def with_mass_on_face(
    structure: Structure,
    face: str,
    mass: float,
    inertia: Sequence[float],
    centre: NDArray[np.float64],
    axes: NDArray[np.float64],
) -> Structure:
    """The structure with a rigid body in M that moves with the mean of a whole face, as the head of
    a bolt: mass [kg], moments of inertia (3,) [kg m^2] about `axes` (3, 3), rows, through its
    centre (3,) [m]. Raises ValueError as `fem.assembly.trace.face_quadrature`."""
    points, weights = face_quadrature(structure, face)
    C = csr_matrix(distributing(points, weights, centre)) @ trace(structure, face, points)
    C = csr_matrix(block_diag(axes, axes)) @ C
    fastener = FastenerMass(csr_matrix(C), (*[mass] * 3, *inertia))
    M = structure.M + _inertia(*fastener)
    return structure._replace(M=csr_matrix(M), fasteners=(*structure.fasteners, fastener))


def _inertia(C: csr_matrix, inertia: Sequence[float]) -> csr_matrix:
    """C^T diag(m, m, m, J_x, J_y, J_z) C of the rigid motion q = C u at a body's centre, along the
    axes in which its inertia is diagonal."""
    return csr_matrix(C.T @ C.multiply(np.array(inertia)[:, None]))
