"""Walls that cannot be written as independent oscillators: damping couples their modes, or the
force enters through other weights than those by which the displacement is read.

    q'' + D q' + diag(omega^2) q = g F,   u_w = h^T q + s F,   g = V^T w_force, h = V^T w_read

With h = g and D positive semidefinite the wall is passive. The scheme of the thesis, force at the
contact node and reading at nodes next to it, has h != g and makes energy out of nothing; it is here
for comparison. coupling.coupled_march runs them.
"""

from typing import NamedTuple

import numpy as np


class CoupledWall(NamedTuple):
    """k modes that a damping matrix couples, or that are pushed and read by different weights."""

    omega: np.ndarray  # (k,) [rad/s]
    D: np.ndarray  # (k, k) [1/s] modal damping
    force: np.ndarray  # (k,) [kg^-1/2] g, participations of the force
    reading: np.ndarray  # (k,) [kg^-1/2] h, participations of what is read
    residual_compliance: float  # [m/N] s

    @property
    def reciprocal(self) -> bool:
        """True if the force enters through the weights that read the displacement."""
        return bool(np.allclose(self.force, self.reading, rtol=1e-9, atol=0))
