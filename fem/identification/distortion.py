"""Harmonics and combination tones: lines of a spectrum that no mode of a linear structure explains.

Joints that slip or gap answer a free decay sum_i Re[a_i exp(lambda_i t)] by forces in its products,
whose poles are sums of those of the modes: 2 lambda_i, 3 lambda_i, lambda_i + lambda_j and
lambda_i + conj(lambda_j). An identification finds them as it finds modes. Of a linear structure
with many modes some lie at such sums as well, so that frequency, decay rate and height alone name
many modes wrongly (19 % of random structures with 20 modes had one): at least one of the parents
must show by its decay that it is not linear.

A. H. Nayfeh, D. T. Mook, Nonlinear Oscillations, Wiley 1979, secs. 4.1 and 6.2.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

# Limits of a tone of two modes.
#
# On the ring-down of a bolted beam (Brake-Reuss beam, `examples/bolted_beam.py`) the three tones
# are 0.01 to 0.1 % off, decay 0.5 to 1.3 times as fast as the sum and reach 1 to 7 % of the weaker
# parent.
FREQUENCY_TOLERANCE = 1.2e-3  # relative distance: frequencies shift with the amplitude
RATE_FACTOR = 3.0  # decay rates are alike within this factor: damping varies with amplitude
MAX_HEIGHT = 0.1  # of the weaker parent's peak


def combination_tone(
    mode: int,
    frequency_hz: NDArray[np.float64],
    zeta: NDArray[np.float64],
    height: NDArray[np.float64],
    varies: NDArray[np.bool_],
) -> str | None:
    """Name of the tone of other modes that a mode is, "2 x 80.45 Hz" or "845.62 + 80.45 Hz", the
    nearest in frequency; None where it is none. Frequencies [Hz], damping ratios, peaks of the
    response in any unit, and whether damping depends on amplitude, (n,) each; `mode` is a position
    among them."""
    hz, rate = frequency_hz, zeta * frequency_hz
    strong = np.flatnonzero(height[mode] < MAX_HEIGHT * height)
    tones = [
        (k * hz[i], k * rate[i], f"{k} x {hz[i]:.2f} Hz")
        for i in strong
        if varies[i]
        for k in (2, 3)
    ]
    for i, j in combinations(strong[np.argsort(-hz[strong])], 2):
        if not (varies[i] or varies[j]):
            continue
        for sign, word in ((1, "+"), (-1, "-")):
            name = f"{hz[i]:.2f} {word} {hz[j]:.2f} Hz"
            tones.append((hz[i] + sign * hz[j], rate[i] + rate[j], name))
    near = [
        (abs(at / hz[mode] - 1), name)
        for at, decays, name in tones
        if abs(at / hz[mode] - 1) < FREQUENCY_TOLERANCE
        and 1 / RATE_FACTOR < rate[mode] / decays < RATE_FACTOR
    ]
    return min(near)[1] if near else None
