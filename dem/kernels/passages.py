"""The incident wave and the first reflected one of many records; see `dem.waves.arrivals`."""

import math

from dem.kernels.arguments import Array
from dem.kernels.compiled import ieee, ieee_march


@ieee
def crest_between(v: Array, sign: float, first: int, end: int) -> tuple[float, float]:
    """Place [samples] and height of the crest of sign * v within first..end - 1; nan where it
    lies at an end of the record."""
    k = first
    for i in range(first, end):
        if sign * v[i] > sign * v[k]:
            k = i
    if k == 0 or k == v.size - 1:
        return math.nan, math.nan
    before, top, after = sign * v[k - 1], sign * v[k], sign * v[k + 1]
    curvature = before - 2.0 * top + after
    if curvature >= 0.0:
        return float(k), sign * top
    offset = 0.5 * (before - after) / curvature
    return k + offset, sign * (top - 0.25 * (before - after) * offset)


@ieee_march
def fill_passages(v: Array, threshold: float, out: Array) -> None:
    """Of every record v (m, k): place [samples] and height of the incident wave, then of the first
    reflected one after it, into out (m, 4); nan for what there is not."""
    for row in range(v.shape[0]):
        one = v[row]
        largest = 0.0
        for k in range(one.size):
            largest = max(largest, abs(one[k]))
        level = threshold * largest
        out[row, :] = math.nan
        if not largest > 0.0:
            continue
        first, sign = 0, 0.0
        for k in range(one.size + 1):
            here = 2.0
            if k < one.size:
                here = 0.0
                if abs(one[k]) >= level:
                    here = 1.0 if one[k] > 0.0 else -1.0
            if k > 0 and here != sign:
                seek = 1.0 if math.isnan(out[row, 0]) else -1.0
                if sign == seek:
                    place, height = crest_between(one, sign, first, k)
                    if not math.isnan(place):
                        column = 0 if seek > 0.0 else 2
                        out[row, column], out[row, column + 1] = place, height
                first = k
            sign = here
            if not math.isnan(out[row, 2]):
                break
