"""The reduced model as packings see it: points that several contacts push and read.

    U = Phi^T q + S F,   Phi (r, k) the participations of all contacts' directions

Modes below the cutoff move one by one, and as many oscillators as there are directions stand for
the others: they have both moments of the rest between any two directions
(`coupling.reduced_spatial_wall`), so that contacts feel each other's static response. S is what
Hertz' and Mindlin's laws hold already, taken off each contact for itself: response between contacts
is none of a half-space's own.
"""

import numpy as np
from numpy.typing import ArrayLike

from beadwave.coupling.damping import Damping, damping_ratios, matrix_ratios
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.reduced_spatial_wall import modes_and_oscillators
from beadwave.dem.shakers import ShakerForces
from beadwave.dem.space import MOVING, Packing, Structure
from beadwave.rom import ReducedModel


def structure_of(
    reduced: ReducedModel,
    W: ArrayLike,
    point: ArrayLike,
    direction: ArrayLike,
    half_space: ArrayLike,
    *,
    damping: Damping | None = None,
    cutoff_hz: float | None = None,
    shakers: ShakerForces | None = None,
) -> Structure:
    """The structure of a reduced model whose coordinates the contacts' directions load by W (q, r),
    and s shakers by columns behind these; `point` (r,) is whose direction (r, 3) each is, from 0.

    half_space (p, 2) [m/N], normal and tangential, is taken off each point. damping and cutoff_hz
    as in `wall_from_reduced`. Raises CouplingError.
    """
    omega, phi, _, D = modes_and_oscillators(reduced, np.asarray(W, float), cutoff_hz)
    phi, load = np.split(phi, [len(np.asarray(point))], axis=1)
    zeta = damping_ratios(damping, omega) + matrix_ratios(D, omega)
    return Structure(
        omega,
        zeta,
        np.ascontiguousarray(phi.T),
        np.asarray(point, np.int64),
        np.asarray(direction, float),
        -np.asarray(half_space, float),
        load=None if shakers is None else load,
        shakers=shakers,
    )


def require_answer(packing: Packing, structure: Structure, velocity: ArrayLike) -> None:
    """Raise CouplingError unless contact and structure in series answer every approach, and every
    way across where the contact rubs, by one force: 1/k + s > 0 up to the force of a contact that
    takes all energy of the fastest sphere, on top of what presses it at rest."""
    speed = max(float(np.linalg.norm(velocity, axis=1).max(initial=0.0)), packing.fastest_drive)
    for c in np.flatnonzero(packing.pairs[:, 1] <= MOVING):
        energy = 0.5 * packing.mass.max() * speed**2
        deepest = (2.5 * energy / packing.A[c]) ** 0.4 + max(float(packing.overlap[c]), 0.0)
        if deepest == 0.0:
            continue
        soft = [1.0 / (1.5 * packing.A[c] * np.sqrt(deepest))]
        rubbing = packing.springs
        if rubbing is not None and c in rubbing.contact:
            modulus, _, radius = (x[rubbing.contact == c][0] for x in rubbing.law)
            soft.append(1.0 / (2.0 * modulus * np.sqrt(radius * deepest)))
        for softness, s in zip(
            soft, structure.residual[MOVING - packing.pairs[c, 1]], strict=False
        ):
            if softness + s <= 0.0:
                raise CouplingError(
                    f"a contact of {softness:.3g} m/N at its largest force and a residual "
                    f"compliance of {s:.3g} m/N leave no unique force; enlarge the patch"
                )
