"""The error of a march from a coarser one (L. F. Richardson, Phil. Trans. A 210 (1911) 307).

An error C h^p makes marches by steps H > h differ by d = C (H^p - h^p), so that of the finer is

    C h^p = d / ((H/h)^p - 1)
"""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", float, NDArray[np.float64])


def richardson(difference: Number, ratio: Number, order: Number) -> Number:
    """Error of the finer of two marches, or array of them, from their difference, the ratio H/h of
    their steps and the order p of the error."""
    return difference / (ratio**order - 1.0)
