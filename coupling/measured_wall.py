"""The wall of a measured driving-point receptance, what Hertz' law holds of it taken out.

    u_w = sum_j phi_j q_j + (s - A) F,   phi_j^2 = r_j,   A = (1 - nu^2) / (pi E d)

A patch of a finite-element body holds the local half-space whole: its compliance
0.6 (1 - nu^2) / (E b) is taken out. A measured response holds only what of that field reaches its
sensor: at a distance d from the hit a half-space's surface moves by (1 - nu^2) F / (pi E d)
(Boussinesq; K. L. Johnson, Contact Mechanics (1985), eq. 3.22a with z = 0). Hertz' law counts the
approach of points far from the contact, this motion among it, so A is taken out; the indentation
under the hammer's tip is not in the record and nothing is taken out for it. Of steel at 10 mm A is
1.4e-10 m/N; with the sensor behind the hit, at the far side of the part, it is 0.
"""

import numpy as np

from beadwave.dem import Wall
from beadwave.rom import ModalFit


def surface_compliance(young: float, poisson: float, distance: float) -> float:
    """A [m/N]: motion of a half-space's surface at a distance [m] from a unit force on it."""
    return (1 - poisson**2) / (np.pi * young * distance)


def measured_wall(fit: ModalFit, *, half_space: float = 0.0) -> Wall:
    """The oscillators of a fit at one point, its free mass as a mode of omega = 0 and phi^2 = 1/m,
    and its compliance less half_space [m/N]."""
    (phi,), (free,), ((compliance,),) = fit.phi, fit.free, fit.compliance
    return Wall(
        np.concatenate([0 * free, fit.omega]),
        np.concatenate([0 * free, fit.zeta]),
        np.abs(np.concatenate([free, phi])),
        float(compliance) - half_space,
    )
