"""A body with mirror planes through the contact, meshed on one side of them only.

The motion normal to a mirror is zero there. K and M are those of the whole body: each mirror
doubles them, so that energies, forces and modes need no further thought.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fem.constraints import congruent, eliminated
from fem.elasticity import Structure
from fem.model import Model
from fem.trace import face_nodes


def mirrored(structure: Structure, held: Sequence[str], mirrors: Sequence[str]) -> Model:
    """The whole body, held on the faces `held`; `mirrors` are faces "body:-y" normal to an axis."""
    copies = 2 ** len(mirrors)
    whole = structure._replace(K=copies * structure.K, M=copies * structure.M)
    basis = structure.basis
    fixed = [face_nodes(basis, face).ravel() for face in held]
    fixed += [normal_dofs(basis, face) for face in mirrors]
    dofs = np.unique(np.concatenate([np.empty(0, np.int64), *fixed]))
    T, free = eliminated(basis.N, [], dofs)
    K, M = (congruent(T, A) for A in (whole.K, whole.M))
    return Model(K, M, T, free, whole, np.empty(0, np.int64), np.empty(0), ())


def normal_dofs(basis, face: str) -> NDArray[np.int64]:
    """The displacements normal to a face "body:-y", (n,)."""
    return face_nodes(basis, face)[:, "xyz".index(face[-1])]
