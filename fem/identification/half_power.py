"""The half-power bandwidth of a measured peak, to compare with the damping ratio of the mode fitted
there.

    zeta = (f2 - f1) / (2 f_n),    |H(f1)| = |H(f2)| = |H(f_n)| / sqrt(2)

(thesis, appendix A). Where neighbours are near or lines too far apart it is off; the modes of
`fem.identification.poly_reference` are those to use.
"""

import numpy as np
from numpy.typing import NDArray


def half_power_bandwidth(
    f: NDArray[np.float64], amplitude: NDArray[np.float64], peak: int
) -> tuple[float, float]:
    """Frequency of a peak [Hz] and its bandwidth f2 - f1 [Hz]; nan where a flank does not fall to
    half of the power within the record, or another peak begins first.

    f (k,) [Hz] are evenly spaced lines, amplitude (k,) is |H| in any unit, `peak` the line of its
    largest value. Near the peak of one light mode 1/|H|^2 ~ (omega^2 - omega_n^2)^2 +
    (2 zeta omega_n omega)^2 is a parabola in the frequency: its lowest point is the peak, and where
    it has doubled are f1 and f2.
    """
    i = int(np.clip(peak, 1, len(f) - 2))
    inverse = 1 / amplitude[i - 1 : i + 2] ** 2
    curvature = inverse[0] - 2 * inverse[1] + inverse[2]
    shift = 0.5 * (inverse[0] - inverse[2]) / curvature
    lowest = inverse[1] - 0.25 * (inverse[0] - inverse[2]) * shift
    f_peak = f[i] + shift * (f[1] - f[0])
    if lowest <= 0:
        return f_peak, np.nan

    # where 1/|H|^2 first exceeds twice its value at the peak, down and up in frequency
    level, ends = 2 * lowest, []
    for step in (1, -1):
        crossing, line = np.nan, i
        while 0 < line < len(f) - 1:
            inner, outer = 1 / amplitude[line] ** 2, 1 / amplitude[line + step] ** 2
            if outer >= level:
                share = (level - inner) / (outer - inner) if outer > inner else 0.0
                crossing = float(f[line] + share * (f[line + step] - f[line]))
                break
            if outer < 0.4 * level:  # higher than the peak: another one begins
                break
            line += step
        ends.append(crossing)
    return f_peak, ends[0] - ends[1]
