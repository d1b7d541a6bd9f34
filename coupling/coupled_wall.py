"""Walls that independent oscillators cannot stand for: damping that couples the modes, or a force
that enters through other weights than the displacement is read.

    q'' + D q' + diag(omega^2) q = g F,   u_w = h^T q + s F,   g = V^T w_force, h = V^T w_read

With h = g and D positive semidefinite the wall is passive. The scheme of the thesis, force at the
contact node and reading at nodes beside it, has h != g and makes energy out of nothing; it is here
for comparison. coupling.coupled_march runs them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from coupling.damping import Damping, damping_ratios
from coupling.errors import CouplingError
from coupling.wall import kept_modes, moving_modes
from dem import Wall
from rom import ModalWall, ReducedModel, modal


class CoupledWall(NamedTuple):
    """omega (k,) [rad/s]; D (k, k) [1/s] modal damping; force, reading (k,) [kg^-1/2];
    residual_compliance [m/N]."""

    omega: np.ndarray
    D: np.ndarray
    force: np.ndarray
    reading: np.ndarray
    residual_compliance: float

    @property
    def reciprocal(self) -> bool:
        """Whether the force enters through the weights that read the displacement."""
        return bool(np.allclose(self.force, self.reading, rtol=1e-9, atol=0))


def coupled_wall(
    reduced: ReducedModel,
    *,
    half_space: float,
    damping: Damping | None = None,
    cutoff_hz: float | None = None,
    w_force: ArrayLike | None = None,
    w_reading: ArrayLike | None = None,
) -> CoupledWall:
    """The wall of a reduced model with all of C, and with its own weights for force and reading.

    w_force, w_reading (n,) act on the full field, (r,) on q where the model has no basis; None is
    the contact functional of the model. Other arguments as in wall_from_reduced.
    Raises CouplingError.
    """
    modes = modal(reduced)
    own = w_force is None and w_reading is None
    kept = kept_modes(modes, reduced, cutoff_hz)
    moving = moving_modes(modes, kept, "oscillator" if own else "spring")
    force = _participation(reduced, moving, w_force)
    reading = _participation(reduced, moving, w_reading)
    D = np.diag(2 * damping_ratios(damping, moving.omega) * moving.omega)
    if moving.damping is not None:
        D = D + moving.damping
    if len(D) and np.linalg.eigvalsh(D)[0] < -1e-9 * np.abs(D).max():
        raise CouplingError("the wall's damping matrix is indefinite; it would make energy.")
    residual = 0.0 if own else _cross_compliance(reduced, modes, ~kept, w_force, w_reading)
    return CoupledWall(moving.omega, D, force, reading, residual - half_space)


def _cross_compliance(
    reduced: ReducedModel,
    modes: ModalWall,
    static: np.ndarray,
    w_force: ArrayLike | None,
    w_reading: ArrayLike | None,
) -> float:
    """Displacement read per force [m/N] in the modes that do not move."""
    static = static & (modes.omega > 0)
    force, reading = (_participation(reduced, modes, w)[static] for w in (w_force, w_reading))
    return float(np.sum(force * reading / modes.omega[static] ** 2))


def _participation(
    reduced: ReducedModel, modes: ModalWall, weights: ArrayLike | None
) -> np.ndarray:
    if weights is None:
        return modes.phi
    row = np.asarray(weights, dtype=float)
    if reduced.T is not None:
        row = row @ reduced.T
    if row.shape != reduced.w.shape:
        raise CouplingError(
            f"the weights give {row.size} values for {reduced.w.size} reduced coordinates; "
            f"hand them in on the full model, or on q where the basis is not known."
        )
    return row @ modes.vectors


def as_coupled(wall: Wall) -> CoupledWall:
    """A wall of independent oscillators in the form of this module; it may have no dashpot."""
    if wall.mobility:
        raise CouplingError("a dashpot wall has no modes to couple; march it with impact().")
    D = np.diag(2 * wall.zeta * wall.omega)
    return CoupledWall(wall.omega, D, wall.phi, wall.phi, wall.residual_compliance)
