"""A reduced wall as a function of numbers of its structure, from a few that were computed.

    omega_j^2(x), phi_j^2(x), zeta_j(x), s(x)  =  sum_a c_a T_a1(x_1) ... T_ad(x_d),   |a| <= degree

Chebyshev polynomials of least squares over the bounds, logarithms of numbers that may vary by
factors. Modes are followed by their shapes (MAC against the middle wall), else by their order; what
is not followed everywhere moves with the oscillator that stands for the rest. phi enters a wall by
its square alone, so signs of shapes do not matter. What each wall would be missed by if it were
left out follows from the least squares, e_i / (1 - h_ii) (D. M. Allen, Technometrics 16 (1974)
125). A wall computed where the answer lies moves all polynomials there: near it the error is of
second order.
"""

from collections.abc import Sequence
from itertools import product
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.stats import qmc

from coupling.errors import CouplingError
from dem import Wall
from rom import ReducedModel, modal

FOLLOWED = 0.2  # least MAC of a mode that is the same
IN_ORDER = 0.05  # MAC that the same place in the order counts for
OVERSAMPLED = 1.6  # walls over coefficients
FACTORS = 1.05  # high over low from which on a number varies by factors
ROWS = 600  # of a surface, that tell modes apart
RIGID = 1e-9  # of the largest square of a frequency: none


class Computed(NamedTuple):
    """A wall that was computed: its own modes first, in order, with their shapes (n, k) on points
    that all walls share, None where there are none; then the oscillator for the rest."""

    wall: Wall
    shapes: NDArray[np.float64] | None = None


def with_rest(wall: Wall, reduced: ReducedModel | None) -> Computed:
    """The wall with an oscillator for the rest behind its own modes, and their shapes."""
    modes = None if reduced is None else modal(reduced)
    own = None if modes is None else int(np.isin(wall.omega, modes.omega).sum())
    if own in (None, len(wall.omega)):  # nothing is left out
        wall = wall._replace(
            omega=np.append(wall.omega, 10.0 * wall.omega.max()),
            zeta=np.append(wall.zeta, 0.0),
            phi=np.append(wall.phi, 0.0),
        )
    if modes is None or reduced.surface is None:
        return Computed(wall)
    T = reduced.surface.T.reshape(-1, reduced.surface.T.shape[-1])
    return Computed(wall, T[:: max(1, len(T) // ROWS)] @ modes.vectors[:, :own])


class Bounds(NamedTuple):
    """Bounds of d numbers."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """(..., d) between -1 and 1."""
        x, low, high = (self._bent(value) for value in (theta, self.low, self.high))
        return 2.0 * (x - low) / (high - low) - 1.0

    def at(self, unit: NDArray[np.float64]) -> NDArray[np.float64]:
        """What `unit` has made of it."""
        low, high = self._bent(self.low), self._bent(self.high)
        x = low + 0.5 * (unit + 1.0) * (high - low)
        return np.where(self._by_factors, np.exp(np.where(self._by_factors, x, 0.0)), x)

    @property
    def _by_factors(self) -> NDArray[np.bool_]:
        return (self.low > 0) & (self.high > FACTORS * self.low)

    def _bent(self, value):
        value = np.asarray(value, float)
        return np.where(self._by_factors, np.log(np.where(self._by_factors, value, 1.0)), value)


class Missed(NamedTuple):
    """What walls would be missed by if they were left out: largest over walls and modes."""

    frequency: float  # relative, of modes that make up 99 % of the compliance
    compliance: float  # relative, static


class ParametricWall(NamedTuple):
    """The wall at any numbers (d,) within the box."""

    box: Bounds
    degrees: NDArray[np.int64]  # (terms, d)
    coefficients: NDArray[np.float64]  # (terms, quantities)
    n_modes: int  # the oscillator included
    missed: Missed
    n_walls: int

    def __call__(self, theta: NDArray[np.float64]) -> Wall:
        """Raises CouplingError where a mode has no stiffness left."""
        values = _terms(self.box.unit(theta)[None], self.degrees)[0] @ self.coefficients
        squares, phi2, zeta = values[:-1].reshape(3, self.n_modes)
        if squares.min(initial=np.inf) < -RIGID * squares.max(initial=0.0):
            raise CouplingError("the structure has no stiffness there; keep away from buckling.")
        phi = np.sqrt(np.maximum(phi2, 0.0))
        return Wall(
            np.sqrt(np.maximum(squares, 0.0)), np.maximum(zeta, 0.0), phi, float(values[-1])
        )

    def through(self, theta: NDArray[np.float64], true: Computed) -> "ParametricWall":
        """The same moved so that it gives the true wall at theta; modes that the true wall lacks
        keep their frequencies and take no part there. Raises CouplingError where a mode has no
        stiffness left."""
        mine = self(theta)
        own, places = _nearest(mine, true.wall, self.n_modes - 1)
        there = _gathered(true.wall, places)
        kept = np.append(own, self.n_modes - 1)  # the oscillator for the rest comes last
        full = mine._replace(
            omega=mine.omega.copy(), phi=np.zeros(self.n_modes), zeta=mine.zeta.copy(),
            residual_compliance=there.residual_compliance,
        )  # fmt: skip
        for of_full, of_true in zip(full[:3], there[:3], strict=True):
            of_full[kept] = of_true
        offset = _quantities(full) - _quantities(mine)
        moved = self.coefficients.copy()
        moved[~self.degrees.any(axis=1)] += offset
        return self._replace(coefficients=moved)


def design(box: Bounds, degree: int, seed: int = 0) -> NDArray[np.float64]:
    """(n, d) numbers at which to compute walls, the middle first; dense towards the bounds."""
    d = len(box.low)
    n = int(np.ceil(OVERSAMPLED * comb(d + degree, degree)))
    unit = qmc.Sobol(d, rng=np.random.default_rng(seed)).random_base2(int(np.ceil(np.log2(n))))[:n]
    return box.at(np.vstack([np.zeros(d), np.cos(np.pi * unit)]))


def parametric_wall(
    box: Bounds, numbers: NDArray[np.float64], walls: Sequence[Computed], degree: int
) -> ParametricWall:
    """The wall between computed ones (n,) at the numbers (n, d), the middle first; raises
    CouplingError where they are too few."""
    degrees = _degrees(len(box.low), degree)
    if len(walls) <= len(degrees):
        raise CouplingError(
            f"{len(walls)} walls could be computed within the bounds, {len(degrees) + 1} are "
            "needed; narrow the bounds."
        )
    followed = _followed(walls)
    gathered = [_gathered(one.wall, order) for one, order in zip(walls, followed, strict=True)]
    values = np.array([_quantities(wall) for wall in gathered])
    A = _terms(box.unit(numbers), degrees)
    coefficients, *_ = np.linalg.lstsq(A, values, rcond=None)
    leverage = np.sum(np.linalg.qr(A)[0] ** 2, axis=1)
    left_out = values - (values - A @ coefficients) / np.maximum(1.0 - leverage, 1e-3)[:, None]
    n = len(gathered[0].omega)
    return ParametricWall(box, degrees, coefficients, n, _missed(values, left_out, n), len(walls))


def _degrees(d: int, degree: int) -> NDArray[np.int64]:
    every = product(range(degree + 1), repeat=d)
    return np.array([powers for powers in every if sum(powers) <= degree])


def _terms(x: NDArray[np.float64], degrees: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, terms) products of Chebyshev polynomials at x (n, d)."""
    each = np.polynomial.chebyshev.chebvander(x, degrees.max(initial=0))  # (n, d, degree + 1)
    return np.prod([each[:, i, degrees[:, i]] for i in range(x.shape[1])], axis=0)


def _quantities(wall: Wall) -> NDArray[np.float64]:
    return np.concatenate([wall.omega**2, wall.phi**2, wall.zeta, [wall.residual_compliance]])


def _followed(walls: Sequence[Computed]) -> list[NDArray[np.int64]]:
    """(k,) places in every wall of the modes of the first that all walls have."""
    found = [_matched(walls[0], other) for other in walls]
    common = np.all([places >= 0 for places in found], axis=0)
    return [places[common] for places in found]


def _matched(one: Computed, other: Computed) -> NDArray[np.int64]:
    """(k,) place in the other of each mode of one, -1 of those that it lacks."""
    n, m = len(one.wall.omega) - 1, len(other.wall.omega) - 1
    places = np.arange(n)
    if one.shapes is None or other.shapes is None or len(one.shapes) != len(other.shapes):
        return np.where(places < m, places, -1)
    alike = mac(one.shapes[:, :n], other.shapes[:, :m])
    rows, columns = linear_sum_assignment(-alike - IN_ORDER * np.eye(n, m))
    found = np.full(n, -1)
    same = alike[rows, columns] >= FOLLOWED
    found[rows[same]] = columns[same]
    return found


def mac(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, m) modal assurance criterion of shapes (n, k) and (n, m)."""
    square = np.outer(np.sum(one**2, axis=0), np.sum(other**2, axis=0))
    return (one.T @ other) ** 2 / np.maximum(square, 1e-300)


def _nearest(mine: Wall, given: Wall, n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(k,) those of my first n modes that have a partner, and its place in the given wall: k is n,
    or as many modes as the given wall has."""
    own, others = np.maximum(mine.omega[:n, None], 1e-12), np.maximum(given.omega[None, :-1], 1e-12)
    apart = np.abs(np.log(own / others))
    return linear_sum_assignment(apart)  # rows ascend


def _gathered(wall: Wall, order: NDArray[np.int64]) -> Wall:
    """The modes at these places; all others are one oscillator of the same m_1 and m_2, see
    `coupling.wall`."""
    rest = np.setdiff1d(np.arange(len(wall.omega)), order)
    rest = rest[wall.omega[rest] > 0]
    share = wall.phi[rest] ** 2 / wall.omega[rest] ** 2
    m1, m2 = np.sum(share), np.sum(share / wall.omega[rest] ** 2)
    loss = np.sum(share * wall.zeta[rest]) / m1 if m1 > 0 else 0.0
    square, phi2 = (m1 / m2, m1**2 / m2) if m1 > 0 else (wall.omega.max() ** 2, 0.0)
    return wall._replace(
        omega=np.append(wall.omega[order], np.sqrt(square)),
        zeta=np.append(wall.zeta[order], loss),
        phi=np.append(wall.phi[order], np.sqrt(phi2)),
    )


def _missed(values, left_out, n: int) -> Missed:
    """Of quantities (walls, q) and what the others say of each."""
    elastic = values[:, :n].min(axis=0) > RIGID * values[:, :n].max()
    values, left_out = (one[:, : 2 * n][:, np.tile(elastic, 2)] for one in (values, left_out))
    n = int(elastic.sum())
    share = values[:, n : 2 * n] / values[:, :n]
    heavy = share.mean(axis=0) >= 0.01 * share.mean(axis=0).sum() / n
    frequency = 0.5 * np.abs(left_out[:, :n] / values[:, :n] - 1.0)[:, heavy]
    said = np.sum(left_out[:, n : 2 * n] / left_out[:, :n], axis=1)
    return Missed(float(frequency.max()), float(np.abs(said / share.sum(axis=1) - 1.0).max()))
