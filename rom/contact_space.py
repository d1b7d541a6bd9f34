"""A Krylov space of a contact: how large it becomes, and its Ritz pairs (`rom.contact_modes`)."""

from typing import NamedTuple

import numpy as np

from beadwave.rom.lanczos import EigenPairs


class KrylovOptions(NamedTuple):
    """Size of a Krylov space at a contact, and limits of its static Ritz pairs."""

    converged: float = 5e-3  # bound of the space's own error where a number of modes is wanted
    share: float = 0.3  # of a wanted error, for the space; the choice among its modes has the rest
    exact: float = 1e-8  # bound where it stands for the full model: far below any stated error
    extra: int = 20  # vectors of a space for the full model more than the reduced model has modes
    check: int = 5  # vectors between two looks at the bound, each an eigenproblem of H
    largest: int = 1000  # vectors: of a solid far more than any chain notices
    # share of a vector's length that is new, below which the space holds all that the loads move
    exhausted: float = 1e-10
    # times to_hz: vectors that resonate above it serve as static shapes, as they would cost steps
    reach: float = 2.5
    # random loads in addition to w where modes are asked for: of a rig of 49 000 unknowns 4, 8 and
    # 16 columns took 6.2, 5.6 and 6.3 s to 30 modes, a solution of 8 costing twice that of one
    random: int = 7
    # residual of a Ritz pair relative to theta from which on it is a mode: its frequency is then
    # right to rounding (its error is the square of this), its shape to this over the gap to the
    # next
    mode: float = 1e-8


class Space(NamedTuple):
    """Ritz pairs that hold the static response between them, and a bound of the relative rms error
    of the receptance up to to_hz that a model of all of them has.

    pairs omega (k,) [rad/s], phi (n, k) mass-normalised: those known before come first, the others
    after them from the highest down. residual (k,) is what each pair misses of
    K^-1 M phi = phi / omega^2, relative; 0 of those known before.
    """

    pairs: EigenPairs
    bound: float
    to_hz: float  # [Hz]
    residual: np.ndarray

    @property
    def modes(self) -> EigenPairs:
        """The lowest pairs, all of which are modes of the structure to rounding."""
        omega, phi = self.pairs
        order = np.argsort(omega)
        n = converged(self.residual[order], KrylovOptions().mode)
        return EigenPairs(omega[order[:n]], phi[:, order[:n]])


def converged(residual: np.ndarray, tolerance: float) -> int:
    """Number of first residuals (k,) that are all within the tolerance."""
    return int(np.argmax(np.append(residual > tolerance, True)))
