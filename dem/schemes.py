"""Symmetric splittings of a chain into drift (free flight, leaf springs, wall modes: exact) and
kick (contacts), each a list of fractions of the step.

    H = A + B,   exp(h (A + B)) ~ exp(b_0 h B) exp(a_0 h A) exp(b_1 h B) ... exp(b_m h B)

with the flow A of a drift and B of a kick. Each factor is the exact flow of a Hamiltonian, so the
step is symplectic: without damping its energy error stays bounded instead of growing with time.
Equal fractions read from either end (a palindrome) make the step reversible in time and its order
even. The first fractions of each list are those of the papers; the middle one follows from the sum
1. Beyond order 2 some fractions are negative (Suzuki): steps back in time, which amplify damping.

Schemes that start with a drift have b[0] = 0. Four kinds differ in what keeps their order:
"nystrom"   a kick that depends on positions alone (no contact damping, no dashpot wall): then
            [B, [B, [B, A]]] = 0, and fewer order conditions need to be met
"exact"     the exact flow of the kick (no contact damping)
"composed"  no condition: they are made of symmetric drift-kick-drift steps
"implicit"  no condition: b are fractions of the step, in each of which contacts act with their
            mean force over the move, (W(d_1) - W(d_0)) / (d_1 - d_0) of the contact's energy W; so
            energy is kept to rounding at any step, at the price of Newton iterations

[1] S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313, tables 2 and 3.
[2] M. Suzuki, Phys. Lett. A 146 (1990) 319.
[3] W. Kahan, R.-C. Li, Math. Comput. 66 (1997) 1089.
"""

from typing import NamedTuple

import numpy as np

from beadwave.dem.chain import Chain
from beadwave.dem.checks import require
from beadwave.dem.kernels.arguments import Array, Correction
from beadwave.dem.walls import Wall


class Scheme(NamedTuple):
    """Fractions of the step: `a` for drifts, `b` for kicks."""

    name: str
    order: int  # of smooth forces
    a: Array  # (n_drifts,) of sum 1; empty of implicit schemes
    b: Array  # (n_kicks,) of sum 1; of implicit schemes parts of the step
    kind: str  # nystrom, exact, composed or implicit
    correction: Correction | None  # for contacts that open or close

    @property
    def evaluations(self) -> int:
        """Contact force evaluations a step (implicit: Newton solutions); the last kick shares its
        forces with the next first."""
        if self.kind == "implicit":
            return self.b.size
        return self.a.size if self.b[0] else self.b.size - 2


def _palindrome(half, n):
    """(n,) fractions with sum 1 that read the same from either end: the first ones are `half`, the
    middle one or two follow from the sum."""
    half = np.array(half)
    middle_sum = 1.0 - 2.0 * half.sum()
    middle = [middle_sum] if n == 2 * half.size + 1 else [middle_sum / 2, middle_sum / 2]
    return np.concatenate([half, middle, half[::-1]])


def _composition(gamma, n):
    """Fractions a, b of n drift-kick-drift steps over gamma_i h, whose first are given; the half
    drifts of neighbours are merged: a_i = (gamma_i-1 + gamma_i) / 2."""
    b = _palindrome(gamma, n)
    a = 0.5 * np.concatenate([b[:1], b[1:] + b[:-1], b[-1:]])
    return a, b


# fmt: off
_BM4 = (
    _palindrome([0.245298957184271, 0.604872665711080], 6),
    _palindrome([0.0829844064174052, 0.396309801498368, -0.0390563049223486], 7),
)
_BM6 = (
    _palindrome([0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075,
                 0.357208872795928], 11),
    _palindrome([0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807,
                 -0.0115113874206879], 12),
)
_BM6A = (
    _palindrome([0.0378593198406116, 0.102635633102435, -0.0258678882665587, 0.314241403071447,
                 -0.130144459517415, 0.106417700369543, -0.00879424312851058], 15),
    _palindrome([0.09171915262446165, 0.183983170005006, -0.05653436583288827,
                 0.004914688774712854, 0.143761127168358, 0.328567693746804], 14),
)
_S4 = (
    _palindrome([0.0792036964311957, 0.353172906049774, -0.0420650803577195], 7),
    _palindrome([0.209515106613362, -0.143851773179818], 6),
)
_S6 = (
    _palindrome([0.0502627644003922, 0.413514300428344, 0.0450798897943977, -0.188054853819569,
                 0.541960678450780], 11),
    _palindrome([0.148816447901042, -0.132385865767784, 0.067307604692185, 0.432666402578175], 10),
)
_SUZUKI4 = _composition([1 / (4 - 4 ** (1 / 3))] * 2, 5)
_KAHAN_LI6 = _composition([
    0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981,
    0.082213596293550800230], 9)
_KAHAN_LI8 = _composition([
    0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641,
    0.15884190655515560090, -0.39590389413323757734, 0.18453964097831570709,
    0.25837438768632204729, 0.29501172360931029887], 17)
# fmt: on


def hurwitz_zeta(p, a):
    """zeta(-p, a) of Hurwitz, the continuation of sum_k (a + k)^p, for a > 0.

    Ten terms of the sum, the rest by the formula of Euler and Maclaurin, whose Bernoulli numbers
    B_2k / (2k)! are those of the loop.
    """
    head = sum((a + k) ** p for k in range(10))
    a = a + 10
    tail = -(a ** (p + 1)) / (p + 1) + a**p / 2
    derivative = p
    for k, bernoulli in enumerate((1 / 12, -1 / 720, 1 / 30240, -1 / 1209600)):
        tail -= bernoulli * derivative * a ** (p - 1 - 2 * k)
        derivative *= (p - 1 - 2 * k) * (p - 2 - 2 * k)
    return head + tail


def _scheme(name, order, a, b, kind, degree=14):
    """The scheme with the fractions a, b, and its correction for contacts that open or close.

    Such a contact has a force of powers p = 3/2, 5/2, 7/2 of the time since it closed, at the
    fraction theta of a step. The scheme's kicks sum this force at their nodes t, where the exact
    impulse is its integral; the difference is, as in the formula of Euler and Maclaurin for a
    singular end, a sum of Hurwitz zeta functions, sum_i b_i zeta(-p, t_i - theta) (J. N. Lyness, B.
    W. Ninham, Math. Comput. 21 (1967) 162). Kernels add its terms of two steps themselves
    (`dem.kernels.events`) and take the rest, sum_i b_i zeta(-p, 2 + t_i - theta), from polynomials
    of 2 theta - 1, fitted here at Chebyshev points.
    """
    if kind == "implicit":
        return Scheme(name, order, a, b, kind, None)
    if b.size < a.size:
        b = np.concatenate([[0.0], b, [0.0]])
    nodes = np.concatenate([[0.0], np.cumsum(a)])
    if order == 2:
        return Scheme(name, order, a, b, kind, None)

    z = np.cos(np.pi * (np.arange(32) + 0.5) / 32)
    distance = 2.0 + nodes[:, None] - 0.5 * (z + 1.0)
    sums = [b @ hurwitz_zeta(p, distance) for p in (1.5, 2.5, 3.5)]
    # (3, degree + 1), highest power first
    tail = np.array([np.polynomial.Polynomial.fit(z, s, degree, [-1, 1]).coef[::-1] for s in sums])
    return Scheme(name, order, a, b, kind, Correction(b, nodes, tail))


SCHEMES = {
    s.name: s
    for s in (
        _scheme("verlet", 2, np.array([1.0]), np.array([0.5, 0.5]), "composed"),
        _scheme("leapfrog", 2, np.array([0.5, 0.5]), np.array([1.0]), "composed"),
        _scheme("rkn4", 4, *_BM4, "nystrom"),
        _scheme("rkn6", 6, *_BM6, "nystrom"),
        _scheme("rkn6a", 6, *_BM6A, "nystrom"),
        _scheme("split4", 4, *_S4, "exact"),
        _scheme("split6", 6, *_S6, "exact"),
        _scheme("suzuki4", 4, *_SUZUKI4, "composed"),
        _scheme("kahan-li6", 6, *_KAHAN_LI6, "composed"),
        _scheme("kahan-li8", 8, *_KAHAN_LI8, "composed"),
        _scheme("energy2", 2, np.zeros(0), np.ones(1), "implicit"),
        _scheme("energy4", 4, np.zeros(0), _SUZUKI4[1], "implicit"),
    )
}


def named_scheme(
    name: str | None, chain: Chain, wall: Wall | None, *, stiffly_damped: bool = False
) -> Scheme:
    """The scheme of a name; without one the scheme that measures best. Raises InvalidChain."""
    name = name or default_scheme(chain, wall, stiffly_damped=stiffly_damped)
    require(name in SCHEMES, f"scheme {name!r} is unknown; take one of {', '.join(SCHEMES)}")
    return SCHEMES[name]


def default_scheme(chain: Chain, wall: Wall | None, *, stiffly_damped: bool = False) -> str:
    """Name of the scheme that measures best: the linear dampers jump when a contact closes, which
    only the implicit schemes average; damping faster than the contacts bears no step back in time
    and is booked right by the implicit scheme alone at steps of the contacts' size. Friction has
    no way back in time either.
    """
    dashpot = wall is not None and wall.mobility > 0.0
    jumps = chain.jumps and chain.yield_overlap is None
    if chain.slides:
        return "verlet"
    if stiffly_damped:
        return "energy2" if chain.yield_overlap is None else "verlet"
    if jumps:
        return "energy4"
    if chain.dissipation != "none" or chain.yield_overlap is not None:
        return "suzuki4"
    return "split4" if dashpot else "rkn6"
