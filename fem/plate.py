"""A rectangular plate by Mindlin's theory, finite elements of high order on its middle plane.

    2 V = int D (t_x,x^2 + t_y,y^2 + 2 nu t_x,x t_y,y + (1 - nu) / 2 (t_x,y + t_y,x)^2)
            + kappa G h ((w,x - t_x)^2 + (w,y - t_y)^2) dA
    2 T = int rho h w_t^2 + rho h^3 / 12 (t_x,t^2 + t_y,t^2) dA

w is the deflection, t the turns of the normal, D = E h^3 / 12 (1 - nu^2), kappa = 5 / (6 - nu).
Forces in the plane N_x, N_y [N/m], even all over the plate and > 0 where they pull, add

    int N_x w,x^2 + N_y w,y^2 dA :

a hinged plate buckles where -(N_x m^2 + N_y n^2) = D k^4 / (1 + D k^2 / kappa G h) of a wave
k^2 = m^2 + n^2, a thin square one under N_x alone at 4 pi^2 D / a^2.
The shape functions are products of those of lines along x and y.

A point force deflects such a plate without bound, as (1 / (2 pi kappa G h)) ln(1 / b) under a disc
of radius b, and a solid without bound as 1 / b, the half-space that Hertz' law holds. A layer of
the solid under pressure of wave number k gives way by

    W = (1 - nu) / (2 G k) (sinh^2 x / (sinh x cosh x + x) + cosh^2 x / (sinh x cosh x - x)),

x = k h / 2; by 1 / (D k^4) + 6 (1 - nu) / (5 G h k^2) for small k, (1 - nu) / (G k) for large. The
theory's own, P^2 (1 / (D k^4) + 1 / (kappa G h k^2)) with P = 1 - (k b)^2 / 10 of Hertz' weights,
is the same for small k under a disc of

    (b / h)^2 = 5 / (6 kappa (1 - nu)) - 1,

0.6 thicknesses of steel. What it has too much at larger k is finite and taken off as `half_space`:
the compliance left is that of the solid less the half-space, whatever b.
Mindlin, J. Appl. Mech. 18 (1951) 31; kappa: Stephen, J. Sound Vib. 202 (1997) 539; the layer:
Sneddon, Fourier Transforms (1951), sec. 54.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.sparse import block_array, block_diag, csc_array, csr_matrix, diags_array, kron
from skfem import MeshHex

from fem.bending import ACROSS, DOWN, Bending, Buckled, load_factor, vertex_by_vertex
from fem.contact_patch import ContactPatch, disc_quadrature
from fem.line import Line, divided, line, wave_length
from fem.materials import Material
from fem.spot import Spot

ORDER = 6  # of the elements
RESOLVED_HZ = 10e3  # a wave of this frequency is as long as an element, and right to 1e-3
SMALLEST = 0.3  # thicknesses: the least radius of the disc, of materials with little poisson
AROUND = 2.0  # radii of the disc: size of the elements that are struck
MOST = 60_000  # unknowns: a minute and 2 GB
CELLS = 60  # along the longer side of the plate as it is drawn
HELD = {"hinged": (True, True, False), "clamped": (True, True, True), "free": (False,) * 3}


class Sheet(NamedTuple):
    """A plate's size and material."""

    length: float  # [m] along x
    width: float  # [m] along y
    thickness: float  # [m]
    material: Material
    shear_factor: float | None = None  # 5 / (6 - nu)

    @property
    def bending_stiffness(self) -> float:
        """D [N m]."""
        E, nu, _ = self.material
        return E * self.thickness**3 / (12 * (1 - nu**2))

    @property
    def kappa(self) -> float:
        """The shear factor."""
        return self.shear_factor or 5 / (6 - self.material.poisson)

    @property
    def shear_stiffness(self) -> float:
        """kappa G h [N/m]."""
        return self.kappa * self.material.lame[1] * self.thickness

    @property
    def patch_radius(self) -> float:
        """Of the disc that is struck [m]."""
        squared = 5 / (6 * self.kappa * (1 - self.material.poisson)) - 1
        return self.thickness * float(np.sqrt(max(squared, SMALLEST**2)))

    @property
    def inertia(self) -> tuple[float, float]:
        """rho h [kg/m^2] and rho h^3 / 12 [kg]."""
        rho = self.material.density
        return rho * self.thickness, rho * self.thickness**3 / 12


def mindlin_plate(
    sheet: Sheet,
    edges: tuple[str, str, str, str],
    at: tuple[float, float],
    *,
    in_plane: tuple[float, float] = (0.0, 0.0),
    coarser: float = 1.0,
) -> Bending:
    """A plate with edges "hinged", "clamped" or "free" at x = 0, x = length, y = 0, y = width,
    struck at x, y [m], under forces `in_plane` N_x, N_y [N/m].

    A hinged edge turns about itself alone. Elements are `coarser` times as long as usual.
    Raises Buckled for forces that press more than the plate can bear, TooLarge.
    """
    ends = _divided(sheet, at, coarser)
    _require_few(sheet, ends)
    along = tuple(line(one, ORDER) for one in ends)
    free = _free(along, sheet, edges)
    every = *_matrices(sheet, *along), _geometric(in_plane, *along)
    K, M, K_G = (csc_array(A.tocsc()[free][:, free]) for A in every)
    factor = _bearable(K, K_G, in_plane) if min(in_plane) < 0 else None
    one = np.kron(along[0].one, along[1].one)
    drawn, T = _drawn(sheet, *along)
    return Bending(
        csc_array(K + K_G) if any(in_plane) else K,
        M,
        T[:, free],
        drawn,
        _patch(sheet, along, at, free),
        M @ np.append(one, np.zeros(2 * len(one)))[free],
        sheet.inertia[0] * sheet.length * sheet.width,
        half_space=beyond_the_solid(sheet),
        load_factor=factor,
    )


class TooLarge(ValueError):
    """A plate of more wave lengths than there is memory for."""


def _count(ends: list[NDArray[np.float64]]) -> int:
    return int(3 * np.prod([ORDER * (len(one) - 1) + 1 for one in ends]))


def _divided(sheet: Sheet, at: tuple[float, float], coarser: float) -> list[NDArray[np.float64]]:
    """Ends of elements along x and y [m]."""
    longest = coarser * wave_length(
        2 * np.pi * RESOLVED_HZ, sheet.shear_stiffness, sheet.bending_stiffness, *sheet.inertia
    )
    around = coarser * AROUND * sheet.patch_radius
    return [_ends(side, x, around, longest) for side, x in zip(sheet[:2], at, strict=True)]


def _require_few(sheet: Sheet, ends: list[NDArray[np.float64]]) -> None:
    """Raise TooLarge."""
    n, longest = _count(ends), max(np.diff(one).max() for one in ends)
    if n > MOST:
        raise TooLarge(
            f"a plate of {sheet.length:g} x {sheet.width:g} x {sheet.thickness:g} m has {n:.2g} "
            f"unknowns with elements of {longest:.2g} m, as long as waves of {RESOLVED_HZ:g} Hz; "
            f"allowed are {MOST:g}: take a smaller or thicker one"
        )


def beyond_the_solid(sheet: Sheet) -> float:
    """Compliance [m/N] that the disc has more than a layer of the solid less its half-space."""
    nu, b = sheet.material.poisson, sheet.patch_radius / sheet.thickness

    def excess(k: float) -> float:
        theory = _hertz(k * b) ** 2 * (6 * (1 - nu) / k**3 + 1 / (sheet.kappa * k))
        return theory - (1 - nu) * _layer(k)

    start = 0.05  # below lies rounding, and a straight line
    parts = [quad(excess, *ends, limit=500)[0] for ends in ((start, 2.0), (2.0, 60 / b))]
    total = sum(parts) + start * excess(start)
    return float(total / (2 * np.pi * sheet.material.lame[1] * sheet.thickness))


def _hertz(x: float) -> float:
    """Hertz' pressure on a disc, transformed: 3 (sin x - x cos x) / x^3."""
    series = 1 - x**2 / 10 + x**4 / 280 - x**6 / 15120
    return series if x < 0.3 else 3 * (np.sin(x) - x * np.cos(x)) / x**3


def _layer(k: float) -> float:
    """G k W / (1 - nu) - 1 of a layer of thickness 1."""
    e = np.exp(-k)
    return ((1 - e) ** 2 / (1 - e**2 + 2 * k * e) + (1 + e) ** 2 / (1 - e**2 - 2 * k * e)) / 2 - 1


def _ends(side: float, x: float, around: float, longest: float) -> NDArray[np.float64]:
    """Ends of elements along a side [m], small ones where it is struck."""
    near = [p for p in (x - around, x, x + around) if 0.2 * around < p < side - 0.2 * around]
    return divided([0.0, *near, side], longest)


def _matrices(sheet: Sheet, x: Line, y: Line) -> tuple[csc_array, csc_array]:
    """K and M of w, t_x, t_y on all products of the functions."""
    D, S, nu = sheet.bending_stiffness, sheet.shear_stiffness, sheet.material.poisson
    shear = (1 - nu) / 2
    area = kron(x.mass, y.mass)
    bent = kron(x.slope, y.mass), kron(x.mass, y.slope)
    tilt = -S * kron(x.mixed, y.mass), -S * kron(x.mass, y.mixed)
    twist = D * (nu * kron(x.mixed.T, y.mixed) + shear * kron(x.mixed, y.mixed.T))
    K = block_array(
        [
            [S * (bent[0] + bent[1]), tilt[0].T, tilt[1].T],
            [tilt[0], D * (bent[0] + shear * bent[1]) + S * area, twist],
            [tilt[1], twist.T, D * (bent[1] + shear * bent[0]) + S * area],
        ]
    )
    m, j = sheet.inertia
    return K, block_array([[m * area, None, None], [None, j * area, None], [None, None, j * area]])


def _geometric(in_plane: tuple[float, float], x: Line, y: Line) -> csc_array:
    """K_G of forces in the plane, on the same unknowns."""
    N_x, N_y = in_plane
    bent = N_x * kron(x.slope, y.mass) + N_y * kron(x.mass, y.slope)
    turns = csr_matrix((2 * bent.shape[0],) * 2)
    return block_diag([bent, turns])


def _bearable(K: csc_array, K_G: csc_array, in_plane: tuple[float, float]) -> float:
    """The forces over those that buckle the plate in the same ratio; raises Buckled."""
    factor = load_factor(K, K_G)
    if factor >= 1:
        N_x, N_y = in_plane
        raise Buckled(
            f"forces in the plane of {N_x:.6g} N/m along x and {N_y:.6g} N/m along y are "
            f"{factor:.4g} times those that buckle it; take less"
        )
    return factor


def _free(along: tuple[Line, Line], sheet: Sheet, edges) -> NDArray[np.int64]:
    """Unknowns that no edge holds: hinges hold w and the turn along the edge."""
    n = [one.basis.N for one in along]
    held = np.zeros((3, *n), dtype=bool)
    for i, edge in enumerate(edges):
        axis, end = divmod(i, 2)
        node = along[axis].node(end * sheet[axis])
        w, tangential, normal = HELD[edge]
        on_edge = held[:, node] if axis == 0 else held[:, :, node]
        on_edge[0] |= w
        on_edge[1 + axis] |= normal
        on_edge[2 - axis] |= tangential
    return np.flatnonzero(~held.ravel())


def _patch(sheet: Sheet, along: tuple[Line, Line], at, free: NDArray[np.int64]) -> ContactPatch:
    """A disc on top, Hertz' pressure on it, struck downwards."""
    disc, share = disc_quadrature("hertz", 8, 24)
    points = np.asarray(at) + sheet.patch_radius * disc
    values = [one.at(x).toarray() for one, x in zip(along, points.T, strict=True)]
    read = np.einsum("q,qi,qj->ij", share, *values).ravel()
    w = -np.append(read, np.zeros(2 * len(read)))[free]
    w[np.abs(w) < 1e-14 * np.abs(w).max()] = 0.0
    spot = Spot(np.array([*at, sheet.thickness / 2]), DOWN, ACROSS)
    return ContactPatch(w, np.flatnonzero(w), w, spot, sheet.patch_radius, "hertz")


def _drawn(sheet: Sheet, x: Line, y: Line) -> tuple[MeshHex, csr_matrix]:
    """The plate as a box, and what each of its vertices does."""
    sides, longer = sheet[:2], max(sheet[:2])
    lines = [np.linspace(0, side, max(4, int(CELLS * side / longer)) + 1) for side in sides]
    box = MeshHex.init_tensor(*lines, np.array([-0.5, 0.5]) * sheet.thickness)
    place = [np.abs(p[:, None] - one).argmin(axis=1) for p, one in zip(box.p, lines, strict=False)]
    grid = csr_matrix(kron(x.at(lines[0]), y.at(lines[1])))
    P = grid[np.ravel_multi_index(place, [len(one) for one in lines])]
    turned, zero = diags_array(-box.p[2]) @ P, csr_matrix(P.shape)
    return box, vertex_by_vertex([[zero, turned, zero], [zero, zero, turned], [P, zero, zero]])
