"""The largest step with which a march means anything.

Wall modes and leaf springs are advanced exactly and set no limit; contacts do, through the linear
stability interval of the scheme: dt * omega below `stability_interval`.
"""

import numpy as np

from dem.chain import equilibrium, validate
from dem.schemes import SCHEMES, default_scheme


def fastest_rate(chain, wall, v0, static):
    """Upper estimate of the largest contact frequency [rad/s]: all kinetic energy in one contact,
    on top of the static force. Wall modes faster than the contact itself are springs to it."""
    energy = 0.5 * float(chain.mass @ np.square(v0))
    overlap = (2.5 * energy / chain.A) ** 0.4 + (static.force / chain.A) ** (2 / 3)
    stiffness = 1.5 * chain.A * np.sqrt(overlap)
    inverse = 1.0 / chain.mass
    pair = inverse[:-1] + inverse[1:]
    if wall is None:
        return float(np.sqrt((stiffness * pair).max(initial=0.0)))
    last = inverse[-1]
    for omega, phi in sorted(zip(wall.omega, wall.phi, strict=True)):
        if omega**2 > stiffness[-1] * last:
            break
        last += phi**2
    return float(np.sqrt((stiffness * np.append(pair, last)).max()))


def stability_interval(scheme):
    """Largest dt * omega for which a linear contact of frequency omega stays bounded."""
    if scheme.kind == "implicit":
        return np.inf
    z = np.arange(0.01, 12.0, 0.01)
    x, v = np.tile(np.eye(2)[:, :, None], z.size)
    for b, a in zip(scheme.b, np.append(scheme.a, 0.0), strict=True):
        v = v - b * z * x
        x = x + a * z * v
    unstable = np.abs(x[0] + v[1]) > 2.0 + 1e-9
    return float(z[unstable.argmax()]) if unstable.any() else float(z[-1])


def stability_limit(chain, wall, v0, *, scheme=None):
    """Largest meaningful step [s]; contacts that share a sphere can lower it by up to sqrt(2)."""
    validate(chain, wall, v0)
    method = SCHEMES[scheme or default_scheme(chain, wall)]
    rate = fastest_rate(chain, wall, v0, equilibrium(chain, wall))
    return stability_interval(method) / rate if rate > 0.0 else np.inf
