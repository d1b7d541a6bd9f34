"""Finite elements of high order on a line: what a beam is made of, and by products a plate."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from skfem import Basis, BilinearForm, ElementLinePp, MeshLine


class LineElements(NamedTuple):
    """Shape functions N_i along a line and their integrals, all (n, n)."""

    basis: Basis
    mass: csr_matrix  # int N_i N_j [m]
    slope: csr_matrix  # int N_i' N_j' [1/m]
    mixed: csr_matrix  # int N_i N_j'

    def at(self, x: NDArray[np.float64]) -> csr_matrix:
        """Values (k, n) of the functions at places x (k,) [m]."""
        return csr_matrix(self.basis.probes(x[None]))

    def node(self, x: float) -> int:
        """The function that is 1 at the end of an element nearest to x [m]."""
        return int(self.basis.nodal_dofs[0, np.argmin(np.abs(self.basis.mesh.p[0] - x))])

    @property
    def one(self) -> NDArray[np.float64]:
        """Coefficients (n,) of the function 1: the functions at the ends of elements sum to it, the
        inner ones, which vanish there, have none."""
        return np.isin(np.arange(self.basis.N), self.basis.nodal_dofs).astype(float)


def line(ends: NDArray[np.float64], order: int) -> LineElements:
    """Elements of a polynomial order whose ends are at `ends` (m,) [m]."""
    basis = Basis(MeshLine(ends), ElementLinePp(order), intorder=2 * order)
    return LineElements(basis, *(form.assemble(basis) for form in (_mass, _slope, _mixed)))


def divided(points: list[float], longest: float, fewest: int = 1) -> NDArray[np.float64]:
    """Ends of elements (m,) [m]: all of the ascending points, and `fewest` elements or more between
    any two of them, none longer than `longest` [m]."""
    ends = []
    for a, b in pairwise(points):
        n_elements = max(fewest, int(np.ceil((b - a) / longest)))
        ends.append(np.linspace(a, b, n_elements + 1)[:-1])
    return np.append(np.concatenate(ends), points[-1])


@BilinearForm
def _mass(u, v, _):
    return u * v


@BilinearForm
def _slope(u, v, _):
    return u.grad[0] * v.grad[0]


@BilinearForm
def _mixed(u, v, _):
    return u.grad[0] * v


def wave_length(s: float, shear: float, bending: float, mass: float, inertia: float) -> float:
    """Length [m] of the shorter of Timoshenko's two waves at an angular frequency s [rad/s]:

    (S k^2 - m s^2) (B k^2 + S - J s^2) = (S k)^2 for the shear and bending stiffness S and B, the
    mass m and rotational inertia J per length, or per area of a plate. In k^2 this is
    a k^4 - b k^2 + c = 0, and the shorter wave has the larger root.
    """
    a, c = shear * bending, s**2 * mass * (s**2 * inertia - shear)
    b = s**2 * (inertia * shear + mass * bending)
    return float(2 * np.pi * np.sqrt(2 * a / (b + np.sqrt(b**2 - 4 * a * c))))
