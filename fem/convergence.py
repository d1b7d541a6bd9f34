"""Values on finer and finer meshes extrapolated to elements of size 0, f(h) = f_0 + c h^p."""

import numpy as np
from numpy.typing import NDArray


def extrapolated(
    h: NDArray[np.float64], f: NDArray[np.float64], *, orders: tuple[float, float] = (1.0, 4.0)
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """f_0 (m,) and p (m,) of f = f_0 + c h^p by sizes h (k,), values f (k, m).

    Takes three sizes, each half of the one before: of k >= 5 in the ratio sqrt 2 every second up to
    the finest, of k = 3 in the ratio 2 all. Where they give no order within `orders`, that of clamp
    lines with singular stress and that of smooth modes by quadratic elements, f_0 is the last value
    and p is nan.
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
    """Relative errors (k,) of the frequencies of a mesh; nan where they are the limit themselves,
    since no order of convergence was found."""
    return np.where(hz == limit, np.nan, hz / limit - 1)
