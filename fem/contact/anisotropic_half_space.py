"""A half-space of any elastic solid under a normal force, and a rigid sphere pressed into it.

A unit force is a sum of waves along all directions kappa of the surface. In the plane of kappa and
the inward normal n, turned by omega to m and n', the solid is Stroh's

    N1 = -T^-1 R^T,   N2 = T^-1,   N3 = R T^-1 R^T - Q,   Q = (m m), R = (m n'), T = (n' n'),
    (a b)_ik = a_j C_ijkl b_l,   S, H, -L = means of N1, N2, N3 over half a turn of omega

(Ting, Anisotropic Elasticity (1996), chapters 6 and 7). With y = S L^-1 n the waves sum up to

    u(x) = 1/(4 pi^2) int (cos omega y + sin omega (N2 n - N1 y)) / rho dphi,
    rho (cos omega, sin omega) = (x . kappa, x . n),

at the surface at a distance r, in the direction theta, along the normal u_n = h(theta + pi/2) / (2
pi r), h = n . L^-1 n; of an isotropic solid h = 2 (1 - nu^2) / E. Under the pressure
p0 sqrt(1 - x . G^-1 x) it is, by the same sum, with c^2 = kappa . G kappa,

    u_n = p0 sqrt(det G) / 8 int h / c (1 - (x . kappa)^2 / c^2) dphi,

so that an ellipse is pressed by a sphere (Willis, J. Mech. Phys. Solids 14 (1966) 163).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import root

from beadwave.fem.assembly.materials import Material, Orthotropic
from beadwave.fem.contact.impact_point import spanning

N_DIRECTIONS = 128  # of kappa in half a turn; periodic sums, whose errors fall exponentially

Anisotropic = Material | Orthotropic


# Resolution of the tabulated field of a force
N_ELEVATIONS = 32  # elevations from the surface to the normal, less one
N_AZIMUTHS = 96  # azimuths
N_KAPPA = 100  # directions of kappa over the height of a point above the surface
TABLE_ACCURACY = 1e-3  # of displacements between the entries of the table


class HalfSpace(NamedTuple):
    """A solid below a plane, and its response to waves along (n,) directions in half a turn."""

    C: NDArray[np.float64]  # (3, 3, 3, 3) [Pa]
    axes: NDArray[np.float64]  # (3, 3) rows: two along the surface, the inward normal
    y: NDArray[np.float64]  # (n, 3) S L^-1 n [1/Pa]
    L_inverse_n: NDArray[np.float64]  # (n, 3) L^-1 n [1/Pa]

    @property
    def h(self) -> NDArray[np.float64]:
        """n . L^-1 n in each direction, (n,) [1/Pa]."""
        return self.L_inverse_n @ self.axes[2]

    def planes(self, angles: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Q, R and T (n, 3, 3) [Pa] of m = kappa at these angles, and the inward normal."""
        kappa, n = _unit_vectors(angles) @ self.axes[:2], self.axes[2]
        along, down = np.tensordot(kappa, self.C, axes=(1, 1)), np.tensordot(n, self.C, axes=(0, 1))
        Q = np.einsum("nikl,nl->nik", along, kappa)
        return Q, along @ n, np.broadcast_to(down @ n, Q.shape)


def half_space(material: Anisotropic, inward: NDArray[np.float64]) -> HalfSpace:
    """The half-space of a material below a plane with this inward unit normal (3,): y and L^-1 n at
    N_DIRECTIONS angles of kappa. Both means are over 128 angles of omega, a periodic sum."""
    axes = np.vstack([spanning(inward), inward])
    bare = HalfSpace(material.elasticity, axes, np.empty((0, 3)), np.empty((0, 3)))
    n_omega = 128  # angles of omega in half a turn, over which S, H and L are means
    omega = np.pi * np.arange(n_omega) / n_omega
    planes = bare.planes(np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS)
    Q, R, T = _turned(*(matrix[:, None] for matrix in planes), omega)

    # Barnett and Lothe's S and -L, the means of N1 and N3 over omega
    N1 = -np.linalg.solve(T, np.swapaxes(R, -1, -2))
    L = (Q + R @ N1).mean(axis=1)
    L_inverse_n = np.linalg.solve(L, inward[:, None])
    y = N1.mean(axis=1) @ L_inverse_n
    return bare._replace(y=y[..., 0], L_inverse_n=L_inverse_n[..., 0])


class SurfaceForce(NamedTuple):
    """Displacements by a unit normal force on a half-space: R u over the directions from it."""

    axes: NDArray[np.float64]  # (3, 3) rows: two along the surface, the inward normal
    table: tuple[RectBivariateSpline, ...]  # R u [m^2/N] along x, y, z over elevation and azimuth

    def __call__(
        self, points: NDArray[np.float64], source: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Displacements (n, 3) [m] at points (n, 3) by a force at `source` (3,) on the surface."""
        x, y, z = self.axes @ (points - source).T
        r = np.hypot(x, y)
        direction = np.arctan2(np.maximum(z, 0.0), r), np.arctan2(y, x)
        along = np.column_stack([component.ev(*direction) for component in self.table])
        return along / np.hypot(r, z)[:, None]


def surface_force(material: Anisotropic, inward: NDArray[np.float64]) -> SurfaceForce:
    """The field of a unit force along the inward unit normal (3,) of a half-space.

    Raises ValueError for a solid whose moduli differ too much for the table.
    """
    solid = half_space(material, inward)
    elevation = np.linspace(0.0, np.pi / 2, N_ELEVATIONS + 1)
    azimuth = _azimuths(N_AZIMUTHS)
    both = np.vstack([solid.y, -solid.y])  # over a full turn: S changes its sign with kappa

    # R u (heights + 1, around, 3) [m^2/N], the integral over the waves
    u = np.empty((len(elevation), N_AZIMUTHS, 3))
    for row, angle in zip(u, elevation, strict=True):
        # rho falls to the height of the point where kappa lies across it: directions as dense as
        # that peak is narrow, but at the surface, where its part is added in closed form
        height = np.sin(angle)
        per_azimuth = N_KAPPA / N_AZIMUTHS / max(height, 1 / N_ELEVATIONS)
        n = N_AZIMUTHS * int(np.ceil(per_azimuth))
        # half-way between the directions across, along which 1 / s has no end at the surface
        kappa = _azimuths(n) + np.pi / n
        s = np.cos(angle) * np.cos(kappa - azimuth[:, None])
        rho, omega = np.hypot(s, height)[..., None], np.arctan2(height, s)
        y = _interpolated(both, kappa)
        _, R, T = _turned(*solid.planes(kappa), omega)
        pushed = solid.axes[2] + (y[:, None] @ R)[..., 0, :]
        turned = np.linalg.solve(T, pushed[..., None])[..., 0]  # N2 n - N1 y
        waves = (np.cos(omega)[..., None] * y + np.sin(omega)[..., None] * turned) / rho
        row[:] = waves.mean(axis=1)
        # at the surface y / s is a principal value, and what the directions across add is L^-1 n
        if height == 0.0:
            row += _interpolated(np.vstack([solid.L_inverse_n] * 2), azimuth + np.pi / 2)
        row /= 2 * np.pi

    # every second entry of the table gives those between to its accuracy
    across = np.cos(elevation)[:, None, None] * _unit_vectors(azimuth)
    up = np.broadcast_to(np.sin(elevation)[:, None, None], (*across.shape[:2], 1))
    points = np.concatenate([across, up], axis=2).reshape(-1, 3) @ solid.axes
    coarse = SurfaceForce(solid.axes, _splines(elevation[::2], u[::2, ::2]))
    between = coarse(points, np.zeros(3)).reshape(u.shape)
    off = np.abs(between - u).max() / np.abs(u).max() / 2**4  # cubic: of order 4
    if off > TABLE_ACCURACY:
        raise ValueError(
            f"the half-space of {material} is known to {off:.1g} only, allowed is "
            f"{TABLE_ACCURACY:g}: its moduli differ too much; strike a body of another material."
        )
    return SurfaceForce(solid.axes, _splines(elevation, u))


def indentation_modulus(material: Anisotropic, inward: NDArray[np.float64]) -> float:
    """E* [Pa] of F = 4/3 E* sqrt(R) delta^(3/2) for a rigid sphere on a plane with this inward unit
    normal (3,); E / (1 - nu^2) of an isotropic solid.

    The sphere needs the displacement delta - r^2 / (2 R) under the pressure of the module, whose
    force is F = 2 pi p0 sqrt(det G) / 3, so that

        delta = 3 F / (16 pi) int h / c dphi,   1 / R = 3 F / (16 pi) tr int h kappa kappa^T / c^3,

    with an integral of kappa kappa^T that is as large along all directions: this gives the ellipse
    G. Both are computed for an ellipse of mean c^2 = 1 and scaled to its size.
    """
    weight = 2 * np.pi / N_DIRECTIONS * half_space(material, inward).h
    angles = np.pi * np.arange(N_DIRECTIONS) / N_DIRECTIONS
    kappa, twice = _unit_vectors(angles), _unit_vectors(2 * angles)

    def pressed(G: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """int h / c and int h kappa kappa^T / c^3 (2, 2) under c^2 = 1 + G_1 cos 2 phi + G_2 sin 2
        phi, G (2,): depth and curvatures over 3 F / (16 pi)."""
        c = np.sqrt(1 + twice @ G)
        return float((weight / c).sum()), (kappa.T * (weight / c**3)) @ kappa

    def asphericity(G: NDArray[np.float64]) -> NDArray[np.float64]:
        """Relative difference of the curvatures (2,) from those of a sphere: 0 of the ellipse that
        a sphere presses."""
        _, bent = pressed(G)
        return np.array([bent[0, 0] - bent[1, 1], 2 * bent[0, 1]]) / np.trace(bent)

    depth, bent = pressed(root(asphericity, np.zeros(2), tol=1e-12).x)
    size = np.cbrt(3 / (16 * np.pi) * np.trace(bent))  # for F = R = 1
    return float(0.75 * (3 / (16 * np.pi) * depth / size) ** -1.5)


def _unit_vectors(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors (n, 2) at angles (n,) [rad]."""
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _azimuths(n: int) -> NDArray[np.float64]:
    """n equal angles around [rad]."""
    return 2 * np.pi * np.arange(n) / n


def _turned(Q, R, T, omega: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Q, R and T (..., 3, 3) [Pa] of m and n' , which are kappa and n turned by omega [rad]."""
    cos, sin = np.cos(omega)[..., None, None], np.sin(omega)[..., None, None]
    R_t = np.swapaxes(R, -1, -2)
    return (
        cos**2 * Q + sin * cos * (R + R_t) + sin**2 * T,
        cos**2 * R - sin**2 * R_t + sin * cos * (T - Q),
        cos**2 * T - sin * cos * (R + R_t) + sin**2 * Q,
    )


def _interpolated(values: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (n, 3) at equal angles around interpolated to other angles by their harmonics."""
    harmonics = np.fft.rfft(values, axis=0)[:-1] / len(values)
    harmonics[1:] *= 2
    return np.real(np.exp(1j * np.outer(angles, np.arange(len(harmonics)))) @ harmonics)


def _splines(elevation: NDArray[np.float64], u: NDArray[np.float64]) -> tuple:
    """Splines of R u (n, k, 3) along x, y and z, over a turn about zero and a little more."""
    k = np.arange(-u.shape[1] // 2 - 3, u.shape[1] // 2 + 4)
    azimuth = 2 * np.pi / u.shape[1] * k
    around = u[:, k % u.shape[1]]
    return tuple(RectBivariateSpline(elevation, azimuth, around[..., i]) for i in range(3))
