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
theory's own W, P^2 (1 / (D k^4) + 1 / (kappa G h k^2)) with P = 1 - (k b)^2 / 10 of Hertz' weights,
agrees with it for small k if the disc has the radius

    (b / h)^2 = 5 / (6 kappa (1 - nu)) - 1,

0.6 thicknesses for steel. At larger k the theory's W exceeds the layer's; the integral of the
excess is finite and is subtracted as `half_space`. What remains is the compliance of the solid less
that of the half-space, independent of b.
Mindlin, J. Appl. Mech. 18 (1951) 31; kappa: Stephen, J. Sound Vib. 202 (1997) 539; the layer:
Sneddon, Fourier Transforms (1951), sec. 54.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.sparse import block_array, block_diag, csc_array, csr_matrix, diags_array, kron
from skfem import MeshHex

from beadwave.fem.assembly.materials import Material
from beadwave.fem.bending.bending_model import (
    ACROSS,
    DOWN,
    Bending,
    Buckled,
    load_factor,
    vertex_by_vertex,
)
from beadwave.fem.bending.line_elements import LineElements, divided, line, wave_length
from beadwave.fem.contact.contact_patch import ContactPatch, disc_quadrature
from beadwave.fem.contact.impact_point import SurfacePoint

# of an edge: the deflection, the turn along the edge and the turn across it
HELD = {"hinged": (True, True, False), "clamped": (True, True, True), "free": (False,) * 3}


# Division of a plate into elements
ORDER = 6  # of the elements
RESOLVED_HZ = 10e3  # a wave of this frequency is as long as an element, right to 1e-3
SIZE_AT_STRIKE = 2.0  # radii of the disc: size of the elements that are struck
MAX_UNKNOWNS = 60_000  # unknowns: a minute and 2 GB
N_DRAWN_CELLS = 60  # along the longer side of the plate as it is drawn


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
        """Radius b [m] of the disc that is struck, by the module's formula; 0.3 thicknesses at
        least, where poisson is small."""
        squared = 5 / (6 * self.kappa * (1 - self.material.poisson)) - 1
        return self.thickness * float(np.sqrt(max(squared, 0.3**2)))

    @property
    def inertia(self) -> tuple[float, float]:
        """rho h [kg/m^2] and rho h^3 / 12 [kg]."""
        rho = self.material.density
        return rho * self.thickness, rho * self.thickness**3 / 12


class PlateCorrection(NamedTuple):
    """Corrections of the plate theory towards a solid plate: a clamped edge also hinders the strain
    across the thickness.

    This acts as if the plate were edge nu^2 h shorter there. Fitted to single frequencies and
    compliances of solids 8 to 14 thicknesses long, `edge` is 0.2 to 0.45.
    """

    edge: float = 0.35


class TooLarge(ValueError):
    """A plate with more waves along its sides than there is memory for."""


def mindlin_plate(
    sheet: Sheet,
    edges: tuple[str, str, str, str],
    at: tuple[float, float],
    *,
    in_plane: tuple[float, float] = (0.0, 0.0),
    coarser: float = 1.0,
    correction: PlateCorrection | None = None,
) -> Bending:
    """A plate with edges "hinged", "clamped" or "free" at x = 0, x = length, y = 0, y = width,
    struck at x, y [m], under forces `in_plane` N_x, N_y [N/m].

    A hinged edge turns about itself alone. Elements are `coarser` times as long as usual;
    `correction` corrects the theory by what solids have otherwise.
    Raises Buckled for forces that press more than the plate can bear, TooLarge for a plate with
    more unknowns than `most`.
    """
    # a solid's clamped edges hinder the strain across the thickness: as if the plate were shorter
    if correction is not None:
        shorter = correction.edge * sheet.material.poisson**2 * sheet.thickness
        left, right, front, back = shorter * (np.array(edges) == "clamped")
        size = sheet.length - left - right, sheet.width - front - back
        sheet = sheet._replace(length=float(size[0]), width=float(size[1]))
        at = (at[0] - left, at[1] - front)
    D, S, nu = sheet.bending_stiffness, sheet.shear_stiffness, sheet.material.poisson
    m, j = sheet.inertia
    N_x, N_y = in_plane

    ends = element_ends(sheet, at, coarser)
    x, y = along = tuple(line(e, ORDER) for e in ends)

    # K, M and K_G of w, t_x, t_y on all products of the functions along x and y
    shear = (1 - nu) / 2
    area = kron(x.mass, y.mass)
    slope_x, slope_y = kron(x.slope, y.mass), kron(x.mass, y.slope)
    tilt_x, tilt_y = -S * kron(x.mixed, y.mass), -S * kron(x.mass, y.mixed)
    twist = D * (nu * kron(x.mixed.T, y.mixed) + shear * kron(x.mixed, y.mixed.T))
    K = block_array(
        [
            [S * (slope_x + slope_y), tilt_x.T, tilt_y.T],
            [tilt_x, D * (slope_x + shear * slope_y) + S * area, twist],
            [tilt_y, twist.T, D * (slope_y + shear * slope_x) + S * area],
        ]
    )
    M = block_array([[m * area, None, None], [None, j * area, None], [None, None, j * area]])
    bent = N_x * slope_x + N_y * slope_y
    K_G = block_diag([bent, csr_matrix((2 * bent.shape[0],) * 2)])

    # edges hold w, the turn along the edge and that across it
    held_dofs = np.zeros((3, *(functions.basis.N for functions in along)), dtype=bool)
    for i, edge in enumerate(edges):
        axis, end = divmod(i, 2)
        node = along[axis].node(end * sheet[axis])
        w, tangential, normal = HELD[edge]
        on_edge = held_dofs[:, node] if axis == 0 else held_dofs[:, :, node]
        on_edge[0] |= w
        on_edge[1 + axis] |= normal
        on_edge[2 - axis] |= tangential
    free = np.flatnonzero(~held_dofs.ravel())
    K, M, K_G = (csc_array(A.tocsc()[free][:, free]) for A in (K, M, K_G))

    # pressing forces are refused from the buckling load on: K + K_G would be indefinite
    factor = None
    if min(in_plane) < 0:
        factor = load_factor(K, K_G)
        if factor >= 1:
            raise Buckled(
                f"forces in the plane of {N_x:.6g} N/m along x and {N_y:.6g} N/m along y are "
                f"{factor:.4g} times those that buckle it; take less"
            )

    # a disc on top under Hertz' pressure, downwards
    disc, share = disc_quadrature("hertz", 8, 24)
    points = np.asarray(at) + sheet.patch_radius * disc
    values = [f.at(p).toarray() for f, p in zip(along, points.T, strict=True)]
    pressed = np.einsum("q,qi,qj->ij", share, *values).ravel()
    read = -np.append(pressed, np.zeros(2 * len(pressed)))[free]
    read[np.abs(read) < 1e-14 * np.abs(read).max()] = 0.0
    spot = SurfacePoint(np.array([*at, sheet.thickness / 2]), DOWN, ACROSS)
    patch = ContactPatch(read, np.flatnonzero(read), read, spot, sheet.patch_radius, "hertz")

    box, T = box_around(sheet, x, y)
    unit = np.kron(x.one, y.one)
    return Bending(
        csc_array(K + K_G) if any(in_plane) else K,
        M,
        T[:, free],
        box,
        patch,
        M @ np.append(unit, np.zeros(2 * len(unit)))[free],
        m * sheet.length * sheet.width,
        half_space=beyond_the_solid(sheet),
        load_factor=factor,
    )


def element_ends(
    sheet: Sheet, at: tuple[float, float], coarser: float
) -> list[NDArray[np.float64]]:
    """Ends of the elements, (k,) [m] along x and (l,) along y: as long as the shortest wave that is
    resolved, small ones where the plate is struck, at `at` [m]. Raises TooLarge for more unknowns
    than `mesh.most`."""
    D, S = sheet.bending_stiffness, sheet.shear_stiffness
    m, j = sheet.inertia
    shortest = coarser * wave_length(2 * np.pi * RESOLVED_HZ, S, D, m, j)
    around = coarser * SIZE_AT_STRIKE * sheet.patch_radius
    ends = []
    for side, c in zip(sheet[:2], at, strict=True):
        struck = [p for p in (c - around, c, c + around) if 0.2 * around < p < side - 0.2 * around]
        ends.append(divided([0.0, *struck, side], shortest))
    n_unknowns = int(3 * np.prod([ORDER * (len(e) - 1) + 1 for e in ends]))
    if n_unknowns > MAX_UNKNOWNS:
        longest = max(np.diff(e).max() for e in ends)
        raise TooLarge(
            f"a plate of {sheet.length:g} x {sheet.width:g} x {sheet.thickness:g} m has "
            f"{n_unknowns:.2g} unknowns with elements of {longest:.2g} m, as long as waves of "
            f"{RESOLVED_HZ:g} Hz; allowed are {MAX_UNKNOWNS:g}: take a smaller or thicker one"
        )
    return ends


def box_around(sheet: Sheet, x: LineElements, y: LineElements) -> tuple[MeshHex, csr_matrix]:
    """A box of v vertices to draw the plate by, and their displacements T (3 v, n) by all unknowns
    w, t_x, t_y: they follow the normal, u_x = -z t_x, u_y = -z t_y, u_z = w."""
    sides, longer = sheet[:2], max(sheet[:2])
    lines = [np.linspace(0, side, max(4, int(N_DRAWN_CELLS * side / longer)) + 1) for side in sides]
    box = MeshHex.init_tensor(*lines, np.array([-0.5, 0.5]) * sheet.thickness)
    place = [np.abs(p[:, None] - q).argmin(axis=1) for p, q in zip(box.p, lines, strict=False)]
    grid = csr_matrix(kron(x.at(lines[0]), y.at(lines[1])))
    P = grid[np.ravel_multi_index(place, [len(q) for q in lines])]
    turned, zero = diags_array(-box.p[2]) @ P, csr_matrix(P.shape)
    T = vertex_by_vertex([[zero, turned, zero], [zero, zero, turned], [P, zero, zero]])
    return box, T


def beyond_the_solid(sheet: Sheet) -> float:
    """Compliance [m/N] by which the theory under a disc exceeds a layer of the solid less its
    half-space.

    The integral over wave numbers k (in 1 / thickness) of the theory's compliance under Hertz'
    pressure, minus what the layer has beyond the half-space, G k W / (1 - nu) - 1.
    """
    nu, b = sheet.material.poisson, sheet.patch_radius / sheet.thickness

    def excess(k: float) -> float:
        """G h k W of the theory less that of the layer beyond its half-space, at a wave number k
        [1 / thickness]: its integral over k is 2 pi G h times the compliance."""
        # Hertz' pressure on the disc, transformed: 3 (sin x - x cos x) / x^3, x = k b
        x = k * b
        pressure = 1 - x**2 / 10 + x**4 / 280 - x**6 / 15120
        if x >= 0.3:
            pressure = 3 * (np.sin(x) - x * np.cos(x)) / x**3
        theory = pressure**2 * (6 * (1 - nu) / k**3 + 1 / (sheet.kappa * k))
        e = np.exp(-k)
        W = ((1 - e) ** 2 / (1 - e**2 + 2 * k * e) + (1 + e) ** 2 / (1 - e**2 - 2 * k * e)) / 2
        return theory - (1 - nu) * (W - 1)

    start = 0.05  # below lies rounding, and a straight line
    total = sum(quad(excess, *ends, limit=500)[0] for ends in ((start, 2.0), (2.0, 60 / b)))
    total = total + start * excess(start)
    return float(total / (2 * np.pi * sheet.material.lame[1] * sheet.thickness))
