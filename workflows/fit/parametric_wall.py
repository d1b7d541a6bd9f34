"""A reduced wall as a function of numbers of its structure, from a few that were computed.

    omega_j^2, phi_j phi_j^T, zeta_j, R_1, R_2, s  =  sum_a c_a T_a1(x_1) ... T_ad(x_d),
    |a| <= degree

Chebyshev polynomials of least squares over the bounds, logarithms of numbers that may vary by
factors. Modes are followed by their shapes (MAC against the middle wall), else by their order; what
is not followed everywhere is in the moments of the rest,

    R_m = sum phi phi^T / omega^(2 m),   m = 1, 2,

which are smooth where its modes cross; one oscillator for each contact has both of them. phi_j
(p,) of p contacts enters by its products alone, so signs of shapes do not matter. What each wall
would be missed by if it were left out follows from the least squares, e_i / (1 - h_ii) (D. M.
Allen, Technometrics 16 (1974) 125). A wall computed where the answer lies moves all polynomials
there: near it the error is of second order.

A wall is that of one chain (`dem.Wall`) or the structure behind several (`dem.space.Structure`).
"""

from collections.abc import Sequence
from itertools import product
from math import comb
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.stats import qmc

from beadwave.coupling.errors import CouplingError
from beadwave.dem import Wall
from beadwave.dem.space import Structure
from beadwave.rom import ReducedModel, modal

AnyWall = TypeVar("AnyWall", Wall, Structure)

FACTORS = 1.05  # high over low bound from which on a number varies by factors
RIGID = 1e-9  # of the largest square of a frequency: a mode without stiffness
SPANNED = 1e-10  # of the largest eigenvalue of the rest's second moment: rounding below


# Computation of walls and following of their modes; not varied systematically
OVERSAMPLED = 1.6  # walls that are computed, over coefficients of a polynomial
FOLLOWED_MAC = 0.2  # MAC of two walls' modes that are the same, at least
ORDER_MAC = 0.05  # MAC that the same place in the order counts for
N_SURFACE_POINTS = 600  # points of a surface at which shapes are compared, about


def participations(wall: Wall | Structure) -> NDArray[np.float64]:
    """(p, k) of k oscillators at p contacts."""
    return np.atleast_2d(wall.phi)


def residuals(wall: Wall | Structure) -> NDArray[np.float64]:
    """Residual compliances of a wall, in one row."""
    return np.ravel(wall.residual if isinstance(wall, Structure) else wall.residual_compliance)


def with_oscillators(
    wall: AnyWall,
    omega: NDArray[np.float64],
    zeta: NDArray[np.float64],
    phi: NDArray[np.float64],
    residual: NDArray[np.float64],
) -> AnyWall:
    """The wall with other oscillators, phi (p, k), and residual compliances in one row."""
    if isinstance(wall, Structure):
        residual = residual.reshape(wall.residual.shape)
        return wall._replace(omega=omega, zeta=zeta, phi=phi, residual=residual)
    return wall._replace(omega=omega, zeta=zeta, phi=phi[0], residual_compliance=float(residual[0]))


class ComputedWall(NamedTuple):
    """A wall that was computed: modes of the structure first, in order, then as many oscillators
    for the rest of its compliance as it has contacts."""

    wall: Wall | Structure
    shapes: NDArray[np.float64] | None = None  # (n, k) of the modes on points that all walls share


def with_rest(wall: AnyWall, reduced: ReducedModel | None) -> ComputedWall:
    """The wall with an oscillator for each contact for the modes that it leaves out, and the shapes
    of its modes; where it leaves none out an oscillator has phi = 0."""
    modes = None if reduced is None else modal(reduced)
    # a wall takes frequencies over as they are, so that its own oscillators for the rest are those
    # that equal none of the model's
    n = len(wall.omega)
    n_modes = n if modes is None else int(np.isin(wall.omega, modes.omega).sum())
    silent = len(participations(wall)) - (n - n_modes)
    if silent > 0:
        wall = with_oscillators(
            wall,
            np.append(wall.omega, np.full(silent, 10.0 * wall.omega.max())),
            np.append(wall.zeta, np.zeros(silent)),
            np.pad(participations(wall), [(0, 0), (0, silent)]),
            residuals(wall),
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


class ModesAndRest(NamedTuple):
    """A wall of p contacts: k modes one by one, and the moments of all others."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    zeta: NDArray[np.float64]  # (k,)
    phi: NDArray[np.float64]  # (p, k) [kg^-1/2]
    R: NDArray[np.float64]  # (2, p, p) [m/N, m s^2/N]
    zeta_of_rest: float
    residual: NDArray[np.float64]  # residual compliances of the wall, in one row

    def as_wall(self, like: AnyWall) -> AnyWall:
        """The modes, and last an oscillator for each contact, with the moments

            R_1 = Y Omega^2 Y^T,   R_2 = Y Y^T,

        so that its phi is omega^2 times its column of Y (`coupling.reduced_spatial_wall`); silent
        ones where the moments span less."""
        p = len(self.phi)
        omega, phi = np.full(p, self.omega.max(initial=1.0)), np.zeros((p, p))
        sizes, U = np.linalg.eigh(self.R[1])
        spanned = sizes > SPANNED * max(sizes[-1], 0.0)
        root, U = np.sqrt(sizes[spanned]), U[:, spanned]
        squares, turn = np.linalg.eigh(U.T @ self.R[0] @ U / np.outer(root, root))
        moves = squares > 0.0
        n = int(moves.sum())
        omega[:n] = np.sqrt(squares[moves])
        phi[:, :n] = squares[moves] * ((U * root) @ turn[:, moves])
        return with_oscillators(
            like,
            np.append(self.omega, omega),
            np.append(self.zeta, np.full(p, self.zeta_of_rest if n else 0.0)),
            np.hstack([self.phi, phi]),
            self.residual,
        )

    def quantities(self) -> NDArray[np.float64]:
        """Quantities that follow the polynomials: omega^2, products of phi at two contacts and zeta
        of each mode, both moments, zeta of the rest, the residual compliances."""
        i, j = np.triu_indices(len(self.phi))
        products = self.phi[i] * self.phi[j]
        of_rest = self.R[:, i, j]
        return np.concatenate(
            [self.omega**2, products.ravel(), self.zeta, of_rest.ravel(), [self.zeta_of_rest],
             self.residual]
        )  # fmt: skip


class Layout(NamedTuple):
    """Places of the quantities of k modes at p contacts."""

    k: int
    p: int

    def parts(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Of values (..., q): omega^2 (..., k), products (..., pairs, k), zeta (..., k), moments
        (..., 2, pairs), zeta of the rest (..., 1), residual compliances."""
        pairs = self.p * (self.p + 1) // 2
        sizes = [self.k, pairs * self.k, self.k, 2 * pairs, 1]
        squares, products, zeta, R, loss, residual = np.split(values, np.cumsum(sizes), axis=-1)
        products = products.reshape(*values.shape[:-1], pairs, self.k)
        return [squares, products, zeta, R.reshape(*values.shape[:-1], 2, pairs), loss, residual]

    def symmetric(self, upper: NDArray[np.float64]) -> NDArray[np.float64]:
        """Matrices (n, p, p) of their upper triangles (n, pairs)."""
        matrices = np.zeros((len(upper), self.p, self.p))
        i, j = np.triu_indices(self.p)
        matrices[:, i, j] = matrices[:, j, i] = upper
        return matrices


class ParametricWall(NamedTuple):
    """The wall at any numbers (d,) within the bounds."""

    box: Bounds
    degrees: NDArray[np.int64]  # (terms, d) of the Chebyshev polynomials in each term
    coefficients: NDArray[np.float64]  # (terms, quantities)
    layout: Layout
    missed: LeftOutErrors
    n_walls: int
    like: Wall | Structure  # the wall in the middle

    def __call__(self, theta: NDArray[np.float64]) -> Wall | Structure:
        """The wall at theta (d,); raises CouplingError where a mode has no stiffness left."""
        return self.modes_and_rest(theta).as_wall(self.like)

    def modes_and_rest(self, theta: NDArray[np.float64]) -> ModesAndRest:
        """The wall at theta (d,); raises CouplingError where a mode has no stiffness left."""
        values = polynomials(self.box.unit(theta)[None], self.degrees)[0] @ self.coefficients
        squares, products, zeta, R, (loss,), residual = self.layout.parts(values)
        if squares.min(initial=np.inf) < -RIGID * squares.max(initial=0.0):
            raise CouplingError("the structure has no stiffness there; keep away from buckling.")

        # phi of the nearest matrix of rank 1: the largest eigenvalue and its vector
        size, vector = np.linalg.eigh(self.layout.symmetric(products.T))
        phi = np.sqrt(np.maximum(size[:, -1], 0.0)) * vector[:, :, -1].T
        omega, zeta = np.sqrt(np.maximum(squares, 0.0)), np.maximum(zeta, 0.0)
        R = self.layout.symmetric(R)
        return ModesAndRest(omega, zeta, phi, R, max(float(loss), 0.0), residual)

    def through(self, theta: NDArray[np.float64], computed: ComputedWall) -> "ParametricWall":
        """The wall moved so that it gives the computed wall at theta (d,); modes that the computed
        wall lacks keep their frequencies and take no part there (phi = 0). Raises CouplingError
        where a mode has no stiffness left."""
        interpolated = self.modes_and_rest(theta)
        places, partners = nearest_modes(interpolated.omega, computed.wall)
        partner = modes_and_rest(computed.wall, partners)

        # the computed wall in the order of the interpolated one
        omega, zeta = interpolated.omega.copy(), interpolated.zeta.copy()
        phi = np.zeros_like(interpolated.phi)
        omega[places], zeta[places], phi[:, places] = partner.omega, partner.zeta, partner.phi
        exact = partner._replace(omega=omega, zeta=zeta, phi=phi)

        # the constant term alone moves: all numbers within the bounds by the same
        coefficients = self.coefficients.copy()
        moved = exact.quantities() - interpolated.quantities()
        coefficients[~self.degrees.any(axis=1)] += moved
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

    # modes of the first wall that all walls have; the others join the rest
    places = [matched_modes(walls[0], wall) for wall in walls]
    common = np.all([p >= 0 for p in places], axis=0)
    parts = [
        modes_and_rest(computed.wall, p[common]) for computed, p in zip(walls, places, strict=True)
    ]
    layout = Layout(len(parts[0].omega), len(parts[0].phi))
    values = np.array([part.quantities() for part in parts])

    # least squares, and each wall by the polynomials of the others: e_i / (1 - h_ii)
    A = polynomials(box.unit(numbers), degrees)
    coefficients, *_ = np.linalg.lstsq(A, values, rcond=None)
    leverage = np.sum(np.linalg.qr(A)[0] ** 2, axis=1)
    left_out = values - (values - A @ coefficients) / np.maximum(1.0 - leverage, 1e-3)[:, None]
    errors = left_out_errors(values, left_out, layout)
    return ParametricWall(
        box, degrees, coefficients, layout, errors, len(walls), parts[0].as_wall(walls[0].wall)
    )


def polynomials(x: NDArray[np.float64], degrees: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, terms) products of Chebyshev polynomials at x (n, d)."""
    T = np.polynomial.chebyshev.chebvander(x, degrees.max(initial=0))  # (n, d, degree + 1)
    return np.prod([T[:, i, degrees[:, i]] for i in range(x.shape[1])], axis=0)


def matched_modes(first: ComputedWall, second: ComputedWall) -> NDArray[np.int64]:
    """(k,) place in the second wall of each mode of the first, -1 of those that it lacks."""
    p = len(participations(first.wall))
    n, m = len(first.wall.omega) - p, len(second.wall.omega) - p
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
    omega: NDArray[np.float64], computed: Wall | Structure
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(k,) those of the modes omega (n,) [rad/s] that have a partner by the logarithms of the
    frequencies, and its place in the computed wall: k is n, or as many modes as that wall has."""
    n_partners = len(computed.omega) - len(participations(computed))
    partner_omega = np.maximum(computed.omega[None, :n_partners], 1e-12)
    distance = np.abs(np.log(np.maximum(omega[:, None], 1e-12) / partner_omega))
    return linear_sum_assignment(distance)  # rows ascend


def modes_and_rest(wall: Wall | Structure, places: NDArray[np.int64]) -> ModesAndRest:
    """The modes at these places (k,) of a wall, and the moments of all others.

    The damping ratio of the rest is the mean of the others weighted with the compliance. Modes
    without stiffness that have no place are left out: their compliance has no moments.
    """
    phi = participations(wall)
    rest = np.setdiff1d(np.arange(len(wall.omega)), places)
    rest = rest[wall.omega[rest] > 0]
    squares, of_rest = wall.omega[rest] ** 2, phi[:, rest]
    R = np.array([(of_rest / squares**m) @ of_rest.T for m in (1, 2)])
    share = np.sum(of_rest**2, axis=0) / squares
    loss = float(np.sum(share * wall.zeta[rest]) / share.sum()) if share.sum() > 0 else 0.0
    return ModesAndRest(
        wall.omega[places], wall.zeta[places], phi[:, places], R, loss, residuals(wall)
    )


def left_out_errors(
    values: NDArray[np.float64], left_out: NDArray[np.float64], layout: Layout
) -> LeftOutErrors:
    """Of quantities (walls, q), and of what the polynomials of the other walls give in place of
    each; modes without stiffness in some wall have no relative error. The rest counts as one mode
    more, with the ratio of its moments."""
    i, j = np.triu_indices(layout.p)

    def squares_and_shares(v: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
        """omega^2 (walls, m), and of each mode in the compliances of the contacts (walls, p, m)."""
        squares, products, _, R, _, _ = layout.parts(v)
        first, second = np.moveaxis(R[..., i == j].sum(axis=-1), 1, 0)
        of_rest = first / np.where(second > 0.0, second, 1.0)
        share = products[:, i == j][..., elastic] / squares[:, None, elastic]
        return (
            np.column_stack([squares[:, elastic], of_rest]),
            np.concatenate([share, R[:, 0, i == j, None]], axis=2),
        )

    all_squares, _, _, R, _, _ = layout.parts(values)
    elastic = all_squares.min(axis=0) > RIGID * all_squares.max()
    squares, share = squares_and_shares(values)
    squares_left_out, share_left_out = squares_and_shares(left_out)

    # frequencies of modes with a hundredth of the mean share and more; an error of omega is half
    # that of omega^2
    mean = share.mean(axis=0)
    heavy = (mean >= 0.01 * mean.sum(axis=1, keepdims=True) / len(squares.T)).any(axis=0)
    heavy[-1] &= bool(R[:, 1].any(axis=1).all())  # a wall that leaves out no mode has none of it
    frequency = 0.5 * np.abs(squares_left_out[:, heavy] / squares[:, heavy] - 1.0)
    relative = np.abs(share_left_out.sum(axis=2) / share.sum(axis=2) - 1.0)
    return LeftOutErrors(float(frequency.max()), float(relative.max()))
