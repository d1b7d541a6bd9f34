"""A part known by measured receptances at points, joined to a structure at these points.

Its oscillators (`rom.passive_fit`) have mass-normalised shapes Phi (m, k) at the m points,
omega, zeta (free masses with omega = 0), and a compliance S (m, m) beyond them. Where the points
move by B u with the structure, through springs of compliance 1 / k in series with S,

    K := K + D^T K_j D,   D = [B, -Phi],   K_j = (S + d^T k^-1 d)^-1,
    M := M + I,  C := C + diag(2 zeta omega),  K := K + diag(omega^2)   on the oscillators,

all symmetric and positive semidefinite: the whole cannot create energy. B takes the mean motion of
a disc along the direction of a measurement, as springs do (`fem.assembly.springs`).
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from beadwave.fem.assembly.elasticity import Dent, JoinedPart, Structure
from beadwave.fem.assembly.springs import SpringEnd, along_disc
from beadwave.fem.contact.impact_point import planar_spot


class PartPoint(NamedTuple):
    """Place and direction of one of the m measured motions of a part."""

    end: SpringEnd
    direction: NDArray[np.float64]  # (3,) unit vector
    number: int  # equal for the directions of one point, which share their springs


class MeasuredPart(NamedTuple):
    """Oscillators of a part at m points, and the springs between it and a structure."""

    name: str
    omega: NDArray[np.float64]  # (k,) [rad/s], 0 of free masses
    zeta: NDArray[np.float64]  # (k,)
    phi: NDArray[np.float64]  # (m, k) [kg^-1/2]
    compliance: NDArray[np.float64]  # (m, m) [m/N]
    points: tuple[PartPoint, ...]  # (m,)
    stiffness: tuple[float, float, float] = (np.inf,) * 3  # [N/m] along x, y, z; inf is rigid


# When points of a part move with each other for want of a compliance
MAX_CONDITION = 1e12  # of the compliance between part and structure, points scaled alike


def with_measured(
    structure: Structure,
    parts: Iterable[MeasuredPart],
) -> Structure:
    """The structure with these parts in `measured`; `fem.joined` adds them to K and M.

    Raises OffFace where a disc leaves its face; ValueError for a face that is not plane, and for a
    part that leaves the joint without a compliance in some direction.
    """
    joined = []
    for part in parts:
        rows, dents = [], []
        for one in part.points:
            spot = planar_spot(structure, one.end.face, one.end.at)
            rows.append(along_disc(structure, one.end, spot, spot.point, one.direction))
            per_length = 16 / (3 * np.pi**2 * one.end.radius)
            dents.append(Dent(one.end.face.partition(":")[0], float(per_length)))
        joined.append(
            JoinedPart(
                part.name, csr_matrix(vstack(rows)), part.omega, part.zeta, part.phi,
                joint_stiffness(part), tuple(dents),
            )
        )  # fmt: skip
    return structure._replace(measured=structure.measured + tuple(joined))


def joint_stiffness(part: MeasuredPart) -> NDArray[np.float64]:
    """K_j (m, m) [N/m] of the part's compliance and its springs in series; raises ValueError where
    it would be infinite. Motions at one point share its three springs, so that two directions that
    are not square to each other couple: d_i^T k^-1 d_j."""
    d = np.array([one.direction for one in part.points])
    number = np.array([one.number for one in part.points])
    same = number[:, None] == number
    Y = part.compliance + same * (d / np.array(part.stiffness) @ d.T)
    scale = np.sqrt(np.diag(Y))
    if not np.all(scale > 0) or np.linalg.cond(Y / np.outer(scale, scale)) > MAX_CONDITION:
        raise ValueError(
            "the responses show no compliance beyond their modes in some direction, where a rigid "
            "joint would tie modes to each other; give it stiffnesses kx, ky, kz in N/m, or "
            "measure to a higher frequency."
        )
    K = np.linalg.inv(Y)
    return (K + K.T) / 2
