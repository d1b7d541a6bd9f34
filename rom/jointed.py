"""One reduced model for structures that differ in the springs of their joints.

K(k) = K_0 + sum_j (k_j - k_0j) e_j e_j^T    e_j the elongation of a spring, kept as a coordinate
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.rom.reduced_model import ReducedModel


class Jointed(NamedTuple):
    """A reduced model that keeps the elongation of each spring in the joints as a coordinate."""

    reduced: ReducedModel
    places: dict[str, NDArray[np.int64]]  # coordinates of a spring, "joint.direction"
    stiffness: dict[str, float]  # [N/m] or [N m/rad] that the reduced model has

    def with_stiffness(self, stiffness: dict[str, float]) -> ReducedModel:
        """The structure with other springs: exact in statics, as good in its modes as the
        fixed-interface modes, which no spring changes.

        stiffness [N/m, N m/rad] by "joint.direction"; springs that are not named stay as they are.
        """
        K = self.reduced.K.copy()
        for name, k in stiffness.items():
            # each coordinate is an elongation e_j: only its diagonal changes
            at = self.places[name]
            K[at, at] += k - self.stiffness[name]
        return self.reduced._replace(K=K)
