"""A model as an Abaqus or CalculiX input deck: elements, materials, constraints, springs, support.

Ties and joints are written as linear equations, each slave displacement in terms of free ones, so
that another solver builds the same matrices. The elongation of a joint is that of two nodes of its
own (shifts of one, turns of the other, each as displacements 1 to 3), which springs hold to the
ground, one per direction, with a dashpot to a node next to it where the joint has one; the motion
of its second side is that of two more nodes. A table is one more node, with a spring and a mass.

Of faces in contact each facet has a node whose displacements 1 to 3 are its openings, on springs to
the ground; so has each bolt. Geometric stiffnesses of the preload are not written: they change
frequencies by parts in a thousand. The head of a bolt is two nodes with masses: its shifts, and its
turns in parts of which all have one moment of inertia.

The contact is the node CONTACT: its displacement 1 is w^T u, so that a unit force on it loads the
patch as the chain does. A static step does so, and its answer is the compliance w^T K^-1 w.
"""

from collections.abc import Mapping, Sequence
from itertools import count

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.sparse import csc_array, csr_matrix, diags_array
from skfem import MeshHex

from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.model import Model
from beadwave.fem.exchange.deck import PRINT_CONTACT, Deck, Term, labels

# local order of Abaqus' C3D20 and C3D10 among scikit-fem's shape functions
ORDER = {
    "C3D20": [0, 3, 6, 2, 1, 5, 7, 4, 10, 16, 14, 9, 12, 18, 17, 11, 8, 15, 19, 13],
    "C3D10": list(range(10)),
}
TURNED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]  # of a tetrahedron inside out, as scikit-fem may sort it


def input_deck(
    model: Model,
    materials: Mapping[str, Material | Orthotropic],
    *,
    n_modes: int = 10,
    w: NDArray[np.float64] | None = None,
    C: csc_array | None = None,
) -> str:
    """The text of a deck that solves for the first `n_modes` natural frequencies.

    `materials` by body. w (n,) adds the contact and, to a model that something holds, its static
    compliance [m/N]; C (n, n) [N s/m] is that of `fem.assembly.dashpots`, of which the dampers of
    joints are written. Springs between points, masses on faces and measured parts are not: a model
    that has some would be written without them, so that `--inp` refuses it before.
    """
    structure, T, n = model.structure, model.T, model.structure.n_dofs
    deck = Deck("second-order elements; all constraints as equations; SI units")

    # nodes of the mesh, and those that carry elongations and mean motions
    deck.nodes(count(1), structure.points, "MESH")
    joint_nodes = np.unique(model.free[model.free >= n] // 3)
    if len(joint_nodes):
        deck.nodes(joint_nodes + 1, np.zeros((len(joint_nodes), 3)), "JOINTS")

    label = labels(structure.basis)
    for body, basis in structure.basis.items():
        kind = "C3D20" if isinstance(basis.mesh, MeshHex) else "C3D10"
        nodes = ((structure.first[body] + basis.element_dofs[0::3]) // 3 + 1)[ORDER[kind]]
        if kind == "C3D10":
            inside_out = basis.mesh.orientation() < 0
            nodes[:, inside_out] = nodes[TURNED][:, inside_out]
        deck.elements(kind, label[body], nodes.T)

    # empty rows of T are held dofs; dofs of the joints' nodes that are not free are held as well.
    # Dof i counted from 0 is direction i % 3 + 1 of node i // 3 + 1 in the deck
    fixed = np.flatnonzero(np.diff(T.indptr) == 0)
    of_joints = (3 * joint_nodes[:, None] + np.arange(3)).ravel()
    held_dofs = [*fixed, *np.setdiff1d(of_joints, model.free)]
    deck.boundary((dof // 3 + 1, dof % 3 + 1) for dof in held_dofs)

    # all other rows of slaves: 0 = -u_slave + sum T u
    is_free = np.isin(np.arange(n), model.free)
    for slave in np.flatnonzero(~is_free & (np.diff(T.indptr) > 0)):
        row = slice(T.indptr[slave], T.indptr[slave + 1])
        masters = model.free[T.indices[row]]
        deck.equation(_terms([slave, *masters], [-1.0, *T.data[row]]))

    # springs to the ground on the elongations
    last, dofs = deck.last_element, model.free[model.elongation]
    for i, (dof, k) in enumerate(zip(dofs, model.stiffness, strict=True), start=1):
        if k > 0:
            deck.spring(f"SPRING{i}", [dof // 3 + 1], dof % 3 + 1, k, last + i)

    # the table: one more node, on two springs
    last += len(model.stiffness)
    if model.sway is not None:
        node = model.free[-1] // 3 + 1
        for i in (1, 2):
            direction = model.free[i - 3] % 3 + 1
            deck.spring(f"SWAY{i}", [node], direction, model.sway.stiffness, last + i)
        deck.mass("TABLE", node, model.sway.mass, last + 3)

    # a dashpot acts between two nodes: each gets one to the ground, a metre away in its direction
    last, contact = last + 3, int(max(model.free.max(), n - 1)) // 3 + 2
    coefficients = [] if C is None else C.diagonal()[model.elongation]
    for i, (dof, c) in enumerate(zip(dofs, coefficients, strict=False), start=1):
        if c > 0:
            deck.nodes([contact + i], [np.eye(3)[dof % 3]])
            deck.boundary([(contact + i, 1, 3)])
            deck.dashpot(f"DASHPOT{i}", [dof // 3 + 1, contact + i], c, last + i)

    # w^T u as displacement 1 of the node CONTACT
    if w is not None:
        read = np.flatnonzero(w)
        deck.nodes([contact], [(0, 0, 0)], "CONTACT")
        deck.equation(_terms([3 * (contact - 1), *model.free[read]], [-1.0, *w[read]]))
        deck.boundary([(contact, 2, 3)])

    # nodes that follow: openings of facets and elongations of bolts on springs, heads with masses
    node, element = contact + len(coefficients) + 1, last + len(coefficients)
    if model.contact is not None:
        m, k = len(model.contact.pressure), model.contact.layers
        of_facets = np.arange(3 * m).reshape(3, m).T
        for rows in [*of_facets, *np.arange(3 * m, len(k))[:, None]]:
            _follower(deck, node, model.contact.C[rows], model.free)
            for direction, stiffness in enumerate(k[rows], start=1):
                if stiffness > 0:
                    element += 1
                    deck.spring(f"FACE{element}", [node], direction, stiffness, element)
            node += 1
    for fastener in structure.fasteners:
        shifts, turns = fastener.inertia[0], max(fastener.inertia[3:])
        deck.nodes([node, node + 1], np.zeros((2, 3)))
        for mass in (shifts, turns):
            element += 1
            deck.mass(f"HEAD{element}", node, mass, element)
            node += 1
        heads = 3 * (node - 3) + np.arange(6)
        scaled = np.sqrt(np.array(fastener.inertia) / np.repeat([shifts, turns], 3))

        # masses stand on dofs that follow nothing: u_p = C_p^-1 (q - C_rest u_rest)
        C = csr_matrix(diags_array(scaled) @ fastener.C @ T)
        used = np.unique(C.indices)
        of_face = C[:, used].toarray()
        pivots = qr(of_face, mode="economic", pivoting=True)[2][:6]
        rest = np.setdiff1d(np.arange(len(used)), pivots)
        inverse = np.linalg.inv(of_face[:, pivots])
        masters = [*heads, *model.free[used[rest]]]
        factors = inverse @ np.hstack([np.eye(6), -of_face[:, rest]])
        for dof, row in zip(model.free[used[pivots]], factors, strict=True):
            deck.equation(_terms([dof, *masters], [-1.0, *row]))

    label = labels(materials)
    for body, material in materials.items():
        deck.material(label[body], material)
    deck.step("*FREQUENCY", f"{n_modes}", "*NODE FILE", "U")
    if w is not None and (model.sway is not None or len(fixed)):
        deck.step("*STATIC", "*CLOAD", f"{contact}, 1, 1.0", *PRINT_CONTACT)
    return deck.text()


def _follower(deck: Deck, node: int, C: csr_matrix, free: NDArray[np.int64]) -> None:
    """A node whose first displacements are rows C (1 to 3, n) of the free dofs; the others rest."""
    deck.nodes([node], [(0, 0, 0)])
    for i in range(C.shape[0]):
        at = slice(C.indptr[i], C.indptr[i + 1])
        masters = free[C.indices[at]]
        deck.equation(_terms([3 * (node - 1) + i, *masters], [-1.0, *C.data[at]]))
    if C.shape[0] < 3:
        deck.boundary([(node, C.shape[0] + 1, 3)])


def _terms(dofs: Sequence[int], factors: Sequence[float]) -> list[Term]:
    """Terms of an equation by dofs, counted from 0."""
    return [(dof // 3 + 1, dof % 3 + 1, c) for dof, c in zip(dofs, factors, strict=True)]
