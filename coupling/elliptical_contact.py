"""A sphere on a curved surface: the elliptical contact of Hertz as a factor on that on a plane.

With relative radii of curvature 1/R' = 1/R + 1/R_1 <= 1/R'' = 1/R + 1/R_2 and R_e = sqrt(R' R''),

    P = 4/3 E* sqrt(R_e) F2^(-3/2) delta^(3/2),
    R'/R'' = ((a/b)^2 E(e) - K(e)) / (K(e) - E(e)),    e^2 = 1 - (b/a)^2,
    sqrt(a b) = (3 P R_e / 4 E*)^(1/3) F1,
    F1^3 = 4 / (pi e^2) (b/a)^(3/2) sqrt(((a/b)^2 E - K) (K - E)),
    F2 = 2/pi sqrt(b/a) K(e) / F1.

Johnson, Contact Mechanics (1985), sec. 4.2, eqs. 4.25 to 4.28.
"""

from typing import NamedTuple

import numpy as np

ROUND = 1e-6  # of a ratio of radii: closer to 1 the ellipse is a circle
SLIMMEST = 1 - 1e-9  # e^2 of the longest ellipse, some 10^4 times as long as wide


class EllipticalContact(NamedTuple):
    """What the curvature of a struck surface makes of a sphere's Hertz contact."""

    stiffness: float  # factor on the constant k of F = k delta^(3/2) of a plane
    axes: float  # a/b of the ellipse
    size: float  # sqrt(a b) over the radius of the contact with a plane under the same force

    def longest(self, radius: float) -> float:
        """a [m], of the radius [m] of the contact with a plane."""
        return float(self.size * np.sqrt(self.axes) * radius)


PLANE = EllipticalContact(1.0, 1.0, 1.0)


def elliptical_contact(sphere_radius: float, curvatures: tuple[float, float]) -> EllipticalContact:
    """Of a sphere's radius [m] and the surface's principal curvatures [1/m], < 0 where concave.

    Raises ValueError for a surface that closes around the sphere.
    """
    relative = sorted((1 / sphere_radius + curvature for curvature in curvatures), reverse=True)
    if relative[-1] <= 0:
        raise ValueError(
            f"a sphere of radius {sphere_radius:g} m does not fit into a hollow of radius "
            f"{-1 / min(curvatures):g} m; take a smaller sphere or another face."
        )
    mean = (relative[0] * relative[1]) ** -0.5 / sphere_radius
    m, F1, F2 = _ellipse(relative[0] / relative[1])
    return EllipticalContact(
        float(mean**0.5 * F2**-1.5), float((1 - m) ** -0.5), float(mean ** (1 / 3) * F1)
    )


def _ellipse(ratio: float) -> tuple[float, float, float]:
    """e^2, F1 and F2 of relative radii R' / R'' = ratio >= 1."""
    if ratio < 1 + ROUND:
        return 0.0, 1.0, 1.0
    from scipy.optimize import brentq  # a third of a second that plane walls do not pay for
    from scipy.special import ellipk

    m = brentq(lambda m: np.log(_parts(m)[0] / _parts(m)[1] / ratio), ROUND / 10, SLIMMEST)
    slender = np.sqrt(1 - m)  # b/a
    F1 = (4 / (np.pi * m) * slender**1.5 * np.sqrt(np.prod(_parts(m)))) ** (1 / 3)
    return m, F1, 2 / np.pi * np.sqrt(slender) * ellipk(m) / F1


def _parts(m: float) -> tuple[float, float]:
    """(a/b)^2 E - K and K - E."""
    from scipy.special import ellipe, ellipk

    K, E = ellipk(m), ellipe(m)
    return E / (1 - m) - K, K - E
