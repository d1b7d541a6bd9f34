"""A model as an Abaqus or CalculiX input deck: elements, materials, constraints, springs, support.

Ties and joints are written as the linear equations they are here, so that another solver builds
the same matrices: each slave displacement in terms of free ones. A joint's elongation stands on
two nodes of its own (shifts on one, turns on the other, each as displacements 1 to 3), held to
the ground by one spring per direction, with a dashpot to a node beside it where the joint has one;
the motion of its second side on two more. A table sways as one more node, with a spring and a mass.

The contact is the node CONTACT: its displacement 1 is w^T u, so that a unit force on it loads the
patch as the chain does. A static step does so, and its answer is the compliance w^T K^-1 w.
"""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from skfem import MeshHex

from fem.materials import Material, Orthotropic
from fem.model import Model

# local order of Abaqus' C3D20 and C3D10 among scikit-fem's shape functions
ORDER = {
    "C3D20": [0, 3, 6, 2, 1, 5, 7, 4, 10, 16, 14, 9, 12, 18, 17, 11, 8, 15, 19, 13],
    "C3D10": list(range(10)),
}
TURNED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]  # of a tetrahedron inside out, as scikit-fem may sort it
LONGEST_LABEL = 60  # letters; CalculiX reads 80
PER_LINE = 4  # terms of an equation


def input_deck(
    model: Model,
    materials: Mapping[str, Material | Orthotropic],
    *,
    n_modes: int = 10,
    w: NDArray[np.float64] | None = None,
    C: csc_array | None = None,
) -> str:
    """The text of a deck that solves for the first `n_modes` natural frequencies.

    w (n,) adds the contact and, to a model that something holds, its static compliance; C (n, n)
    is that of `fem.dashpots`.
    """
    lines = ["** second-order elements; all constraints as equations; SI units"]
    for block in (_nodes, _elements, _supports, _equations, _springs, _table):
        lines += block(model)
    lines += [] if C is None else _dashpots(model, C.diagonal()[model.elongation])
    lines += [] if w is None else _contact(model, w)
    lines += _materials(materials)
    lines += ["*STEP", "*FREQUENCY", f"{n_modes}", "*NODE FILE", "U", "*END STEP"]
    if w is not None and _is_held(model):
        lines += ["*STEP", "*STATIC", "*CLOAD", f"{_node_after(model)}, 1, 1.0"]
        lines += ["*NODE PRINT, NSET=CONTACT", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def _is_held(model: Model) -> bool:
    return model.sway is not None or bool(np.any(np.diff(model.T.indptr) == 0))


def _node_after(model: Model) -> int:
    """The first number that no node of mesh, joints and table has."""
    return int(max(model.free.max(), model.structure.n_dofs - 1)) // 3 + 2


def _nodes(model: Model) -> Iterator[str]:
    yield "*NODE, NSET=MESH"
    for i, x in enumerate(model.structure.points, start=1):
        yield f"{i}, {x[0]:.13g}, {x[1]:.13g}, {x[2]:.13g}"  # 20 characters are read
    if len(_joint_nodes(model)):
        yield "*NODE, NSET=JOINTS"
        yield from (f"{i + 1}, 0, 0, 0" for i in _joint_nodes(model))


def _joint_nodes(model: Model) -> NDArray[np.int64]:
    """Nodes (from 0) that carry elongations and mean motions instead of a place on the mesh."""
    return np.unique(model.free[model.free >= model.structure.n_dofs] // 3)


def _elements(model: Model) -> Iterator[str]:
    last = 0
    label = _labels(model.structure.basis)
    for body, basis in model.structure.basis.items():
        kind = "C3D20" if isinstance(basis.mesh, MeshHex) else "C3D10"
        nodes = ((model.structure.first[body] + basis.element_dofs[0::3]) // 3 + 1)[ORDER[kind]]
        if kind == "C3D10":
            inside_out = basis.mesh.orientation() < 0
            nodes[:, inside_out] = nodes[TURNED][:, inside_out]
        yield f"*ELEMENT, TYPE={kind}, ELSET={label[body]}"
        for number, cell in enumerate(nodes.T, start=last + 1):
            yield from _wrapped([number, *cell])
        last += basis.nelems


def _n_elements(model: Model) -> int:
    return sum(basis.nelems for basis in model.structure.basis.values())


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
    T, n = model.T, model.structure.n_dofs
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
    first = _n_elements(model) + 1
    dofs = model.free[model.elongation]
    for i, (dof, k) in enumerate(zip(dofs, model.stiffness, strict=True)):
        if k > 0:
            yield f"*ELEMENT, TYPE=SPRING1, ELSET=SPRING{i + 1}"
            yield f"{first + i}, {dof // 3 + 1}"
            yield f"*SPRING, ELSET=SPRING{i + 1}"
            yield f"{dof % 3 + 1}"
            yield f"{k:.12e}"


def _table(model: Model) -> Iterator[str]:
    if model.sway is None:
        return
    node = model.free[-1] // 3 + 1
    first = _n_elements(model) + len(model.stiffness) + 1
    for i in (0, 1):
        yield from (f"*ELEMENT, TYPE=SPRING1, ELSET=SWAY{i + 1}", f"{first + i}, {node}")
        yield from (f"*SPRING, ELSET=SWAY{i + 1}", f"{model.free[i - 2] % 3 + 1}")
        yield f"{model.sway.stiffness:.12e}"
    yield from ("*ELEMENT, TYPE=MASS, ELSET=TABLE", f"{first + 2}, {node}")
    yield from ("*MASS, ELSET=TABLE", f"{model.sway.mass:.12e}")


def _dashpots(model: Model, c: NDArray[np.float64]) -> Iterator[str]:
    """A dashpot acts between two nodes: each gets one to lean on, a metre away in its direction."""
    ground = _node_after(model)
    first = _n_elements(model) + len(model.stiffness) + 3
    dofs = model.free[model.elongation]
    for i, (dof, value) in enumerate(zip(dofs, c, strict=True), start=1):
        if value > 0:
            place = ", ".join("1" if axis == dof % 3 else "0" for axis in range(3))
            yield from ("*NODE", f"{ground + i}, {place}")
            yield from ("*BOUNDARY", f"{ground + i}, 1, 3")
            yield f"*ELEMENT, TYPE=DASHPOTA, ELSET=DASHPOT{i}"
            yield f"{first + i}, {dof // 3 + 1}, {ground + i}"
            yield from (f"*DASHPOT, ELSET=DASHPOT{i}", "", f"{value:.12e}")


def _contact(model: Model, w: NDArray[np.float64]) -> Iterator[str]:
    """u = w^T u of the model as displacement 1 of a node of its own."""
    node = _node_after(model)
    read = np.flatnonzero(w)
    yield from ("*NODE, NSET=CONTACT", f"{node}, 0, 0, 0", "*EQUATION", str(len(read) + 1))
    yield from _terms([(3 * (node - 1), -1.0), *zip(model.free[read], w[read], strict=True)])
    yield from ("*BOUNDARY", f"{node}, 2, 3")


def _materials(materials: Mapping[str, Material | Orthotropic]) -> Iterator[str]:
    label = _labels(materials)
    for body, m in materials.items():
        name, oriented = label[body], ""
        yield f"*MATERIAL, NAME={name}"
        if isinstance(m, Material):
            yield from ("*ELASTIC", f"{m.young:.12g}, {m.poisson:.12g}")
        else:
            yield "*ELASTIC, TYPE=ENGINEERING CONSTANTS"
            constants = [f"{x:.12g}" for x in (*m.young, *m.poisson, *m.shear)]
            yield from (", ".join(constants[:8]), constants[8])
            oriented = f", ORIENTATION=AXES_{name}"
        yield from ("*DENSITY", f"{m.density:.12g}")
        if oriented:
            yield f"*ORIENTATION, NAME=AXES_{name}"
            yield ", ".join(f"{x:.12g}" for x in m.frame[:2].ravel())
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL={name}{oriented}"


def _labels(bodies: Iterable[str]) -> dict[str, str]:
    """Names of bodies in letters that decks allow, told apart where they fall together."""
    found: dict[str, str] = {}
    for body in sorted(bodies):
        kept = body.upper().replace("+", "_P_").replace("-", "_M_")
        label = "".join(c if c.isalnum() and c.isascii() else "_" for c in kept)[:LONGEST_LABEL]
        found[body] = f"{label}_{len(found)}" if label in found.values() else label
    return found
