"""An assembly whose bolts press its faces, linear about that state.

Bolts are rods from head to nut (`fem.assembly.rods`), tightened to their preload and then locked;
other static loads act beside them. The zone follows from `fem.contact.preloaded_contact`; closed
facets join the faces along the normal and, where they stick, across it. To K comes the geometric
stiffness of the rods' tension and of the compression of what they press, which cancel but for
bending.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array, vstack
from scipy.sparse.linalg import lsqr

from beadwave.fem.assembly.constraints import congruent
from beadwave.fem.assembly.joints import Tie
from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.model import Model
from beadwave.fem.assembly.prestress import Load, static_forces, stress_stiffness
from beadwave.fem.assembly.rods import tightened
from beadwave.fem.contact.facing_facets import FacingFacets, facing_facets
from beadwave.fem.contact.preloaded_contact import (
    OPEN,
    CondensedContact,
    PreloadedContact,
    condensed,
    joined_stiffness,
    preloaded_contact,
    with_friction,
)
from beadwave.fem.modes.solver.multifrontal import NEITHER, Singular

# stiffness of a hard layer over E / h of the softer body, h the size of a facet: its compliance is
# a 300th of that of the elements next to it
HARD = 300.0
# [rad^2/s^2] of a structure that floats: 1e-6 of the displacements where its first mode is at 1 kHz
SHIFT = (2 * np.pi) ** 2


class PairInContact(NamedTuple):
    """Two faces in contact, with their friction and the layer of rough faces."""

    pair: Tie  # the slave carries the pressure
    friction: float
    rough: float = 0.0  # lambda of k = p / lambda [m]; 0 of hard faces
    # centres (3,) [m] of the bolts between them, and the shear stiffness [N/m] of each after slip
    bolts: Sequence[tuple[NDArray[np.float64], float]] = ()
    # [m] height of the crown of both together: > 0 they touch in their middle first, < 0 at the rim
    flatness: float = 0.0
    least_gap: float | None = None  # [m] of round faces, where it is known of the bodies


class PressedAssembly(NamedTuple):
    """An assembly whose faces are condensed once: other tensions of its rods, other frictions and
    roughnesses need no other factorisation."""

    model: Model  # with its faces open
    materials: Mapping[str, Material | Orthotropic]
    contact: CondensedContact
    of_each: list[int]  # facets of each pair of faces
    shift: float  # [rad^2/s^2] of the reference, 0 where contact and bolts hold the bodies


def pressed_assembly(
    model: Model,
    materials: Mapping[str, Material | Orthotropic],
    load: Load,
    faces: Sequence[PairInContact],
) -> PressedAssembly:
    """The faces of a model condensed, with rods where the load has them.

    Raises ValueError for faces that have nothing in common, and for rods that `tightened`
    refuses.
    """
    structure, T = model.structure, model.T
    pairs = [facing_facets(structure, *f.pair, f.least_gap) for f in faces]
    of_each = [len(pair.area) for pair in pairs]
    facets = together(pairs)
    young = [
        min(np.min(materials[face.partition(":")[0]].young) for face in f.pair[:2]) for f in faces
    ]
    hard = HARD * np.repeat(young, of_each) / np.sqrt(facets.whole)

    # while bolts are tightened they have their tension and no stiffness
    parts = model.K, model.M, T, facets, hard
    bolts = tightened(structure, load.rods).elongation
    try:
        if floats(model.K, T):
            raise Singular(NEITHER)
        return PressedAssembly(model, materials, condensed(*parts, bolts=bolts), of_each, 0.0)
    except Singular:
        contact = condensed(*parts, bolts=bolts, shift=SHIFT)
        return PressedAssembly(model, materials, contact, of_each, SHIFT)


def pressed_model(assembly: PressedAssembly, load: Load, faces: Sequence[PairInContact]) -> Model:
    """The model about its state under loads, whose rods press the faces; rods and faces are those
    of the assembly, with tensions, frictions and layers of their own. Raises ValueError for loads
    that open all of the contact."""
    model, contact = assembly.model, assembly.contact
    structure, T = model.structure, model.T
    rods = tightened(structure, load.rods)
    F = T.T @ (static_forces(structure, assembly.materials, load) + rods.f)
    state = pressed_state(contact, F, faces, assembly.of_each, rods.stiffness)
    stresses = stress_stiffness(structure, assembly.materials, load, T @ state.u)
    K_G = congruent(T, csr_matrix(stresses + rods.K_G + pressure_stiffness(state)))
    # K0 and K_G are stored by columns, and so is the transpose of what is stored by rows
    return model._replace(K0=model.K0 + K_G + joined_stiffness(state).T, contact=state)


def pressed_state(
    contact: CondensedContact,
    F: NDArray[np.float64],
    faces: Sequence[PairInContact],
    of_each: Sequence[int],
    locked: NDArray[np.float64],
) -> PreloadedContact:
    """The state under forces F (n,) [N] of faces with as many facets each, which other forces,
    friction and roughness change without a factorisation; `locked` (b,) [N/m] are the stiffnesses
    of the bolts about it. Raises ValueError for forces that open all of the contact."""
    facets, ends = contact.facets, np.cumsum(of_each)[:-1]

    # the zone without friction; facets that slide share the stiffness of the bolt nearest to them
    crowns = [
        crown(points, area, f.flatness)
        for points, area, f in zip(
            *(np.split(x, ends) for x in (facets.points, facets.area)), faces, strict=True
        )
    ]
    gap = facets.gap + np.concatenate(crowns)
    state = preloaded_contact(contact, F, gap)
    shear = []
    parts = (np.split(x, ends) for x in (facets.points, facets.area, state.state != OPEN))
    for points, area, on, f in zip(*parts, faces, strict=True):
        if not f.bolts:
            shear.append(np.zeros(len(on)))
            continue
        centres = np.array([centre for centre, _ in f.bolts])
        nearest = np.linalg.norm(points[:, None] - centres, axis=2).argmin(axis=1)
        zone = np.bincount(nearest, area * on, minlength=len(centres))
        k = np.array([stiffness for _, stiffness in f.bolts])
        shear.append((k / np.maximum(zone, area.min()))[nearest])
    state = state._replace(bolts=np.concatenate(shear), locked=locked)

    # then what would slide
    friction = np.repeat([f.friction for f in faces], of_each)
    state = with_friction(contact, state, F, friction, gap)
    return state.with_roughness(np.repeat([f.rough for f in faces], of_each))


def crown(
    points: NDArray[np.float64], area: NDArray[np.float64], height: float
) -> NDArray[np.float64]:
    """Gaps (m,) [m] of facets at points (m, 3) with areas (m,) [m^2] that rise with the square of
    the distance from their middle to the height [m] of the farthest; of a height < 0 they fall to 0
    there."""
    share = np.sum((points - area @ points / area.sum()) ** 2, axis=1)
    share /= share.max(initial=1e-300)
    return height * (share if height > 0 else share - 1)


def floats(K, T: csr_matrix) -> bool:
    """True where a motion of all bodies along an axis strains nothing; K (n, n), T (ndof, n)."""
    for axis in range(3):
        u = np.zeros(T.shape[0])
        u[axis::3] = 1.0
        x = lsqr(T, u, atol=1e-12, btol=1e-12)[0]
        moves = np.linalg.norm(T @ x - u) < 1e-6 * np.linalg.norm(u)
        if moves and x @ (K @ x) < 1e-9 * (np.abs(x) @ (abs(K) @ np.abs(x))):
            return True
    return False


def pressure_stiffness(contact: PreloadedContact) -> csr_matrix:
    """K_G (ndof, ndof) [N/m] of the pressure, which turns with the first face: the second variation
    of -int p g with g = n . (x_2 - x_1), dn = -grad u_n - |grad u_n|^2 / 2 n. Without it faces that
    slide would buckle under the compression of the bodies."""
    facets, m = contact.facets, len(contact.pressure)
    P = diags_array(np.tile(contact.smooth_pressure * facets.area, 2))
    A = csr_matrix(facets.S.T @ P @ facets.C[m:])
    apart = P @ diags_array(np.tile(facets.gap, 2))
    return csr_matrix(A + A.T + facets.S.T @ apart @ facets.S)


def together(pairs: Sequence[FacingFacets]) -> FacingFacets:
    """The facets of all pairs."""
    C = vstack([pair.direction(i) for i in range(3) for pair in pairs]).tocsr()
    points, area, whole, gap = (np.concatenate([pair[i] for pair in pairs]) for i in range(4))
    S = vstack([p.S[i * len(p.area) : (i + 1) * len(p.area)] for i in range(2) for p in pairs])
    axes = np.concatenate([pair.axes for pair in pairs])
    number = np.repeat(np.arange(len(pairs)), [len(pair.area) for pair in pairs])
    return FacingFacets(points, area, whole, gap, C, S.tocsr(), axes, number)
