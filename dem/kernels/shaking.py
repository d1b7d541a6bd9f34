"""Harmonic forces on modes over a step: what they add to the modes, and their work."""

import math
from typing import NamedTuple

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.compiled import fastmath


class ModalShakerForces(NamedTuple):
    """m harmonic forces on k modes in each of n steps, as real and imaginary parts of
    e^(i omega t) amplitudes."""

    omega: Array  # (m,) [rad/s]
    # (n, m, 4, k) what a step adds to q and p: Re, Im of q, Re, Im of p
    response: Array
    # (n, m, 4, k) work in a step over q and p at its start: Re, Im of q's, Re, Im of p's
    work: Array
    # (n, m, m, 4) work on what the forces themselves move: Re, Im at the sum of both phases, and at
    # their difference
    mutual_work: Array
    residual: Array  # (m, 2, d) [m] of a contact's d directions besides the modes: Re, Im
    forced: Array  # (2, k) room

    def at_level(self, level: float) -> "ModalShakerForces":
        """Forces times `level`."""
        return self._replace(
            response=level * self.response, work=level * self.work,
            mutual_work=level**2 * self.mutual_work, residual=level * self.residual,
        )  # fmt: skip


@fastmath
def shake(step: int, t: float, q: Array, p: Array, shaking: ModalShakerForces) -> float:
    """Write into `forced` what the shakers add to q and p (k,) in the step from t [s] on, of
    `shaking` the one of this number; returns their work [J] in it, exact: over q and p at its
    start, and over what the shakers themselves move."""
    forced, work = shaking.forced, 0.0
    for j in range(q.size):
        forced[0, j], forced[1, j] = 0.0, 0.0
    for g in range(shaking.omega.size):
        angle = shaking.omega[g] * t
        c, s = math.cos(angle), math.sin(angle)
        r, w = shaking.response[step, g], shaking.work[step, g]
        for j in range(q.size):
            forced[0, j] += r[0, j] * c - r[1, j] * s
            forced[1, j] += r[2, j] * c - r[3, j] * s
            work += (w[0, j] * c - w[1, j] * s) * q[j] + (w[2, j] * c - w[3, j] * s) * p[j]
        for other in range(shaking.omega.size):
            w12 = shaking.mutual_work[step, g, other]
            angle2 = shaking.omega[other] * t
            work += w12[0] * math.cos(angle + angle2) - w12[1] * math.sin(angle + angle2)
            work += w12[2] * math.cos(angle - angle2) - w12[3] * math.sin(angle - angle2)
    return work
