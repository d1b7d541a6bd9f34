"""Waves that overlap in the record of one sphere, taken apart by the shape that each must have.

    v(t) = v_0 + sum_j  p_j s(c_j (t - t_j)) + d_j S(c_j (t - t_j))

with the velocity s and the displacement S of a solitary wave: p_j passes, d_j stays behind, as in
a sphere that nobody stops. Least squares over t_j, c_j, p_j, d_j (K. Levenberg, D. Marquardt).
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dem.kernels.arguments import Array
from dem.waves.arrivals import Arrival
from dem.waves.solitary import ENDS, WIDTH, displacement_shape, velocity_shape

PURE = 0.015  # misfit below which nothing is taken to stay behind
REACH = 1.5  # of the record on either side of a group of waves, in widths
SLOWEST, FASTEST = 0.4, 2.5  # bounds of the fitted c_j, in the guessed one
ROUNDS = 60
MOST = 6  # waves fitted together
SMALL = 1e-5  # difference step of the scaled unknowns


class Guess(NamedTuple):
    """Where a wave is looked for."""

    time: float  # [s]
    peak_velocity: float  # [m/s]
    width: float  # [s] full width at half maximum


class Fit(NamedTuple):
    """Waves found in one stretch of a record, and how well they make it up.

    The quality of an arrival is 1 - rms of the residual within a width of it over its peak
    velocity, at least 0: above 0.95 it is a solitary wave, below 0.7 something else.
    """

    arrivals: tuple[Arrival, ...]
    misfit: float  # rms of the residual over the largest peak


def groups(guesses: Iterable[Guess]) -> list[list[Guess]]:
    """Guesses in order of time, those whose stretches of the record overlap in one list.

    Lists of more than MOST are parted at their widest gap.
    """
    together = []
    for guess in sorted(guesses):
        last = together[-1][-1] if together else None
        if last is not None and apart(last, guess) < 2.0 * REACH:
            together[-1].append(guess)
        else:
            together.append([guess])
    return [part for group in together for part in _parted(group)]


def _parted(group):
    if len(group) <= MOST:
        return [group]
    gaps = [apart(one, other) for one, other in pairwise(group)]
    k = int(np.argmax(gaps)) + 1
    return [*_parted(group[:k]), *_parted(group[k:])]


def apart(one: Guess, other: Guess) -> float:
    """Distance of two crests in the mean of their widths."""
    return 2.0 * abs(other.time - one.time) / (one.width + other.width)


def fit(t: Array, v: Array, guesses: Sequence[Guess]) -> Fit:
    """Fit of the waves of one group to the record around them."""
    reach = REACH * max(guess.width for guess in guesses)
    near = (t >= guesses[0].time - reach) & (t <= guesses[-1].time + reach)
    if near.sum() < 4 * len(guesses) + 1:
        return Fit((), np.inf)
    t, v = t[near], v[near]
    start = np.array([(g.time, WIDTH / g.width) for g in guesses])
    size = max(np.abs(v).max(), np.finfo(float).tiny)
    for steps in (False, True):
        shapes = _searched(t, v, start, steps)
        weights, residual = _weighted(t, v, shapes, steps)
        if np.sqrt(np.mean(residual**2)) < PURE * size:
            break
    arrivals = tuple(
        _arrival(t, residual, shape, w) for shape, w in zip(shapes, weights, strict=True)
    )
    return Fit(arrivals, float(np.sqrt(np.mean(residual**2)) / size))


def _weighted(t, v, shapes, steps):
    """p_j, d_j (n, 2) by linear least squares for given t_j, c_j (n, 2), and the residual."""
    a = shapes[:, 1:] * (t - shapes[:, :1])
    behind = displacement_shape(a) if steps else np.zeros((0, len(t)))
    basis = np.vstack([velocity_shape(a), behind, np.ones_like(t)[None]]).T
    weight = np.linalg.lstsq(basis, v, rcond=None)[0]
    residual = v - basis @ weight
    return np.resize([*weight[:-1], *np.zeros(len(a))], 2 * len(a)).reshape(2, -1).T, residual


def _searched(t, v, start, steps):
    """t_j, c_j (n, 2) that leave least, with the best p_j, d_j for each trial."""
    scale = np.column_stack([1.0 / start[:, 1], start[:, 1]])
    z, damping = np.zeros(start.size), 1e-2

    def misfit(z):
        return _weighted(t, v, start + scale * z.reshape(-1, 2), steps)[1]

    residual = misfit(z)
    for _ in range(ROUNDS):
        J = [(misfit(z + h) - residual) / SMALL for h in SMALL * np.eye(z.size)]
        trial = _bounded(z - _marquardt(np.array(J).T, residual, damping))
        after = misfit(trial)
        if after @ after < residual @ residual:
            done = residual @ residual - after @ after < 1e-9 * (residual @ residual)
            z, residual, damping = trial, after, 0.3 * damping
            if done:
                break
        else:
            damping *= 5.0
            if damping > 1e8:
                break
    return start + scale * z.reshape(-1, 2)


def _marquardt(J, residual, damping):
    H = J.T @ J
    own = np.diag(H) + 1e-12 * np.trace(H) + np.finfo(float).tiny
    return np.linalg.solve(H + damping * np.diag(own), J.T @ residual)


def _bounded(z):
    """Crests move by at most 1.5 spheres, speeds between SLOWEST and FASTEST."""
    z = z.reshape(-1, 2)
    return np.column_stack(
        [np.clip(z[:, 0], -1.5, 1.5), np.clip(z[:, 1], SLOWEST - 1.0, FASTEST - 1.0)]
    ).ravel()


def _arrival(t, residual, shape, weight):
    (crest, c), (p, d) = shape, weight
    a = np.linspace(-ENDS, ENDS, 2401)
    own = p * velocity_shape(a) + d * displacement_shape(a)
    top = int(np.abs(own).argmax()) if abs(p) > abs(d) else int(np.abs(a).argmin())
    peak = float(own[top] if abs(p) > abs(d) else p + d)
    near = np.abs(t - crest) < WIDTH / c
    rms = float(np.sqrt(np.mean(residual[near] ** 2))) if near.any() else np.inf
    quality = max(0.0, 1.0 - rms / max(abs(peak), 1e-300))
    return Arrival(float(crest + a[top] / c), peak, float(WIDTH / c), quality)
