"""Comparison of measured responses with the size that a model gives: a check of units and
sensitivities.

Of modes phi normalised to mass, the receptance of point i to a force at j has the residue

    R = phi_i phi_j / (2 i omega),    times i omega in mobilities, (i omega)^2 in accelerances

(D. J. Ewins, Modal Testing, 2nd ed., section 2.7), of light damping. What measured residues are of
these depends neither on stiffnesses that are off nor on damping: it is the mass of the model over
that of the structure, or a unit that is not what the file says.
"""

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.identification.poly_reference import IdentifiedModes

# powers of omega by which a residue differs from that of a receptance
POWERS = {"displacements": 0, "velocities": 1, "accelerations": 2}
# ratios that units called by another's name make
UNITS = {
    1 / 9.80665: "as of accelerations in g that are called m/s^2",
    9.80665: "as of accelerations in m/s^2 that are called g",
    1e3: "as of responses in mm that are called m, or forces in kN that are called N",
    1e-3: "as of responses in m that are called mm, or forces in N that are called kN",
    4.4482216: "as of forces in lbf that are called N",
    1 / 4.4482216: "as of forces in N that are called lbf",
}


NOTABLE_SCALE = 1.5  # times; two builds of one part differ in mass by less
UNIT_TOLERANCE = 0.2  # relative distance from the ratio of a unit that is named


def response_scale(
    modes: IdentifiedModes,
    quantity: str,
    at_points: NDArray[np.float64],
    at_references: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Size (n,) of the measured residues of n modes over those of the computed modes that they are
    paired with, mass-normalised shapes of which are at_points (p, n) and at_references (m, n)
    [kg^-1/2]; nan where no response sees the mode. It is the factor of least squares between the
    two matrices of residues (p, m), less its phase, i^(power - 1) of light damping."""
    omega = 2.0 * np.pi * modes.frequency_hz
    measured = np.einsum("pn,nm->npm", modes.phi, modes.participation)
    computed = np.einsum("pn,mn->npm", at_points, at_references)
    computed = computed * (0.5 * omega ** (POWERS[quantity] - 1))[:, None, None]
    size = np.sum(computed**2, axis=(1, 2))
    along = np.abs(np.sum(measured * computed, axis=(1, 2)))
    return np.where(size > 0.0, along / np.where(size > 0.0, size, 1.0), np.nan)


def remark_on_scale(scale: NDArray[np.float64]) -> str:
    """A sentence where most of the scales (n,) say that responses and model differ in size; ""
    where they do not."""
    scale = scale[np.isfinite(scale) & (scale > 0.0)]
    if not len(scale):
        return ""
    middle = float(np.median(scale))
    if 1 / NOTABLE_SCALE <= middle <= NOTABLE_SCALE:
        return ""
    distance = {words: abs(np.log(middle / ratio)) for ratio, words in UNITS.items()}
    words, nearest = min(distance.items(), key=lambda item: item[1])
    why = words if nearest < UNIT_TOLERANCE else "look at units and sensitivities, or at its mass"
    modes = "1 paired mode" if len(scale) == 1 else f"{len(scale)} paired modes"
    return f"the responses are {middle:.3g} times what the model gives at {modes}: {why}"
