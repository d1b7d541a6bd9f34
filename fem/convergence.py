"""Values on finer and finer meshes extrapolated to elements of no size, f(h) = f_0 + c h^p."""

import numpy as np
from numpy.typing import NDArray

ORDERS = 1.0, 4.0  # of clamp lines with singular stress, of smooth modes by quadratic elements


def extrapolated(
    h: NDArray[np.float64], f: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f_0 (m,) and p (m,) of f = f_0 + c h^p by every second of sizes h (k,), values f (k, m).

    Takes the finest three of them, k >= 5. Where they give no order between those of a singular and
    of a smooth mode, f_0 is the last value and p is nan.
    """
    coarse, middle, fine = f[-5::2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (coarse - middle) / (middle - fine)
        order = np.log(ratio) / np.log(h[-3] / h[-1])
        limit = fine - (middle - fine) / (ratio - 1)
    told = (order >= ORDERS[0]) & (order <= ORDERS[1])
    return np.where(told, limit, fine), np.where(told, order, np.nan)


def off(hz: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative errors (k,); nan where the mesh itself stands for a limit that none determines."""
    return np.where(hz == limit, np.nan, hz / limit - 1)
