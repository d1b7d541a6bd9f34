"""A body with mirror planes through the contact, meshed on one side of them only.

The motion normal to a mirror is zero there. Each mirror doubles K and M, which are then those of
the whole body, so that energies, forces and modes need no further factor.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.model import Connections, HeldFace, Model, joined
from beadwave.fem.assembly.trace import face_nodes


def mirrored(structure: Structure, held: Sequence[str], mirrors: Sequence[str]) -> Model:
    """The complete body, held on the faces `held`; `mirrors` are planes normal to an axis that pass
    through the contact. Only motions that are symmetric about them are in it, as a central strike
    excites. Raises ValueError for a mirror that is no such plane."""
    copies = 2 ** len(mirrors)
    body = structure._replace(K=copies * structure.K, M=copies * structure.M)
    still = [HeldFace(face, "xyz"[normal_axis(structure, face)]) for face in mirrors]
    return joined(body, Connections(held=[*map(HeldFace, held), *still]))


def normal_axis(structure: Structure, face: str) -> int:
    """The axis, 0 to 2 for x, y, z, that a plane is normal to; raises ValueError for any other
    face."""
    spots = structure.points[face_nodes(structure, face)[:, 0] // 3]
    extent = np.ptp(spots, axis=0)
    if extent.min() > 1e-9 * extent.max():
        raise ValueError(f"the mirror {face!r} must be a plane normal to x, y or z.")
    return int(extent.argmin())


def normal_dofs(structure: Structure, face: str) -> NDArray[np.int64]:
    """The dofs (n,) of the displacements normal to a mirror plane, one for each of its n nodes."""
    return face_nodes(structure, face)[:, normal_axis(structure, face)]
