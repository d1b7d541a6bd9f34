"""Elements of springs and sliders for joints: Jenkins' of one, Iwan's of a continuum of them.

    Jenkins   force k z,  dz = dU,  |z| <= f / k
    Iwan      force = integral of z(s) rho(s) ds,  dz = dU,  |z(s)| <= s,  0 < s <= s_max

Segalman's element has four parameters (D. J. Segalman, J. Appl. Mech. 72 (2005) 752): the force at
which it slips as a whole F, its stiffness K without slip, and chi, beta, which say how losses grow
with the amplitude and how suddenly it slips:

    rho(s) = R s^chi + S delta(s - s_max),        b = beta + (chi + 1) / (chi + 2)
    s_max = F (1 + beta) / (K b),   R = F (chi + 1) / (s_max^(chi + 2) b),   S = F beta / (s_max b)

z is linear in pieces over s, in which the bound is a line of slope 1, so that no slider is
discretised: after a reversal all up to half of the way back slip, and the reversals that are still
remembered are the nodes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.dem.kernels.arguments import Array
from beadwave.dem.kernels.compiled import ieee, ieee_entry
from beadwave.dem.kernels.numbers import larger, smaller


class Segalman(NamedTuple):
    """Density of sliders over the displacement s at which each slips."""

    exponent: float  # chi > -1
    density: float  # R [N/m^(2 + chi)]
    last_stiffness: float  # S [N/m] of those that slip last
    last: float  # s_max [m]


class Sliders(NamedTuple):
    """Stretch z of the springs over s, linear between nodes; changed in place."""

    s: Array  # (capacity,) [m], from 0 to s_max
    z: Array  # (capacity,) [m]
    count: NDArray[np.int64]  # (1,) nodes


@ieee_entry
def slide_jenkins(z: float, way: float, stiffness: float, force: float) -> tuple[float, float]:
    """Stretch [m] of a Jenkins element of stiffness [N/m] that slips at a force [N], moved on from
    the stretch z by `way` [m]; friction's heat [J]."""
    bound = force / stiffness
    trial = z + way
    z = smaller(larger(trial, -bound), bound)
    return z, force * abs(trial - z)


@ieee
def moment(s1: float, s2: float, z1: float, z2: float, power: float) -> float:
    """Integral of z s^power over (s1, s2), of z linear in s."""
    slope = (z2 - z1) / (s2 - s1)
    p1, p2 = power + 1.0, power + 2.0
    constant = (s2**p1 - s1**p1) / p1
    return (z1 - slope * s1) * constant + slope * (s2**p2 - s1**p2) / p2


@ieee_entry
def slide_iwan(sliders: Sliders, law: Segalman, way: float) -> float:
    """Move the element by `way` [m]; friction's heat [J], never negative. Changes the sliders.

    Where more reversals are remembered than there is room for, the smallest are forgotten: z is
    then a line over their nodes.
    """
    s, z, n = sliders.s, sliders.z, sliders.count[0]
    if way == 0.0:
        return 0.0
    sign = 1.0 if way > 0.0 else -1.0
    heat = 0.0

    # sliders from 0 to where z + dU meets the bound slip: z - s does not rise with s
    k, cut, z_cut = 0, 0.0, 0.0
    for j in range(n - 1):
        e1 = sign * (z[j] + way) - s[j]
        e2 = sign * (z[j + 1] + way) - s[j + 1]
        if e1 <= 0.0:
            break
        share = 1.0 if e2 >= 0.0 else e1 / (e1 - e2)
        end = s[j] + share * (s[j + 1] - s[j])
        if end > s[j]:
            heat += law.density * moment(s[j], end, e1, e1 + share * (e2 - e1), law.exponent + 1.0)
        k, cut, z_cut = j, end, sign * end
        if share < 1.0:
            break
        k = j + 1
    excess = sign * (z[n - 1] + way) - law.last
    if excess > 0.0:
        heat += law.last_stiffness * law.last * excess

    # nodes: 0, the end of what slips, and all beyond it
    first = k + 1
    beyond = 0
    if cut < law.last:
        beyond = min(n - first, s.size - 2)
        first = n - beyond
        for i in range(beyond):
            j = i if first >= 2 else beyond - 1 - i  # from the end that is not written over
            s[2 + j], z[2 + j] = s[first + j], z[first + j] + way
    s[0], z[0], s[1], z[1] = 0.0, 0.0, cut, z_cut
    sliders.count[0] = 2 + beyond
    return heat


@ieee_entry
def iwan_force(sliders: Sliders, law: Segalman) -> float:
    """Force [N] of the element: the integral of z rho over s, piece by piece, and S z(s_max)."""
    s, z, n = sliders.s, sliders.z, sliders.count[0]
    force = law.last_stiffness * z[n - 1]
    for j in range(n - 1):
        if s[j + 1] > s[j]:
            force += law.density * moment(s[j], s[j + 1], z[j], z[j + 1], law.exponent)
    return force
