"""What elements that are too large leave of error, read off the stresses of displacements on them.

Displacements u_i (modes, static shapes) on a mesh are too stiff. The strain energy that they miss
is that of the difference between the stresses of the exact solution and theirs; recovered stresses
s* stand for the exact ones (Zienkiewicz and Zhu, Int. J. Numer. Meth. Engng 33 (1992) 1331):

    G_ij = int (s*_i - s_i) : C^-1 : (s*_j - s_j) dV
    omega_j^2 is too high by G_jj,  w^T K^-1 w too low by G of u = K^-1 w

s* is quadratic in every element, continuous within a body. At a corner of elements it is the value
of a polynomial of second degree fitted to the stresses of the elements around, at their
superconvergent points; at the middle of an edge the mean of those of its ends. On faces that bear
nothing its traction is zero, which alone tells the shear in a plate of one element through its
thickness: without it the errors of its frequencies came out half as large as they are. At an inner
edge the stress is singular, its traction free to be anything.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from skfem import Basis, ElementHexS2, ElementTetP2, Mesh, MeshHex

from fem.materials import Material, Orthotropic
from fem.model import Model

VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
TENSOR = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])  # where VOIGT has a component
GAUSS = 0.5 - 0.5 / 3**0.5, 0.5 + 0.5 / 3**0.5
INNER, OUTER = 0.13819660112501053, 0.5854101966249685  # of the four points in a tetrahedron


class RecoveryOptions(NamedTuple):
    """How stresses are recovered from those of the elements around a corner."""

    # elements around a corner from which a fit to these alone determines its slopes; of fewer the
    # neighbours of these count too
    hexahedra: int = 4
    tetrahedra: int = 10
    # weight of the curvatures in a fit, of the largest distance: at a boundary, where few elements
    # lie one behind another, a fit without it extrapolates noise. Errors of an L profile were 100
    # times too large with 0.01 and the same within 5 % from 0.1 to 0.3
    damping: float = 0.15
    plane: float = 0.95  # cosine of the angle between facets that count as one plane
    concave: float = 0.05  # sine of the angle by which facets must rise to make an inner edge
    at_once: int = 1000  # elements whose stresses are held at a time, 100 MB of 60 shapes


def missed_energy(
    model: Model,
    materials: Mapping[str, Material | Orthotropic],
    u: NDArray[np.float64],
    loaded: Collection[str] = (),
    *,
    without: tuple[NDArray[np.float64], float] | None = None,
    options: RecoveryOptions = RecoveryOptions(),
) -> NDArray[np.float64]:
    """G (k, k) [J] of displacements u (n, k) of a model's free dofs.

    `loaded` are the faces "body:face" that bear something: held, tied, bolted, pushed. `without` is
    a point [m] and a distance [m] within which elements do not count.
    """
    structure, k = model.structure, u.shape[1]
    G = np.zeros((k, k))
    for body, basis in structure.basis.items():
        mesh = basis.mesh
        element, points = (
            (ElementHexS2(), np.array(np.meshgrid(GAUSS, GAUSS, GAUSS)).reshape(3, -1))
            if isinstance(mesh, MeshHex)
            else (
                ElementTetP2(),
                np.column_stack([np.full(3, INNER), INNER + (OUTER - INNER) * np.eye(3)]),
            )
        )
        C = np.array([[materials[body].elasticity[a + b] for b in VOIGT] for a in VOIGT])

        # displacements (dofs of a cell, x y z, cell, k) and the stresses that they make
        at_dofs = (model.T[structure.dofs(body)] @ u).astype(np.float32)
        at_nodes = at_dofs.reshape(-1, 3, k)
        nodes = basis.element_dofs[0::3] // 3

        def stress(cells, rule, nodes=nodes, at_nodes=at_nodes, C=C, mesh=mesh, element=element):
            """(6, cells, points, k) at the points of a rule, and the shape functions' basis."""
            at = Basis(mesh, element, quadrature=rule, elements=cells)
            gradient = np.stack([phi[0].grad for phi in at.basis]).astype(np.float32)
            n, _, n_cells, n_points = gradient.shape
            B = gradient.transpose(2, 3, 1, 0).reshape(n_cells, n_points * 3, n)
            local = at_nodes[nodes[:, cells].T].reshape(n_cells, n, 3 * k)
            H = (B @ local).reshape(n_cells, n_points, 3, 3, k)  # d_c u_a at (c, a)
            strain = np.stack(
                [H[:, :, a, b] if a == b else H[:, :, a, b] + H[:, :, b, a] for a, b in VOIGT]
            )
            return np.tensordot(C.astype(np.float32), strain, 1), at

        # stresses at the superconvergent points, then the polynomials around each corner
        n_samples = points.shape[1]
        rule = points, np.full(n_samples, 1 / n_samples)
        shares = np.array_split(np.arange(mesh.nelements), -(-mesh.nelements // options.at_once))
        sampled = np.concatenate([stress(cells, rule)[0] for cells in shares], axis=1)
        x = np.asarray(Basis(mesh, element, quadrature=rule).global_coordinates())
        s = sampled.transpose(1, 2, 0, 3).reshape(mesh.nelements * n_samples, 6 * k)
        recovered = recovered_stresses(mesh, x, s, options).reshape(-1, 6, k)

        # no traction where nothing is borne
        names = [name.partition(":")[2] for name in loaded if name.partition(":")[0] == body]
        bearing = [np.asarray((mesh.boundaries or {}).get(name, ()), int) for name in names]
        free_of_traction(mesh, recovered, np.concatenate([np.empty(0, int), *bearing]), options)

        # the energy of the difference, by a rule that is exact for it in straight elements
        order = 5 if isinstance(mesh, MeshHex) else 4
        fine = Basis(mesh, element, intorder=order, elements=[0]).quadrature
        scalar = Basis(mesh, element, intorder=1)
        row = np.empty(scalar.N, int)  # of a dof of the shape functions among corners and edges
        row[np.concatenate([scalar.nodal_dofs[0], scalar.edge_dofs[0]])] = np.arange(scalar.N)
        centre = mesh.p[:, mesh.t].mean(axis=1)
        for cells in shares:
            if without is not None:
                point, distance = without
                cells = cells[np.linalg.norm(centre[:, cells].T - point, axis=1) > distance]
            if not len(cells):
                continue
            difference, at = stress(cells, fine)
            N = np.stack([np.broadcast_to(np.asarray(p[0]), at.dx.shape) for p in at.basis])
            local = recovered[row[scalar.element_dofs[:, cells].T]].reshape(len(cells), len(N), -1)
            exact = N.transpose(1, 2, 0).astype(np.float32) @ local
            difference -= exact.reshape(*at.dx.shape, 6, k).transpose(2, 0, 1, 3)
            L = np.linalg.cholesky(np.linalg.inv(C)).astype(np.float32)  # C^-1 = L L^T
            D = np.tensordot(L.T, difference, 1)
            weighted = D * at.dx[:, :, None].astype(np.float32)  # rules of tetrahedra: some below 0
            G += weighted.reshape(-1, k).T @ D.reshape(-1, k)
    return G


def recovered_stresses(
    mesh: Mesh, x: NDArray[np.float64], s: NDArray[np.float32], options: RecoveryOptions
) -> NDArray[np.float32]:
    """Values (corners + edges, m) of the polynomials fitted to s (cells * points, m) at x
    (3, cells, points)."""
    n_cells, n_points = x.shape[1:]
    cells = np.tile(np.arange(n_cells), len(mesh.t))
    ones = np.ones(mesh.t.size, np.int32)
    around = csr_matrix((ones, (mesh.t.ravel(), cells)), shape=(mesh.nvertices, n_cells))
    neighbours = (around @ around.T @ around).tocsr()
    fewest = options.hexahedra if isinstance(mesh, MeshHex) else options.tetrahedra
    few = np.diff(around.indptr) < fewest
    n_around = np.where(few, np.diff(neighbours.indptr), np.diff(around.indptr))
    where = x.reshape(3, -1).T

    # a polynomial a_0 + a_i y_i + a_ij y_i y_j about the mean of the points, y in their deviations,
    # its curvatures damped: of one layer of elements they are zero through the thickness
    middle, scale = np.empty((2, mesh.nvertices, 3))
    mean = np.empty((mesh.nvertices, 6))
    a = np.empty((mesh.nvertices, 10, s.shape[1]), np.float32)
    damped = np.diag([0.0, *3 * [1e-6], *6 * [options.damping**2]])
    for n in np.unique(n_around):
        for matrix, chosen in ((around, ~few), (neighbours, few)):
            corners = np.flatnonzero((n_around == n) & chosen)
            for at in np.array_split(corners, -(-len(corners) // 200)) if len(corners) else ():
                own = matrix.indices[matrix.indptr[at][:, None] + np.arange(n)]
                points = (own[:, :, None] * n_points + np.arange(n_points)).reshape(len(at), -1)
                y = where[points]
                middle[at], scale[at] = y.mean(axis=1), y.std(axis=1) + 1e-12
                A = _monomials((y - middle[at][:, None]) / scale[at][:, None])
                mean[at] = A[:, :, 4:].mean(axis=1)
                A[:, :, 4:] -= mean[at][:, None]
                At = A.transpose(0, 2, 1) / A.shape[1]
                fit = np.linalg.solve(At @ A + damped, At).astype(np.float32)
                a[at] = fit @ s[points]

    def value(corners: NDArray[np.int64], at: NDArray[np.float64]) -> NDArray[np.float32]:
        """Of the corners' polynomials at points (m, 3)."""
        B = _monomials((at - middle[corners]) / scale[corners])
        B[:, 4:] -= mean[corners]
        return np.einsum("nb,nbm->nm", B.astype(np.float32), a[corners], optimize=True)

    ends = mesh.edges
    halves = mesh.p[:, ends].mean(axis=1).T
    at_corners = value(np.arange(mesh.nvertices), mesh.p.T)
    return np.concatenate([at_corners, (value(ends[0], halves) + value(ends[1], halves)) / 2])


def _monomials(y: NDArray[np.float64]) -> NDArray[np.float64]:
    """1, y_i and y_i y_j (..., 10) of points (..., 3)."""
    products = [y[..., i] * y[..., j] for i, j in VOIGT]
    return np.stack([np.ones(y.shape[:-1]), *np.moveaxis(y, -1, 0), *products], axis=-1)


def free_of_traction(
    mesh: Mesh, s: NDArray[np.float32], bearing: NDArray[np.int64], options: RecoveryOptions
) -> None:
    """Take the traction from stresses s (corners + edges, 6, k) on all facets but the bearing ones,
    where they stand."""
    facets = np.setdiff1d(mesh.boundary_facets(), bearing)
    corners = mesh.facets[:, facets]
    p = mesh.p[:, corners]
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], axis=0)
    normal = (normal / np.linalg.norm(normal, axis=0)).T
    outward = p.mean(axis=1).T - mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1).T
    normal *= np.sign(np.sum(normal * outward, axis=1))[:, None]
    centre = p.mean(axis=1).T

    # corners and edges of each facet
    keys = np.sort(mesh.edges, axis=0).astype(np.int64)
    keys = keys[0] * mesh.nvertices + keys[1]
    order = np.argsort(keys)
    following = np.roll(corners, -1, axis=0)
    wanted = np.minimum(corners, following).astype(np.int64) * mesh.nvertices
    wanted += np.maximum(corners, following)
    edges = order[np.searchsorted(keys, wanted, sorter=order)]
    nodes = np.concatenate([corners, mesh.nvertices + edges])
    at = np.argsort(nodes.ravel(), kind="stable")
    node, facet = nodes.ravel()[at], np.tile(np.arange(len(facets)), len(nodes))[at]
    first = np.flatnonzero(np.diff(node, prepend=-1))

    # planes (node, normal) that meet at each node; none at an inner edge
    planes: list[list[tuple[int, NDArray]]] = [[], [], []]
    for i, group in zip(node[first], np.split(facet, first[1:]), strict=True):
        n, c = normal[group], centre[group]
        apart = c[None] - c[:, None]
        rise = np.einsum("ijd,id->ij", apart, n) / (np.linalg.norm(apart, axis=2) + 1e-30)
        bent = np.abs(n @ n.T) < options.plane
        if np.any(bent & (rise > options.concave)):
            continue
        distinct: list[NDArray] = []
        for one in n:
            if all(abs(one @ other) < options.plane for other in distinct):
                distinct.append(one)
        for j, one in enumerate(distinct[:3]):
            planes[j].append((i, one))

    # s - n t^T - t n^T + n n^T (n . t), twice where planes meet at other than right angles
    for level in (planes[0], planes[1], planes[2]) * 2:
        if not level:
            continue
        rows, n = np.array([i for i, _ in level]), np.array([m for _, m in level], np.float32)
        tensor = s[rows][:, TENSOR]
        t = np.einsum("mabk,mb->mak", tensor, n)
        along = np.einsum("mak,ma->mk", t, n)
        tensor -= np.einsum("ma,mbk->mabk", n, t) + np.einsum("mak,mb->mabk", t, n)
        tensor += np.einsum("ma,mb,mk->mabk", n, n, along)
        s[rows] = np.stack([tensor[:, a, b] for a, b in VOIGT], axis=1)
