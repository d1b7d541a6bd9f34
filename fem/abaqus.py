"""A model as an Abaqus or CalculiX input deck: elements, materials, constraints, springs, support.

Ties and screws are written as the linear equations they are here, so that another solver builds
the same matrices: each slave displacement in terms of free ones. A screw's elongation stands on
two nodes of its own (shifts on one, turns on the other, each as displacements 1 to 3), held to
the ground by one spring per direction; its mean motion on two more.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from skfem import MeshHex

from fem.elasticity import Material
from fem.model import Model

# local order of Abaqus' C3D20 and C3D10 among scikit-fem's shape functions
ORDER = {
    "C3D20": [0, 3, 6, 2, 1, 5, 7, 4, 10, 16, 14, 9, 12, 18, 17, 11, 8, 15, 19, 13],
    "C3D10": list(range(10)),
}
PER_LINE = 4  # terms of an equation


def input_deck(model: Model, materials: dict[str, Material], *, n_modes: int = 10) -> str:
    """The text of a deck that solves for the first `n_modes` natural frequencies."""
    lines = ["** second-order elements; all constraints as equations; SI units"]
    for block in (_nodes, _elements, _supports, _equations, _springs):
        lines += block(model)
    lines += _materials(materials)
    lines += ["*STEP", "*FREQUENCY", f"{n_modes}", "*NODE FILE", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def _nodes(model: Model) -> Iterator[str]:
    basis = model.structure.basis
    yield "*NODE, NSET=MESH"
    for i, x in enumerate(basis.doflocs[:, 0::3].T, start=1):
        yield f"{i}, {x[0]:.12g}, {x[1]:.12g}, {x[2]:.12g}"
    if len(_joint_nodes(model)):
        yield "*NODE, NSET=JOINTS"
        yield from (f"{i + 1}, 0, 0, 0" for i in _joint_nodes(model))


def _joint_nodes(model: Model) -> NDArray[np.int64]:
    """Nodes (from 0) that carry elongations and mean motions instead of a place on the mesh."""
    return np.unique(model.free[model.free >= model.structure.basis.N] // 3)


def _elements(model: Model) -> Iterator[str]:
    basis = model.structure.basis
    kind = "C3D20" if isinstance(basis.mesh, MeshHex) else "C3D10"
    nodes = basis.element_dofs[0::3] // 3 + 1
    for body, cells in basis.mesh.subdomains.items():
        yield f"*ELEMENT, TYPE={kind}, ELSET={_label(body)}"
        for cell in cells:
            yield from _wrapped([cell + 1, *nodes[ORDER[kind], cell]])


def _wrapped(numbers, per_line: int = 10) -> Iterator[str]:
    for i in range(0, len(numbers), per_line):
        more = "," if i + per_line < len(numbers) else ""
        yield ", ".join(str(n) for n in numbers[i : i + per_line]) + more


def _supports(model: Model) -> Iterator[str]:
    held = np.flatnonzero(np.diff(model.T.indptr) == 0)
    joints = (3 * _joint_nodes(model)[:, None] + np.arange(3)).ravel()
    yield "*BOUNDARY"
    for dof in [*held, *np.setdiff1d(joints, model.free)]:
        yield f"{dof // 3 + 1}, {dof % 3 + 1}"


def _equations(model: Model) -> Iterator[str]:
    T, n = model.T, model.structure.basis.N
    is_free = np.isin(np.arange(n), model.free)
    for slave in np.flatnonzero(~is_free & (np.diff(T.indptr) > 0)):
        row = slice(T.indptr[slave], T.indptr[slave + 1])
        masters = model.free[T.indices[row]]
        terms = [(slave, -1.0), *zip(masters, T.data[row], strict=True)]
        yield "*EQUATION"
        yield str(len(terms))
        yield from _terms(terms)


def _terms(terms: list[tuple[int, float]]) -> Iterator[str]:
    for i in range(0, len(terms), PER_LINE):
        some = terms[i : i + PER_LINE]
        yield ", ".join(f"{dof // 3 + 1}, {dof % 3 + 1}, {c:.12e}" for dof, c in some)


def _springs(model: Model) -> Iterator[str]:
    first = model.structure.basis.mesh.nelements + 1
    dofs = model.free[model.elongation]
    for i, (dof, k) in enumerate(zip(dofs, model.stiffness, strict=True)):
        if k > 0:
            yield f"*ELEMENT, TYPE=SPRING1, ELSET=SPRING{i + 1}"
            yield f"{first + i}, {dof // 3 + 1}"
            yield f"*SPRING, ELSET=SPRING{i + 1}"
            yield f"{dof % 3 + 1}"
            yield f"{k:.12e}"


def _materials(materials: dict[str, Material]) -> Iterator[str]:
    for body, m in materials.items():
        name = _label(body)
        yield f"*MATERIAL, NAME={name}"
        yield from ("*ELASTIC", f"{m.young:.12g}, {m.poisson:.12g}")
        yield from ("*DENSITY", f"{m.density:.12g}")
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"


def _label(body: str) -> str:
    return body.upper().replace("+", "_P_").replace("-", "_M_")
