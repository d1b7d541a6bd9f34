"""Symmetric splittings of a chain into drift (free flight, leaf springs, wall modes: exact) and
kick (contacts), each a list of fractions of the step.

A step is kick b[0], drift a[0], kick b[1], ..., kick b[-1], a palindrome; schemes that start with
a drift have b[0] = 0. Three kinds differ in what they need to keep their order:
"nystrom" a kick that depends on positions alone (no contact damping, no dashpot wall),
"exact" the exact flow of the kick (no contact damping),
"composed" nothing, being made of symmetric drift-kick-drift steps,
"implicit" nothing either: b are fractions of the step, in each of which contacts act with their
mean force; energy is kept to rounding at any step, at the price of Newton iterations.

[1] S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313, tables 2 and 3.
[2] M. Suzuki, Phys. Lett. A 146 (1990) 319.
[3] W. Kahan, R.-C. Li, Math. Comput. 66 (1997) 1089.
"""

from typing import NamedTuple

import numpy as np

from dem.chain import Chain
from dem.checks import require
from dem.kernels.arguments import Array, Correction
from dem.walls import Wall


class Scheme(NamedTuple):
    """Fractions of the step: `a` for drifts, `b` for kicks."""

    name: str
    order: int
    a: Array
    b: Array
    kind: str
    correction: Correction | None  # for contacts that open or close

    @property
    def evaluations(self) -> int:
        """Contact force evaluations a step (implicit: Newton solutions); the last kick shares its
        forces with the next first."""
        if self.kind == "implicit":
            return self.b.size
        return self.a.size if self.b[0] else self.b.size - 2


def _palindrome(half, n):
    """The first terms of a palindrome of n terms with sum 1, completed."""
    half = np.array(half)
    rest = 1.0 - 2.0 * half.sum()
    middle = [rest] if n == 2 * half.size + 1 else [rest / 2, rest / 2]
    return np.concatenate([half, middle, half[::-1]])


def _composition(gamma, n):
    """Drift-kick-drift steps of the fractions gamma, neighbouring drifts merged."""
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


def _hurwitz(p, a):
    """zeta(-p, a) for a > 0 (Euler-Maclaurin from ten terms on)."""
    head = sum((a + k) ** p for k in range(10))
    a = a + 10
    tail = -(a ** (p + 1)) / (p + 1) + a**p / 2
    derivative = p
    for k, bernoulli in enumerate((1 / 12, -1 / 720, 1 / 30240, -1 / 1209600)):
        tail -= bernoulli * derivative * a ** (p - 1 - 2 * k)
        derivative *= (p - 1 - 2 * k) * (p - 2 - 2 * k)
    return head + tail


def _zeta_tail(b, nodes, degree=14):
    """(3, degree + 1) polynomials in 2 theta - 1, highest power first, of
    sum b zeta(-p, 2 + nodes - theta) for p = 3/2, 5/2, 7/2."""
    z = np.cos(np.pi * (np.arange(32) + 0.5) / 32)
    a = 2.0 + nodes[:, None] - 0.5 * (z + 1.0)
    sums = [b @ _hurwitz(p, a) for p in (1.5, 2.5, 3.5)]
    return np.array([np.polynomial.Polynomial.fit(z, s, degree, [-1, 1]).coef[::-1] for s in sums])


def _scheme(name, order, a, b, kind):
    if kind == "implicit":
        return Scheme(name, order, a, b, kind, None)
    if b.size < a.size:
        b = np.concatenate([[0.0], b, [0.0]])
    nodes = np.concatenate([[0.0], np.cumsum(a)])
    correction = Correction(b, nodes, _zeta_tail(b, nodes)) if order > 2 else None
    return Scheme(name, order, a, b, kind, correction)


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
    jumps = chain.dissipation.startswith("linear") and chain.yield_overlap is None
    if chain.slides:
        return "verlet"
    if stiffly_damped:
        return "energy2" if chain.yield_overlap is None else "verlet"
    if jumps:
        return "energy4"
    if chain.dissipation != "none" or chain.yield_overlap is not None:
        return "suzuki4"
    return "split4" if dashpot else "rkn6"
