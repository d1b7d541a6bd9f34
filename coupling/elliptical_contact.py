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


class EllipticalContact(NamedTuple):
    """A sphere's Hertz contact on a curved surface, relative to that on a plane."""

    stiffness: float  # factor on the constant k of F = k delta^(3/2) of a plane
    axes: float  # a/b of the ellipse
    size: float  # sqrt(a b) over the radius of the contact with a plane under the same force

    def longest(self, radius: float) -> float:
        """Longer half axis a [m], from the radius [m] of the contact with a plane under the same
        force."""
        return float(self.size * np.sqrt(self.axes) * radius)


PLANE = EllipticalContact(1.0, 1.0, 1.0)


def elliptical_contact(sphere_radius: float, curvatures: tuple[float, float]) -> EllipticalContact:
    """The contact of a sphere of a radius [m] with a surface of two principal curvatures [1/m],
    negative where it is concave; a circle where they are alike to 1e-6 of the relative curvature.

    Raises ValueError for a hollow that is not wider than the sphere.
    """
    R_inverse = sorted((1 / sphere_radius + curvature for curvature in curvatures), reverse=True)
    if R_inverse[-1] <= 0:
        raise ValueError(
            f"a sphere of radius {sphere_radius:g} m does not fit into a hollow of radius "
            f"{-1 / min(curvatures):g} m; take a smaller sphere or another face."
        )
    R_e = (R_inverse[0] * R_inverse[1]) ** -0.5 / sphere_radius  # over the sphere's radius
    ratio = R_inverse[0] / R_inverse[1]  # of the radii R'' / R', 1 of a circle

    # m = e^2 of the ellipse, F1 and F2
    if ratio < 1 + 1e-6:
        m, F1, F2 = 0.0, 1.0, 1.0
    else:
        from scipy.optimize import brentq  # a third of a second that plane walls do not pay for
        from scipy.special import ellipe, ellipk

        def terms(m: float) -> tuple[float, float]:
            """(a/b)^2 E - K and K - E."""
            K, E = ellipk(m), ellipe(m)
            return E / (1 - m) - K, K - E

        # up to an ellipse some 10^4 times as long as wide
        m = brentq(lambda m: np.log(terms(m)[0] / terms(m)[1] / ratio), 1e-7, 1 - 1e-9)
        slender = np.sqrt(1 - m)  # b/a
        F1 = (4 / (np.pi * m) * slender**1.5 * np.sqrt(np.prod(terms(m)))) ** (1 / 3)
        F2 = 2 / np.pi * np.sqrt(slender) * ellipk(m) / F1
    return EllipticalContact(
        float(R_e**0.5 * F2**-1.5), float((1 - m) ** -0.5), float(R_e ** (1 / 3) * F1)
    )
