"""The Hertz law of the contact in series with what the wall's compliance adds to it.

    delta(F) = (F / A)^(2/3) + s F

A finite-element body loaded over a patch holds the half-space under it, and so does the Hertz law:
one of them has to go, and s may come out negative. K. L. Johnson, Contact Mechanics (1985),
sec. 3.2 and 3.4.
"""

import numpy as np

from coupling.errors import CouplingError


def largest_monotone_force(residual: float, contact_coefficient: float) -> float:
    """Force [N] up to which delta = (F/A)^(2/3) + s F grows with F; inf for s >= 0.

    d delta / dF = 2/3 A^(-2/3) F^(-1/3) + s = 0 at F = (2 / (3 |s|))^3 / A^2.
    """
    if residual >= 0:
        return np.inf
    return (2 / (3 * abs(residual))) ** 3 / contact_coefficient**2


def require_monotone(residual: float, contact_coefficient: float, largest_force: float) -> None:
    """Raise CouplingError unless the series law is monotone up to largest_force [N]."""
    limit = largest_monotone_force(residual, contact_coefficient)
    if not largest_force < limit:
        raise CouplingError(
            f"the wall's residual compliance {residual:.3g} m/N makes the contact give way above "
            f"{limit:.3g} N, below the predicted {largest_force:.3g} N; lower the cutoff frequency "
            f"or load a larger patch."
        )
