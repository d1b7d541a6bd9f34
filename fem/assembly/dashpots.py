"""Viscous dampers in joints and in springs between points: C = sum_j c_j e_j e_j^T on elongations.

They couple the undamped modes, each of them all, so no modal ratios stand for this C.
"""

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csc_array, csr_array, csr_matrix, diags_array, vstack

from beadwave.fem.assembly.model import Model


def dashpots(model: Model, coefficient: dict[str, float]) -> csc_array:
    """C (n, n) [N s/m] of c [N s/m or N m s/rad] by spring, "joint.direction", equal for
    all joints of one name; of the structure's springs between points, and of measured parts.

    Raises ValueError for a direction that has no elongation, being rigid.
    """
    for name in coefficient:
        if name not in model.spring:
            raise ValueError(f"no spring {name} gives way; a rigid direction cannot damp.")
    c = np.zeros(model.K0.shape[0])
    c[model.elongation] = [coefficient.get(name, 0.0) for name in model.spring]
    C = csc_array(diags_array(c))
    for spring in model.structure.springs:
        if spring.dashpot:
            B = csr_array(spring.B @ model.T)
            C = C + spring.dashpot * (B.T @ B)
    for part, at in model.measured:
        of_part = np.zeros(C.shape[0])
        of_part[at] = 2 * part.zeta * part.omega
        C = C + diags_array(of_part)
    return csc_array(C)


def dashpot_rows(model: Model, coefficient: Mapping[str, float]) -> csr_matrix:
    """Rows (d, n) of which C = rows^T rows [N s/m], of dashpots by the name of the parallel spring,
    "joint.direction" or that of a spring between points, and of the oscillators of measured parts.

    The same C as that of `dashpots` in as many rows as there are dampers: what Woodbury's formula
    needs (`fem.modes.solver.full_responses`).
    """
    n = model.K0.shape[0]
    rows = [csr_matrix((0, n))]
    for name, c in coefficient.items():
        at = model.elongation[[spring == name for spring in model.spring]]
        rows.append(csr_matrix((np.full(len(at), np.sqrt(c)), (range(len(at)), at)), (len(at), n)))
        rows += [
            np.sqrt(c) * csr_matrix(one.B @ model.T)
            for one in model.structure.springs
            if one.name == name
        ]
    for part, at in model.measured:
        c = np.sqrt(2 * part.zeta * part.omega)
        rows.append(csr_matrix((c, (range(len(at)), at)), (len(at), n)))
    return csr_matrix(vstack(rows))
