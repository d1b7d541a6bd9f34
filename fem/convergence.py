"""Values on finer and finer meshes extrapolated to elements of size 0, f(h) = f_0 + c h^p.

Three meshes in the ratio r = h_1 / h_2 = h_2 / h_3 determine the three unknowns (Richardson):

    r^p = (f_1 - f_2) / (f_2 - f_3),    f_0 = f_3 - (f_2 - f_3) / (r^p - 1)
"""

import numpy as np
from numpy.typing import NDArray


def extrapolated(
    h: NDArray[np.float64], f: NDArray[np.float64], *, orders: tuple[float, float] = (1.0, 4.0)
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f_0 (m,) and p (m,) of f = f_0 + c h^p by sizes h (k,), values f (k, m).

    Sizes fall from mesh to mesh. Three of them are used, each half of the one before: all of k = 3
    sizes in the ratio 2, or every second one of the last five of k >= 5 sizes in the ratio sqrt 2.
    `orders` are the lowest and the highest order to be expected: that of singular stress at clamp
    lines, and that of smooth modes with quadratic elements. Where p lies outside, f_0 is the value
    on the finest mesh and p is nan.
    """
    h, f = (h[-5::2], f[-5::2]) if len(h) > 3 else (h, f)
    coarse, middle, fine = f
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (coarse - middle) / (middle - fine)
        order = np.log(ratio) / np.log(h[1] / h[2])
        limit = fine - (middle - fine) / (ratio - 1)
    converges = (order >= orders[0]) & (order <= orders[1])
    return np.where(converges, limit, fine), np.where(converges, order, np.nan)


def off(hz: NDArray[np.float64], limit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative errors (k,) of the frequencies hz (k,) of a mesh against their limits (k,).

    nan where both are equal: no order of convergence was found, so that the finest mesh stands for
    the limit.
    """
    return np.where(hz == limit, np.nan, hz / limit - 1)
