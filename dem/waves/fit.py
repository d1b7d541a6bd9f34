"""Overlapping waves in the record of one sphere, separated by a least-squares fit of their shape.

    v(t) = v_0 + sum_j  p_j s(c_j (t - t_j)) + d_j S(c_j (t - t_j))

s is the velocity in a solitary wave and S, from 0 to 1, the displacement (`dem.waves.solitary`).
p_j [m/s] is the peak of a wave that passes and leaves the sphere at rest; d_j [m/s] is the velocity
that a wave leaves behind, as in a last sphere that nothing stops. t_j, c_j by the method of
Levenberg and Marquardt (D. W. Marquardt, J. SIAM 11 (1963) 431), p_j, d_j, v_0 linearly for each
trial of them (variable projection: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413).
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.waves.arrivals import Arrival
from beadwave.dem.waves.solitary import ENDS, WIDTH, displacement_shape, velocity_shape

# Fit of overlapping waves; ranges are not on record
# rms residual over the largest velocity, below which d_j = 0 is kept
PURE_RESIDUAL = 0.015
REACH = 1.5  # how much record is fitted on either side of a group of waves, in widths
MAX_GROUP = 6  # waves that are fitted together
SPEED_BOUNDS = (0.4, 2.5)  # bounds of the fitted c_j over the guessed one
MAX_SHIFT = 1.5  # spheres by which a crest moves at most
MAX_ROUNDS = 60  # iterations of Levenberg and Marquardt, at most
QUOTIENT_STEP = 1e-5  # of the difference quotients of the Jacobian, in the scaled unknowns z


class Guess(NamedTuple):
    """Time at which a wave passes a sphere by its track, and the speed of the sphere then."""

    time: float  # [s]
    peak_velocity: float  # [m/s]
    width: float  # [s] full width at half maximum


class WaveFit(NamedTuple):
    """Waves fitted to one stretch of a record, and the misfit of their sum.

    The quality of an arrival is 1 - (rms of the residual within a width of it) / (its peak
    velocity), at least 0: above 0.95 it is a solitary wave, below 0.7 something else.
    """

    arrivals: tuple[Arrival, ...]
    misfit: float  # rms of the residual over the largest peak


def groups(guesses: Iterable[Guess]) -> list[list[Guess]]:
    """Guesses in order of time; those whose stretches of the record overlap share a list.

    A list of more than `largest_group` waves is split at its widest gap, again and again.
    """
    together = []
    for guess in sorted(guesses):
        last = together[-1][-1] if together else None
        if last is not None and apart(last, guess) < 2.0 * REACH:
            together[-1].append(guess)
        else:
            together.append([guess])

    # the queue holds the groups that are still to be split, the earliest last
    small, queue = [], together[::-1]
    while queue:
        group = queue.pop()
        if len(group) <= MAX_GROUP:
            small.append(group)
        else:
            k = int(np.argmax([apart(first, second) for first, second in pairwise(group)])) + 1
            queue += [group[k:], group[:k]]
    return small


def apart(first: Guess, second: Guess) -> float:
    """Distance of two crests in the mean of their widths."""
    return 2.0 * abs(second.time - first.time) / (first.width + second.width)


def fit(t: Array, v: Array, guesses: Sequence[Guess]) -> WaveFit:
    """Waves of one group fitted to the velocity v (k,) [m/s] at times t (k,) [s] around them; no
    arrivals and an infinite misfit where the record has too few samples there."""
    reach = REACH * max(guess.width for guess in guesses)
    window = (t >= guesses[0].time - reach) & (t <= guesses[-1].time + reach)
    if window.sum() < 4 * len(guesses) + 1:
        return WaveFit((), np.inf)
    t, v = t[window], v[window]
    start = np.array([(g.time, WIDTH / g.width) for g in guesses])
    size = max(np.abs(v).max(), np.finfo(float).tiny)

    # d_j = 0 first; with d_j, twice as many linear unknowns, only where that leaves a misfit
    for with_steps in (False, True):
        shapes = least_squares_shapes(t, v, start, with_steps)
        weights, residual = _weighted(t, v, shapes, with_steps)
        if np.sqrt(np.mean(residual**2)) < PURE_RESIDUAL * size:
            break

    arrivals = []
    for (t_crest, c), (p, d) in zip(shapes, weights, strict=True):
        # time and peak: of a wave that passes (|p| > |d|) those of its crest, without the other
        # waves; of one that leaves its sphere moving, the steepest rise and the velocity it leaves
        a = np.linspace(-ENDS, ENDS, 2401)
        wave = p * velocity_shape(a) + d * displacement_shape(a)
        passes = abs(p) > abs(d)
        top = int(np.abs(wave).argmax()) if passes else int(np.abs(a).argmin())
        peak = float(wave[top] if passes else p + d)

        # quality from what the fit misses within a width of the crest
        around = np.abs(t - t_crest) < WIDTH / c
        rms = float(np.sqrt(np.mean(residual[around] ** 2))) if around.any() else np.inf
        quality = max(0.0, 1.0 - rms / max(abs(peak), 1e-300))
        arrivals.append(Arrival(float(t_crest + a[top] / c), peak, float(WIDTH / c), quality))
    return WaveFit(tuple(arrivals), float(np.sqrt(np.mean(residual**2)) / size))


def _weighted(t, v, shapes, with_steps):
    """p_j, d_j (n, 2) [m/s] by linear least squares for given t_j, c_j (n, 2), and the residual
    (k,) [m/s]."""
    a = shapes[:, 1:] * (t - shapes[:, :1])
    behind = displacement_shape(a) if with_steps else np.zeros((0, len(t)))
    basis = np.vstack([velocity_shape(a), behind, np.ones_like(t)[None]]).T
    weight = np.linalg.lstsq(basis, v, rcond=None)[0]
    residual = v - basis @ weight
    return np.resize([*weight[:-1], *np.zeros(len(a))], 2 * len(a)).reshape(2, -1).T, residual


def least_squares_shapes(t, v, start, with_steps):
    """t_j, c_j (n, 2) [s, spheres/s] with the least sum of squares of the residual, where p_j, d_j
    are the best ones for each trial.

    Levenberg's and Marquardt's method in z = ((t_j - t_j0) c_j0, (c_j - c_j0) / c_j0), which are
    shifts in spheres and relative changes of speed.
    """
    scale = np.column_stack([1.0 / start[:, 1], start[:, 1]])
    z, damping = np.zeros(start.size), 1e-2

    def misfit(z):
        """Residual (k,) [m/s] at the scaled unknowns z (2 n,)."""
        return _weighted(t, v, start + scale * z.reshape(-1, 2), with_steps)[1]

    residual = misfit(z)
    for _ in range(MAX_ROUNDS):
        # (J^T J + damping diag) dz = J^T r
        steps = QUOTIENT_STEP * np.eye(z.size)
        J = np.array([(misfit(z + h) - residual) / QUOTIENT_STEP for h in steps]).T
        H = J.T @ J
        diagonal = np.diag(H) + 1e-12 * np.trace(H) + np.finfo(float).tiny
        trial = z - np.linalg.solve(H + damping * np.diag(diagonal), J.T @ residual)

        # within the bounds: a wave that wanders off would fit another one's crest
        shift, speed = trial.reshape(-1, 2).T
        low, high = SPEED_BOUNDS
        trial = np.column_stack([
            np.clip(shift, -MAX_SHIFT, MAX_SHIFT), np.clip(speed, low - 1.0, high - 1.0)
        ]).ravel()  # fmt: skip

        # nearer: less damping, towards Gauss and Newton; else more, towards steepest descent
        trial_residual = misfit(trial)
        if trial_residual @ trial_residual < residual @ residual:
            gain = residual @ residual - trial_residual @ trial_residual
            converged = gain < 1e-9 * (residual @ residual)
            z, residual, damping = trial, trial_residual, 0.3 * damping
            if converged:
                break
        else:
            damping *= 5.0
            if damping > 1e8:
                break
    return start + scale * z.reshape(-1, 2)
