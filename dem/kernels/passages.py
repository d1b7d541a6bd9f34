"""The incident wave and the first reflected one of many records; see `dem.waves.arrivals`."""

import math

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.compiled import ieee, ieee_march

# relative change of velocity within which a sphere counts as free: interpolated samples of free
# spheres change by up to 1e-6. A crest stays within it for a hundredth of its rise from half height
PLATEAU = 1e-5
LASTING = 0.25  # of that rise, at least, for which a plateau lasts


@ieee
def crest_between(v: Array, sign: float, first: int, end: int) -> tuple[float, float]:
    """Place [samples] and height of the crest of sign * v, v (n,), within first..end - 1, by the
    parabola through its highest sample and both next to it; nan where that lies at an end of the
    record, since what comes before or after is unknown."""
    k = first
    for i in range(first, end):
        if sign * v[i] > sign * v[k]:
            k = i
    # a plateau begins with its first sample, see `dem.waves.arrivals.plateau`
    level = sign * v[k] * (1.0 - PLATEAU)
    start, after = k, k + 1
    while start > first and sign * v[start - 1] >= level:
        start -= 1
    while after < end and sign * v[after] >= level:
        after += 1
    half = start - 1
    while half > first and sign * v[half] >= 0.5 * sign * v[k]:
        half -= 1
    if after - start <= LASTING * (start - max(half, first)):
        start = k
    if start == 0 or start == v.size - 1:
        return math.nan, math.nan
    if start < k:
        return float(start), v[k]
    y0, y1, y2 = sign * v[k - 1], sign * v[k], sign * v[k + 1]
    curvature = y0 - 2.0 * y1 + y2
    if curvature >= 0.0:
        return float(k), sign * y1
    offset = 0.5 * (y0 - y2) / curvature
    return k + offset, sign * (y1 - 0.25 * (y0 - y2) * offset)


@ieee_march
def fill_passages(v: Array, threshold: float, out: Array) -> None:
    """Of every record v (m, k): place [samples] and height of the incident wave, then of the first
    reflected one after it, into out (m, 4); nan for what there is not. A wave is a run of samples
    of one sign that are at least `threshold` times the largest of the record."""
    for row in range(v.shape[0]):
        record = v[row]
        largest = 0.0
        for k in range(record.size):
            largest = max(largest, abs(record[k]))
        level = threshold * largest
        out[row, :] = math.nan
        if not largest > 0.0:
            continue
        # runs of samples above the level, of one sign: the first positive one is the incident wave,
        # the first negative one after it the reflected one
        first, sign = 0, 0.0
        for k in range(record.size + 1):
            sign_now = 2.0  # unlike any sign, ends the last run
            if k < record.size:
                sign_now = 0.0
                if abs(record[k]) >= level:
                    sign_now = 1.0 if record[k] > 0.0 else -1.0
            if k > 0 and sign_now != sign:
                seek = 1.0 if math.isnan(out[row, 0]) else -1.0
                if sign == seek:
                    place, height = crest_between(record, sign, first, k)
                    if not math.isnan(place):
                        column = 0 if seek > 0.0 else 2
                        out[row, column], out[row, column + 1] = place, height
                first = k
            sign = sign_now
            if not math.isnan(out[row, 2]):
                break
