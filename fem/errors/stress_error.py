"""Error of elements that are too large, from the forces that they leave unbalanced.

Displacements u_j (modes, static shapes) with K u_j = sum_i M u_i D_ij + forces on faces are too
stiff. In each element e the error is sought in functions b that the element lacks, of the next
order, which balance what the stresses s of u leave there (Bank and Weiser, Math. Comp. 44 (1985)
283; Ainsworth and Oden, A Posteriori Error Estimation (2000), chapter 3):

    r_bj = int_e rho b . u_i D_ij - int_e eps(b) : s_j + int_de b . t_j
    k_bc = int_e eps(b) : C : eps(c)
    G_ij = sum_e r_i^T k^-1 r_j
    omega_j^2 is too high by G_jj,  w^T K^-1 w too low by G of u = K^-1 w

t is a mean of the tractions t_1 and t_2 of the two elements at a facet, of two bodies' where these
are tied, and zero on faces that bear nothing. Each element takes a share of the jump t_2 - t_1 in
proportion to its stiffness times its height h over the facet, which makes the sum of energies,
share^2 / h, least: with a half each, slivers of 4 um next to elements of 6 mm made a frequency's
error 34 times too large in the median, with these shares 5. On faces that are bolted or pushed t is
the element's own. Functions b vanish where a face is held or moves as a rigid one.

Of a smooth field G is the whole energy missed; of a singular one, h^(2 lambda), functions of the
next order hold only a part 1 - (2/3)^(4 lambda) of it, 0.6 to 0.7 at held edges and inner corners.
Measured of frequencies of boxes, profiles, tubes and tied bodies: 0.6 to 1.05, at any size of the
elements.

An element misses no more than it and its neighbours at its facets hold. A sliver has functions that
move both its large facets alike, of a stiffness that falls with its thickness, and what is not
balanced at one of them is balanced by them alone: eight slivers of 0.09 mm by 4 mm, between rims of
washers and edges of a wall, stated 41 % of a frequency that was 5 % too high, each a thousand times
the strain energy that it held; with this bound 14 % are stated.

Of hexahedra the energy is parted among their axes. Where they are too long along X stresses jump
across the facets that end X, so that

    G_X : G_Y : G_Z = J_X : J_Y : J_Z,    J_X = sum h int |t_2 - t_1|^2 over the facets that end X

(of discontinuous elements: Leicht and Hartmann, Int. J. Numer. Meth. Fluids 56 (2008) 2111). In
elements at faces whose traction is not known, held or bearing, the shares are those of the
functions. Those of the functions in all elements gave 24 % of the energy to the layers along the
inner edge of an L, although twice as many of these layers lower the error by 1 % only.
"""

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, Element, Mesh, MeshHex

from beadwave.fem.assembly.elasticity import ELEMENTS, element_stiffness
from beadwave.fem.assembly.facet_rule import facet_rule
from beadwave.fem.assembly.joints import Tie, rigid_motion, tied_across
from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.assembly.model import HeldFace, Model
from beadwave.fem.assembly.trace import located
from beadwave.fem.contact.half_space import HalfSpaceField


class Pushed(NamedTuple):
    """Forces on m patches, and the half-spaces there, whose energies are taken off."""

    force: NDArray[np.float64]  # (k, m) [N] on each patch in each of the displacements
    half_space: HalfSpaceField  # under unit forces


class Faces(NamedTuple):
    """Faces that are not free of traction."""

    held: Sequence[HeldFace] = ()  # held, or moving as rigid ones
    bearing: Collection[str] = ()  # "body:face" with an unknown traction: bolted, pushed
    ties: Sequence[Tie] = ()


class MissedEnergy(NamedTuple):
    """The strain energy that elements miss, in all and where."""

    of_bodies: dict[str, NDArray[np.float64]]  # (k, k) [J] by body
    of_cells: dict[str, NDArray[np.float64]]  # (cells, k) [J] by body, whose sum is G's diagonal
    # (cells, 3, k) [J] of it along X, Y and Z of each hexahedron, by body
    of_axes: dict[str, NDArray[np.float64]]

    @property
    def G(self) -> NDArray[np.float64]:  # noqa: N802  the symbol of the literature
        """Of all bodies (k, k) [J]."""
        return sum(self.of_bodies.values())


CHUNK = 1000  # elements or facets that are computed at a time, 100 MB of 60 shapes
# length over thickness of hexahedra from which on functions along them are orthogonal to
# constants and slopes. With such functions in all hexahedra errors of tubes were stated at 0.3
# of their value without any
SLENDER_RATIO = 5.0
# share of each axis in the functions that hexahedra lack: cubes along one axis, products of two and
# of three parabolas. For elements at faces whose traction is not known
ALONG = np.concatenate(
    [np.tile(np.eye(3), (4, 1)), np.tile((1 - np.eye(3)) / 2, (2, 1)), np.full((1, 3), 1 / 3)]
)
HELD_STIFFNESS = 1e8  # times its own stiffness: a function that is zero on a held face


def missed_energy(
    model: Model,
    materials: Mapping[str, Material | Orthotropic],
    u: NDArray[np.float64],
    D: NDArray[np.float64],
    faces: Faces = Faces(),
    *,
    pushed: Pushed | None = None,
) -> MissedEnergy:
    """G (k, k) [J] of displacements u (n, k) of a model's free dofs.

    D (k, k) [rad^2/s^2] are the inertia forces M u D that hold u in addition to those on faces; of
    modes diag(omega^2). In elements around patches that are pushed, what counts is the error of the
    difference to the half-spaces.

    Body by body: residuals r (cells, functions, 3, m) of all functions that its elements lack are
    gathered from tractions at facets, at ties and at the half-space's end, then from inertia and
    stresses inside, and each element is solved for by itself, G = sum r^T k^-1 r. Residuals are in
    single precision, which halves their memory; elements are solved in double.
    """
    structure, k = model.structure, u.shape[1]
    of_bodies, of_cells, of_axes = {}, {}, {}
    for body, basis in structure.basis.items():
        mesh, material = basis.mesh, materials[body]
        element, C, order = element_of(mesh), stiffness_of(material), 4 + isinstance(mesh, MeshHex)
        field = pushed.half_space if pushed is not None and pushed.half_space.body == body else None

        # apart from the body's rigid motion R q, whose rounding in single precision would strain a
        # body on soft springs more than these do
        nodes = structure.points[structure.dofs(body)[0::3] // 3]
        R = rigid_motion(nodes, nodes.mean(axis=0)) / np.array([1.0] * 3 + [np.ptp(nodes)] * 3)
        of_body = model.T[structure.dofs(body)] @ u
        q = np.linalg.solve(R.T @ R, R.T @ of_body)
        local, rigid = at_elements(basis, of_body - R @ q), at_elements(basis, R)
        if field is not None:  # as further displacements
            half_space = np.zeros((basis.N, field.u.shape[1]))
            half_space[field.dofs - structure.first[body]] = field.u
            local = np.concatenate([local, at_elements(basis, half_space)], axis=3)
        m = local.shape[3]
        inertia_of, rigid_inertia = np.zeros((m, m), np.float32), np.zeros((6, m), np.float32)
        inertia_of[:k, :k], rigid_inertia[:, :k] = D, q @ D
        n_cells, n = local.shape[:2]
        n_lacking = 19 if isinstance(mesh, MeshHex) else 10
        residual = np.zeros((n_cells, n_lacking, 3, m), np.float32)

        # functions that would move a held face
        still = np.zeros((n_cells, n_lacking, 3), bool)
        vanish = np.full((3, n_cells), 3, np.int8)  # at X = 0 (1), at X = 1 (2), at both (3)
        if isinstance(mesh, MeshHex):
            corners, at_1 = mesh.p[:, mesh.t], mesh.elem().refdom.p > 0.5
            along = [corners[:, end].mean(axis=1) - corners[:, ~end].mean(axis=1) for end in at_1]
            length = np.linalg.norm(along, axis=1)
            vanish[length > SLENDER_RATIO * length.min(axis=0)] = 0
        held_facets = [np.empty(0, int)]
        for face in faces.held:
            if face.face.partition(":")[0] == body:
                held_facets.append(structure.facets(face.face)[1])
                side = FacetSide.of(mesh, held_facets[-1], 0, order)
                across = side.ended  # the face in local coordinates
                at_1 = side.X[across, np.arange(len(across)), 0] > 0.5
                np.bitwise_or.at(vanish, (across, side.cells), 1 + at_1.astype(np.int8))
                moves = np.abs(side.lacking(vanish)).max(axis=2).T > 1e-6
                for axis in map("xyz".index, face.directions):
                    np.logical_or.at(still[..., axis], side.cells, moves.T)

        # tractions at facets: of both sides where two elements meet, of one where something bears
        names = [name.partition(":")[2] for name in faces.bearing if name.partition(":")[0] == body]
        named = [np.asarray((mesh.boundaries or {}).get(name, ()), int) for name in names]
        inside = np.flatnonzero(mesh.f2t[1] >= 0)
        bears = np.unique(np.concatenate([np.empty(0, int), *named]))
        ends = np.empty(0, int) if field is None else field.ends
        for facets, signs in ((inside, (1, -1)), (bears, (1,))):
            for some in shares(facets, CHUNK):
                sides = [FacetSide.of(mesh, some, side, order) for side in range(len(signs))]
                # out of side 0: the jump is shared in proportion to the heights, and what acts on
                # side 1 is the opposite force
                t = sides[0].traction(element, C, local)
                if len(sides) == 2:
                    share = sides[0].height / (sides[0].height + sides[1].height)
                    t += share[:, None, None] * (sides[1].traction(element, C, local) - t)
                t.reshape(*t.shape[:2], 3, m)[np.isin(some, ends), :, :, k:] = 0.0
                for sign, side in zip(signs, sides, strict=True):
                    b = side.lacking(vanish)
                    np.add.at(residual, side.cells, sign * (b @ t).reshape(len(b), -1, 3, m))

        # jumps of stresses along each axis: near patches those of the difference, as far as the
        # half-spaces go
        jumps, at_unknown = np.zeros((n_cells, 3, k)), np.zeros(n_cells, bool)
        if isinstance(mesh, MeshHex):
            unknown = np.concatenate([bears, *held_facets])
            at_unknown[mesh.f2t[0, unknown]] = True
            of_pairs = [face for pair in faces.ties for face in (pair.slave, pair.master)]
            tied = [structure.facets(f)[1] for f in of_pairs if f.partition(":")[0] == body]
            others = np.concatenate([unknown, ends, *tied])
            u_near = local[..., :k].copy()
            if field is not None:
                force = pushed.force.T.astype(np.float32)
                u_near[field.cells] -= local[field.cells][..., k:] @ force
                jumps += squared_jumps(mesh, element, C, local[..., :k], order, ends)
            facets = np.setdiff1d(np.arange(mesh.nfacets), others)
            jumps += squared_jumps(mesh, element, C, u_near, order, facets)

        # on a face that is tied the mean of both bodies' tractions, at points of this one; where it
        # does not meet the other, its own
        for pair in faces.ties:
            for face, opposite in ((pair.slave, pair.master), (pair.master, pair.slave)):
                if face.partition(":")[0] != body:
                    continue
                partner, facets = opposite.partition(":")[0], structure.facets(face)[1]
                across = structure.basis[partner]
                u_across = at_elements(across, model.T[structure.dofs(partner)] @ u)
                of_partner = element_of(across.mesh), stiffness_of(materials[partner])
                beyond = FacetSide.of(across.mesh, structure.facets(opposite)[1], 0, order)
                kh_across = np.zeros(across.nelems)
                kh_across[beyond.cells] = np.trace(of_partner[1]) * beyond.height
                gap = tied_across(structure, pair)
                for some in shares(facets, CHUNK):
                    # this body's points in the partner's elements; stiffness times height of both
                    # says how they share the jump, as between elements of one body
                    side = FacetSide.of(mesh, some, 0, order)
                    t = side.traction(element, C, local[..., :k])
                    points = mesh.mapping().F(side.X, tind=side.cells).reshape(3, -1).T
                    place = located(structure, opposite, points, gap=gap)
                    meets = np.flatnonzero(place.distance <= gap)
                    area = side.area.reshape(3, -1, 1)[:, meets]
                    cells, X = place.cells[meets], place.X[:, meets, None]
                    beyond = FacetSide(across.mesh, cells, X, area)
                    mean = t.reshape(len(points), -1)
                    jump = np.zeros_like(mean)
                    kh = np.repeat(np.trace(C) * side.height, side.X.shape[2])[meets]
                    share = kh / (kh + kh_across[cells])
                    t_across = beyond.traction(*of_partner, u_across)[:, 0]
                    jump[meets] = t_across - mean[meets]
                    mean[meets] += share[:, None] * jump[meets]
                    if isinstance(mesh, MeshHex):
                        squares = side.squares(jump.reshape(t.shape))
                        np.add.at(jumps, (side.cells, side.ended), squares)
                    b = side.lacking(vanish)
                    moments = (b @ mean.reshape(t.shape)).reshape(len(b), -1, 3, k)
                    np.add.at(residual[..., :k], side.cells, moments)

        for sign, i in ((1, 0), (-1, 1)):  # of the half-space, where it ends, its own
            if field is not None and len(some := ends[np.isin(mesh.f2t[i, ends], field.cells)]):
                side = FacetSide.of(mesh, some, i, order)
                t = side.traction(element, C, local[..., k:])
                b = side.lacking(vanish)
                moments = sign * (b @ t).reshape(len(b), -1, 3, m - k)
                np.add.at(residual[..., k:], side.cells, moments)

        G, of_cells[body] = np.zeros((k, k)), np.zeros((n_cells, k))
        if isinstance(mesh, MeshHex):
            of_axes[body] = np.zeros((n_cells, 3, k))
        strained = with_neighbours(mesh, strain_energy(mesh, element, C, local[..., :k]))

        # what inertia and stresses leave inside the elements, and the errors that balance it all
        for cells in shares(np.arange(n_cells), CHUNK):
            at = Basis(mesh, element, intorder=order, elements=cells)
            phi = np.stack([np.broadcast_to(np.asarray(f[0]), at.dx.shape) for f in at.basis])
            gradient = np.stack([f[0].grad for f in at.basis])
            X = np.broadcast_to(at.X[:, None], (3, *at.dx.shape))

            # r = int rho b . u D - int eps(b) : s + tractions; near a patch the half-space's own r
            # is taken off, and what is left is the error of the difference
            b, db = lacking_functions(mesh, X, vanish[:, cells])
            db = np.einsum("dcep,bdep->bcep", at.mapping.invDF(at.X, tind=cells), db)
            K = element_stiffness(db, gradient, at.dx, C).astype(np.float32)
            M = (material.density * b * at.dx).transpose(1, 0, 2) @ phi.transpose(1, 2, 0)
            u_e = local[cells]
            accelerated = u_e @ inertia_of + rigid[cells] @ rigid_inertia
            inertia = M.astype(np.float32) @ accelerated.reshape(len(cells), n, 3 * m)
            r = residual[cells] + inertia.reshape(len(cells), -1, 3, m)
            r -= (K @ u_e.reshape(len(cells), 3 * n, m)).reshape(r.shape)
            if field is not None:
                near = np.isin(cells, field.cells)
                r[near, :, :, :k] -= r[near, :, :, k:] @ pushed.force.T.astype(np.float32)
            r = r[..., :k].reshape(len(cells), -1, k).astype(np.float64)

            # k^-1 r element by element; a function that would move a held face is made so stiff
            # that it stays
            stiffness = element_stiffness(db, db, at.dx, C)
            diagonal = np.einsum("eii->ei", stiffness)
            diagonal[still[cells].reshape(len(cells), -1)] *= HELD_STIFFNESS
            error = np.linalg.solve(stiffness, r)
            missed = np.sum(r * error, axis=1)
            of_cells[body][cells] = np.clip(missed, 0.0, strained[cells])
            part = np.sqrt(of_cells[body][cells] / np.maximum(missed, 1e-300))[:, None]
            if isinstance(mesh, MeshHex):
                of_function = (part**2 * r * error).reshape(len(cells), -1, 3, k).sum(axis=2)
                by_function = np.einsum("fa,efk->eak", ALONG, of_function)
                share = jumps[cells] / np.maximum(jumps[cells].sum(axis=1, keepdims=True), 1e-300)
                by_jumps = of_cells[body][cells][:, None] * share
                whose = at_unknown[cells][:, None, None]
                of_axes[body][cells] = np.where(whose, by_function, by_jumps)
            G += (part * r).reshape(-1, k).T @ (part * error).reshape(-1, k)
        of_bodies[body] = (G + G.T) / 2
    return MissedEnergy(of_bodies, of_cells, of_axes)


def squared_jumps(
    mesh: MeshHex,
    element: Element,
    C: NDArray[np.float64],
    u: NDArray[np.float32],
    order: int,
    facets: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Squares (cells, 3, k) of what the stresses of displacements u (cell, function, x y z, k) jump
    by across those of the facets (m,) that end X, Y and Z of each element, times its length along
    them. Outer facets are free."""
    jumps = np.zeros((mesh.nelements, 3, u.shape[3]))
    inside = mesh.f2t[1, facets] >= 0
    for alike, n_sides in ((facets[inside], 2), (facets[~inside], 1)):
        for some in shares(alike, CHUNK):
            sides = [FacetSide.of(mesh, some, side, order) for side in range(n_sides)]
            t = [side.traction(element, C, u) for side in sides]
            jump = t[1] - t[0] if n_sides == 2 else t[0]
            for side in sides:
                np.add.at(jumps, (side.cells, side.ended), side.squares(jump))
    return jumps


def strain_energy(
    mesh: Mesh, element: Element, C: NDArray[np.float64], u: NDArray[np.float32]
) -> NDArray[np.float64]:
    """u^T k u (cells, k) [J] of displacements u (cell, function, x y z, k) in each element: twice
    its strain energy."""
    energy = np.empty((len(u), u.shape[3]))
    for cells in shares(np.arange(len(u)), CHUNK):
        at = Basis(mesh, element, intorder=2, elements=cells)
        gradient = np.stack([f[0].grad for f in at.basis])
        stiffness = element_stiffness(gradient, gradient, at.dx, C).astype(np.float32)
        u_e = u[cells].reshape(len(cells), -1, u.shape[3])
        energy[cells] = np.sum(u_e * (stiffness @ u_e), axis=1)
    return energy


def with_neighbours(mesh: Mesh, energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """The energies (cells, k) of each element and of those that it shares a facet with."""
    first, second = mesh.f2t[:, mesh.f2t[1] >= 0]
    energy = np.maximum(energy, 0.0)  # rounding, of a part that hardly strains
    whole = energy.copy()
    np.add.at(whole, first, energy[second])
    np.add.at(whole, second, energy[first])
    return whole


def element_of(mesh: Mesh) -> Element:
    """The quadratic element of a mesh's cells."""
    return next(choice[0] for kind, choice in ELEMENTS.items() if isinstance(mesh, kind))


def stiffness_of(material: Material | Orthotropic) -> NDArray[np.float64]:
    """C (9, 9) [Pa] from (c, d) to (a, b), as `element_stiffness` takes it."""
    return material.elasticity.transpose(1, 3, 0, 2).reshape(9, 9)


def at_elements(basis: Basis, u: NDArray[np.float64]) -> NDArray[np.float32]:
    """Displacements u (n, k) of a body's dofs in its elements, (cell, function, x y z, k); in
    single precision."""
    return u.astype(np.float32).reshape(len(u) // 3, 3, -1)[basis.element_dofs[0::3].T // 3]


def shares(numbers: NDArray[np.int64], size: int) -> list[NDArray[np.int64]]:
    """The numbers (n,) in shares of at most so many; none of no numbers."""
    return [numbers[first : first + size] for first in range(0, len(numbers), size)]


class FacetSide(NamedTuple):
    """Facets as the elements on one side of them see them."""

    mesh: Mesh
    cells: NDArray[np.int64]  # (m,) the elements
    X: NDArray[np.float64]  # (3, m, points) of a rule, in their coordinates
    area: NDArray[np.float64]  # (3, m, points) [m^2] times the rule's weights, out of side 0

    @property
    def height(self) -> NDArray[np.float64]:
        """Of the elements (m,) [m] over their facets: volume over area, of tetrahedra three times
        as much."""
        X = self.mesh.elem().refdom.p.mean(axis=1)[:, None]
        volume = np.abs(self.mesh.mapping().detDF(X, tind=self.cells))[:, 0]
        area = np.linalg.norm(self.area.sum(axis=2), axis=0)
        return volume / area if isinstance(self.mesh, MeshHex) else volume / (2 * area)

    @property
    def ended(self) -> NDArray[np.int64]:
        """Axis (m,) of hexahedra along which the facet is an end."""
        return np.ptp(self.X, axis=2).argmin(axis=0)

    def squares(self, t: NDArray[np.float32]) -> NDArray[np.float64]:
        """Integrals (m, k) of the squares of stresses over the facets, times the elements' heights;
        t (m, points, 3 k) is stress times area."""
        area = np.linalg.norm(self.area, axis=0)  # (m, points)
        t = t.reshape(*area.shape, 3, -1).astype(np.float64)
        return self.height[:, None] * np.einsum("mpak,mp->mk", t**2, 1 / area)

    @classmethod
    def of(cls, mesh: Mesh, facets: NDArray[np.int64], side: int, order: int) -> "FacetSide":
        """Side 0 or 1 of facets, with a rule that is exact up to the order."""
        return cls(mesh, *facet_rule(mesh, facets, order, side))

    def lacking(self, vanish: NDArray[np.int8]) -> NDArray[np.float32]:
        """The functions (m, b, points) that the elements lack, of which (3, cells) end at a face
        that is held, along X, Y and Z."""
        b = lacking_functions(self.mesh, self.X, vanish[:, self.cells])[0]
        return b.transpose(1, 0, 2).astype(np.float32)

    def traction(
        self, element: Element, C: NDArray[np.float64], u: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Stress times area (m, points, 3 k) [N] of displacements u (cell, function, x y z, k)."""
        n = u.shape[1]
        inverse = self.mesh.mapping().invDF(self.X, tind=self.cells)  # (along X, along x, m, point)
        slopes = np.stack([element.lbasis(self.X, i)[1] for i in range(n)], axis=-1)
        gradient = np.einsum("dcmp,dmpi->mpci", inverse, slopes)
        m, n_points = gradient.shape[:2]
        local = u[self.cells].reshape(m, n, -1)
        H = gradient.reshape(m, -1, n).astype(np.float32) @ local  # d_d u_b at (point d), (b k)
        H = H.reshape(m, n_points, 3, 3, -1).transpose(0, 1, 3, 2, 4).reshape(m, n_points, 9, -1)
        # C from (c, d) to (a, b) holds C_acbd: s_ac n_c = C_acbd n_c d_d u_b
        A = np.einsum("cdab,cmp->mpabd", C.reshape(3, 3, 3, 3), self.area)
        return (A.reshape(m, n_points, 3, 9).astype(np.float32) @ H).reshape(m, n_points, -1)


def lacking_functions(
    mesh: Mesh, X: NDArray[np.float64], vanish: NDArray[np.int8]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Functions (b, ...) of the next order that quadratic elements lack, at X (3, m, points) in
    elements, and their gradients (b, 3, m, points).

    In tetrahedra 10 cubes: one of each edge, one of each face. In hexahedra 19: a cube along each
    edge, and products of two and of three parabolas, which the 20 nodes lack. `vanish` (3, m) says
    at which ends of the element along X, Y and Z these cubes and parabolas are zero: at X = 0 (1),
    at X = 1 (2), at both (3), at none (0).

    Tractions of neighbours differ by constants and slopes, which the elements' own functions
    balance together. Functions that vanish at both ends would take these differences for an error
    in slender elements; those for no end are orthogonal to constants and slopes, those for one end
    to what else vanishes there. Of `rig-rom`, whose elements are twenty times as long as thick at
    its edges, functions that vanish at both ends stated twice as much.
    """
    one = np.ones_like(X[0])
    if isinstance(mesh, MeshHex):
        x = 2 * X - 1
        lines = [((1 - x) / 2, -one), ((1 + x) / 2, one)]
        lines = [[(value[i], slope) for i in range(3)] for value, slope in lines]
        # Legendre's polynomials, Jacobi's from a held end, parabola and cube between two of them
        square, cube = [], []
        for i in range(3):
            end = vanish[i][:, None]
            sign = np.where(end == 2, -1.0, 1.0)
            r = np.where(end == 2, 1 - X[i], X[i])
            kinds = [end == 0, end == 3]
            squares = [1 / 3 - x[i] ** 2, 1 - x[i] ** 2], [-4 * x[i], -4 * x[i]]
            cubes = (
                [x[i] * (3 / 5 - x[i] ** 2), x[i] * (1 - x[i] ** 2)],
                [6 / 5 - 6 * x[i] ** 2, 2 - 6 * x[i] ** 2],
            )
            value = np.select(kinds, squares[0], r - 4 / 3 * r**2)
            square.append((value, np.select(kinds, squares[1], sign * (1 - 8 / 3 * r))))
            value = np.select(kinds, cubes[0], r - 10 / 3 * r**2 + 5 / 2 * r**3)
            slope = sign * (1 - 20 / 3 * r + 15 / 2 * r**2)
            cube.append((value, np.select(kinds, cubes[1], slope)))

        # a cube along one axis times lines along the two others (12), two parabolas times a line
        # (6), three parabolas (1); values and gradients by the product rule
        along = [(cube, first, second) for first in lines for second in lines]
        across = [(one_line, square, square) for one_line in lines]
        axes = [(i, *(j for j in range(3) if j != i)) for i in range(3)]
        products = [
            {axis: factors[axis] for axis, factors in zip(turned, chosen, strict=True)}
            for chosen in (*along, *across)
            for turned in axes
        ]
        products.append(dict(enumerate(square)))
        values = [f[0][0] * f[1][0] * f[2][0] for f in products]
        slopes = [
            [
                f[0][1] * f[1][0] * f[2][0],
                f[0][0] * f[1][1] * f[2][0],
                f[0][0] * f[1][0] * f[2][1],
            ]
            for f in products
        ]
        return np.stack(values), np.stack([np.stack(slope) for slope in slopes])

    # barycentric coordinates L of a tetrahedron: L_i L_j (L_i - L_j) of each edge, the cube that is
    # zero at its three nodes, and L_i L_j L_k of each face
    L = [1 - X.sum(axis=0), *X]
    dL = [
        np.stack([c * one for c in row]) for row in ((-1, -1, -1), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    ]
    values, slopes = [], []
    for i, j in combinations(range(4), 2):
        values.append(L[i] * L[j] * (L[i] - L[j]))
        slopes.append(dL[i] * L[j] * (2 * L[i] - L[j]) + dL[j] * L[i] * (L[i] - 2 * L[j]))
    for i, j, k in combinations(range(4), 3):
        values.append(L[i] * L[j] * L[k])
        slopes.append(dL[i] * L[j] * L[k] + L[i] * dL[j] * L[k] + L[i] * L[j] * dL[k])
    return np.stack(values), np.stack(slopes)
