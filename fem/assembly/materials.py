"""Materials: isotropic and orthotropic elasticity.

sigma_ac = C_acbd eps_bd. An orthotropic solid is given by its compliance in its own axes,

    eps_11 = sigma_11 / E1 - nu12 sigma_22 / E1 - nu13 sigma_33 / E1, ...
    eps_12 = sigma_12 / (2 G12), ...

(Jones, Mechanics of Composite Materials (1999), sec. 2.3).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

PAIRS = ((0, 1), (0, 2), (1, 2))  # of axes, in the order of ratios and shear moduli


class Material(NamedTuple):
    """An isotropic elastic solid."""

    young: float  # [Pa]
    poisson: float
    density: float  # [kg/m^3]

    @property
    def lame(self) -> tuple[float, float]:
        """lambda and mu [Pa]."""
        E, nu = self.young, self.poisson
        return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    @property
    def elasticity(self) -> NDArray[np.float64]:
        """C_acbd (3, 3, 3, 3) [Pa] = lambda d_ac d_bd + mu (d_ab d_cd + d_ad d_cb), where
        sigma_ac = C_acbd eps_bd."""
        lam, mu = self.lame
        unit = np.eye(3)
        shear = np.einsum("ab,cd->acbd", unit, unit) + np.einsum("ad,cb->acbd", unit, unit)
        return lam * np.einsum("ac,bd->acbd", unit, unit) + mu * shear


class Orthotropic(NamedTuple):
    """An elastic solid with three planes of symmetry: fibres, plies, wood."""

    young: tuple[float, float, float]  # [Pa] E1, E2, E3
    poisson: tuple[float, float, float]  # nu12, nu13, nu23: nu_ij / E_i = nu_ji / E_j
    shear: tuple[float, float, float]  # [Pa] G12, G13, G23
    density: float  # [kg/m^3]
    axes: tuple[tuple[float, float, float], ...] = ((1, 0, 0), (0, 1, 0))  # 1; 2 in their plane

    @property
    def elasticity(self) -> NDArray[np.float64]:
        """C_acbd (3, 3, 3, 3) [Pa] along x, y, z, turned there from the axes 1, 2, 3; raises
        ValueError for moduli of no solid and for axes that span no plane."""
        C, normal = np.zeros((3, 3, 3, 3)), np.linalg.inv(self.compliance)
        for a in range(3):
            for b in range(3):
                C[a, a, b, b] = normal[a, b]
        for (a, b), G in zip(PAIRS, self.shear, strict=True):
            C[a, b, a, b] = C[b, a, b, a] = C[a, b, b, a] = C[b, a, a, b] = G
        R = self.frame
        return np.einsum("ia,jc,kb,ld,ijkl->acbd", R, R, R, R, C, optimize=True)

    @property
    def frame(self) -> NDArray[np.float64]:
        """Rows (3, 3) along 1, 2, 3; raises ValueError for axes that span no plane."""
        first, second = np.array(self.axes[:2], dtype=float)
        third = np.cross(first, second)
        lengths = np.linalg.norm(first), np.linalg.norm(third)
        if not min(lengths) > 1e-6 * np.linalg.norm(second) * max(lengths[0], 1e-300):
            raise ValueError(
                f"axes = {self.axes} of an orthotropic material must be two directions that differ."
            )
        first, third = first / lengths[0], third / lengths[1]
        return np.array([first, np.cross(third, first), third])

    @property
    def compliance(self) -> NDArray[np.float64]:
        """S (3, 3) [1/Pa] of the normal stresses, S_ij = -nu_ij / E_i; raises ValueError for moduli
        of no solid: S must be positive definite and every modulus above 0."""
        S = np.diag(1 / np.array(self.young))
        for (a, b), nu in zip(PAIRS, self.poisson, strict=True):
            S[a, b] = S[b, a] = -nu / self.young[a]
        unit = S * np.sqrt(np.outer(np.abs(self.young), np.abs(self.young)))
        if min(*self.young, *self.shear, np.linalg.eigvalsh(unit)[0]) > 0:
            return S
        raise ValueError(
            f"young = {self.young}, poisson = {self.poisson}, shear = {self.shear} give no elastic "
            "solid: some load would do negative work; moduli must be positive and |nu_ij| below "
            "sqrt(E_i / E_j), take smaller ratios."
        )
