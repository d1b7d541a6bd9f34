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

from beadwave.coupling.errors import CouplingError
from beadwave.dem import Wall
from beadwave.rom import ReducedModel, modal

FACTORS = 1.05  # high over low bound from which on a number varies by factors
RIGID = 1e-9  # of the largest square of a frequency: a mode without stiffness


# Computation of walls and following of their modes; not varied systematically
OVERSAMPLED = 1.6  # walls that are computed, over coefficients of a polynomial
FOLLOWED_MAC = 0.2  # MAC of two walls' modes that are the same, at least
ORDER_MAC = 0.05  # MAC that the same place in the order counts for
N_SURFACE_POINTS = 600  # points of a surface at which shapes are compared, about


class ComputedWall(NamedTuple):
    """A wall that was computed: modes of the structure first, in order, then the oscillator for the
    rest of its compliance."""

    wall: Wall
    shapes: NDArray[np.float64] | None = None  # (n, k) of the modes on points that all walls share


def with_rest(wall: Wall, reduced: ReducedModel | None) -> ComputedWall:
    """The wall with one more oscillator for the modes that it leaves out, and the shapes of its
    modes; where it leaves none out the oscillator has phi = 0."""
    modes = None if reduced is None else modal(reduced)
    # a wall takes frequencies over as they are, so that its own oscillator for the rest is the one
    # that equals none of the model's
    n_modes = None if modes is None else int(np.isin(wall.omega, modes.omega).sum())
    if n_modes in (None, len(wall.omega)):
        wall = wall._replace(
            omega=np.append(wall.omega, 10.0 * wall.omega.max()),
            zeta=np.append(wall.zeta, 0.0),
            phi=np.append(wall.phi, 0.0),
        )
    if modes is None or reduced.surface is None:
        return ComputedWall(wall)
    T = reduced.surface.T.reshape(-1, reduced.surface.T.shape[-1])
    return ComputedWall(wall, T[:: max(1, len(T) // N_SURFACE_POINTS)] @ modes.vectors[:, :n_modes])


class Bounds(NamedTuple):
    """Bounds of d numbers."""

    low: NDArray[np.float64]  # (d,)
    high: NDArray[np.float64]  # (d,)

    def unit(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates (..., d) between -1 and 1 of theta (..., d), linear in the logarithms of
        numbers that vary by factors."""
        x, low, high = (self._log(value) for value in (theta, self.low, self.high))
        return 2.0 * (x - low) / (high - low) - 1.0

    def at(self, unit: NDArray[np.float64]) -> NDArray[np.float64]:
        """theta (..., d) of coordinates `unit` (..., d): the inverse of `Bounds.unit`."""
        low, high = self._log(self.low), self._log(self.high)
        x = low + 0.5 * (unit + 1.0) * (high - low)
        return np.where(self._by_factors, np.exp(np.where(self._by_factors, x, 0.0)), x)

    @property
    def _by_factors(self) -> NDArray[np.bool_]:
        """(d,) numbers that vary by factors."""
        return (self.low > 0) & (self.high > FACTORS * self.low)

    def _log(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (..., d), logarithms where they vary by factors."""
        value = np.asarray(value, float)
        return np.where(self._by_factors, np.log(np.where(self._by_factors, value, 1.0)), value)


class LeftOutErrors(NamedTuple):
    """Errors of walls that are left out of the polynomials: largest over walls and modes."""

    frequency: float  # relative, of modes that make up 99 % of the compliance
    compliance: float  # relative, static


class ParametricWall(NamedTuple):
    """The wall at any numbers (d,) within the bounds."""

    box: Bounds
    degrees: NDArray[np.int64]  # (terms, d) of the Chebyshev polynomials in each term
    coefficients: NDArray[np.float64]  # (terms, quantities)
    n_modes: int  # the oscillator included
    missed: LeftOutErrors
    n_walls: int

    def __call__(self, theta: NDArray[np.float64]) -> Wall:
        """The wall at theta (d,); raises CouplingError where a mode has no stiffness left."""
        values = polynomials(self.box.unit(theta)[None], self.degrees)[0] @ self.coefficients
        squares, phi2, zeta = values[:-1].reshape(3, self.n_modes)
        if squares.min(initial=np.inf) < -RIGID * squares.max(initial=0.0):
            raise CouplingError("the structure has no stiffness there; keep away from buckling.")
        phi = np.sqrt(np.maximum(phi2, 0.0))
        return Wall(
            np.sqrt(np.maximum(squares, 0.0)), np.maximum(zeta, 0.0), phi, float(values[-1])
        )

    def through(self, theta: NDArray[np.float64], computed: ComputedWall) -> "ParametricWall":
        """The wall moved so that it gives the computed wall at theta (d,); modes that the computed
        wall lacks keep their frequencies and take no part there (phi = 0). Raises CouplingError
        where a mode has no stiffness left."""
        interpolated = self(theta)
        places, partners = nearest_modes(interpolated, computed.wall, self.n_modes - 1)
        partner = selected_modes(computed.wall, partners)

        # the computed wall in the order of the interpolated one, the oscillator for the rest last
        exact = interpolated._replace(
            omega=interpolated.omega.copy(),
            phi=np.zeros(self.n_modes),
            zeta=interpolated.zeta.copy(),
            residual_compliance=partner.residual_compliance,
        )
        places = np.append(places, self.n_modes - 1)
        exact.omega[places], exact.zeta[places] = partner.omega, partner.zeta
        exact.phi[places] = partner.phi

        # the constant term alone moves: all numbers within the bounds by the same
        coefficients = self.coefficients.copy()
        coefficients[~self.degrees.any(axis=1)] += quantities(exact) - quantities(interpolated)
        return self._replace(coefficients=coefficients)


def design(box: Bounds, degree: int, seed: int = 0) -> NDArray[np.float64]:
    """(n, d) numbers at which to compute walls, the middle first; dense towards the bounds."""
    d = len(box.low)
    n = int(np.ceil(OVERSAMPLED * comb(d + degree, degree)))
    unit = qmc.Sobol(d, rng=np.random.default_rng(seed)).random_base2(int(np.ceil(np.log2(n))))[:n]
    return box.at(np.vstack([np.zeros(d), np.cos(np.pi * unit)]))


def parametric_wall(
    box: Bounds, numbers: NDArray[np.float64], walls: Sequence[ComputedWall], degree: int
) -> ParametricWall:
    """The wall between computed ones (n,) at the numbers (n, d), the middle first; raises
    CouplingError where they are too few."""
    powers = product(range(degree + 1), repeat=len(box.low))
    degrees = np.array([p for p in powers if sum(p) <= degree])
    if len(walls) <= len(degrees):
        raise CouplingError(
            f"{len(walls)} walls could be computed within the bounds, {len(degrees) + 1} are "
            "needed; narrow the bounds."
        )

    # modes of the first wall that all walls have; the others join the oscillator for the rest
    places = [matched_modes(walls[0], wall) for wall in walls]
    common = np.all([p >= 0 for p in places], axis=0)
    selected = [
        selected_modes(computed.wall, p[common]) for computed, p in zip(walls, places, strict=True)
    ]
    n = len(selected[0].omega)
    values = np.array([quantities(wall) for wall in selected])

    # a wall that leaves out no mode has no frequency of the rest, which takes no part there: with
    # one ten times as high as those of the other walls polynomials went below zero between them
    has_rest = values[:, 2 * n - 1] > 0
    if has_rest.any():
        values[~has_rest, n - 1] = np.median(values[has_rest, n - 1])

    # least squares, and each wall by the polynomials of the others: e_i / (1 - h_ii)
    A = polynomials(box.unit(numbers), degrees)
    coefficients, *_ = np.linalg.lstsq(A, values, rcond=None)
    leverage = np.sum(np.linalg.qr(A)[0] ** 2, axis=1)
    left_out = values - (values - A @ coefficients) / np.maximum(1.0 - leverage, 1e-3)[:, None]
    errors = left_out_errors(values, left_out, n)
    return ParametricWall(box, degrees, coefficients, n, errors, len(walls))


def polynomials(x: NDArray[np.float64], degrees: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, terms) products of Chebyshev polynomials at x (n, d)."""
    T = np.polynomial.chebyshev.chebvander(x, degrees.max(initial=0))  # (n, d, degree + 1)
    return np.prod([T[:, i, degrees[:, i]] for i in range(x.shape[1])], axis=0)


def quantities(wall: Wall) -> NDArray[np.float64]:
    """Quantities that follow the polynomials: omega^2, phi^2, zeta of each mode, and the residual
    compliance, (3 modes + 1,)."""
    return np.concatenate([wall.omega**2, wall.phi**2, wall.zeta, [wall.residual_compliance]])


def matched_modes(first: ComputedWall, second: ComputedWall) -> NDArray[np.int64]:
    """(k,) place in the second wall of each mode of the first, -1 of those that it lacks."""
    n, m = len(first.wall.omega) - 1, len(second.wall.omega) - 1
    if first.shapes is None or second.shapes is None or len(first.shapes) != len(second.shapes):
        order = np.arange(n)
        return np.where(order < m, order, -1)
    similarity = mac(first.shapes[:, :n], second.shapes[:, :m])
    rows, columns = linear_sum_assignment(-similarity - ORDER_MAC * np.eye(n, m))
    places = np.full(n, -1)
    same = similarity[rows, columns] >= FOLLOWED_MAC
    places[rows[same]] = columns[same]
    return places


def mac(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, m) modal assurance criterion of shapes (n, k) and (n, m)."""
    square = np.outer(np.sum(first**2, axis=0), np.sum(second**2, axis=0))
    return (first.T @ second) ** 2 / np.maximum(square, 1e-300)


def nearest_modes(
    wall: Wall, computed: Wall, n: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(k,) those of the first n modes of a wall that have a partner by the logarithms of the
    frequencies, and its place in the computed wall: k is n, or as many modes as that wall has."""
    omega = np.maximum(wall.omega[:n, None], 1e-12)
    partner_omega = np.maximum(computed.omega[None, :-1], 1e-12)
    distance = np.abs(np.log(omega / partner_omega))
    return linear_sum_assignment(distance)  # rows ascend


def selected_modes(wall: Wall, places: NDArray[np.int64]) -> Wall:
    """The modes at these places (k,) of a wall, and last all others as one oscillator with the same
    moments of compliance, m_1 = sum phi^2 / omega^2 and m_2 = sum phi^2 / omega^4, so that
    omega^2 = m_1 / m_2 and phi^2 = m_1^2 / m_2, see `coupling.reduced_wall`.

    Its damping ratio is their mean weighted with the compliance. Modes without stiffness that have
    no place are left out: their compliance has no moments.
    """
    left_out = np.setdiff1d(np.arange(len(wall.omega)), places)
    left_out = left_out[wall.omega[left_out] > 0]
    share = wall.phi[left_out] ** 2 / wall.omega[left_out] ** 2
    m1, m2 = np.sum(share), np.sum(share / wall.omega[left_out] ** 2)
    loss = np.sum(share * wall.zeta[left_out]) / m1 if m1 > 0 else 0.0
    square, phi2 = (m1 / m2, m1**2 / m2) if m1 > 0 else (wall.omega.max() ** 2, 0.0)
    return wall._replace(
        omega=np.append(wall.omega[places], np.sqrt(square)),
        zeta=np.append(wall.zeta[places], loss),
        phi=np.append(wall.phi[places], np.sqrt(phi2)),
    )


def left_out_errors(
    values: NDArray[np.float64], left_out: NDArray[np.float64], n: int
) -> LeftOutErrors:
    """Of quantities (walls, q) of n modes, and of what the polynomials of the other walls give in
    place of each; modes without stiffness in some wall have no relative error."""
    elastic = values[:, :n].min(axis=0) > RIGID * values[:, :n].max()
    values, left_out = (v[:, : 2 * n][:, np.tile(elastic, 2)] for v in (values, left_out))
    n = int(elastic.sum())
    share = values[:, n : 2 * n] / values[:, :n]  # of each mode in the compliance

    # frequencies of modes with a hundredth of the mean share and more; an error of omega is half
    # that of omega^2
    heavy = share.mean(axis=0) >= 0.01 * share.mean(axis=0).sum() / n
    frequency = 0.5 * np.abs(left_out[:, :n] / values[:, :n] - 1.0)[:, heavy]
    compliance = np.sum(left_out[:, n : 2 * n] / left_out[:, :n], axis=1)
    relative = np.abs(compliance / share.sum(axis=1) - 1.0)
    return LeftOutErrors(float(frequency.max()), float(relative.max()))
