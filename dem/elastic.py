"""The elastic law of many contacts at once, for states at rest and estimates: F = A phi(delta).

The formulas are those of `dem.kernels.laws`, which run here uncompiled on arrays; Hertz' law has
its own in `dem.spheres`. A table becomes a piecewise cubic that keeps its monotony (F. N. Fritsch,
R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238): the force has a continuous stiffness, and the
energy is its exact integral.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dem.checks import require
from dem.kernels import laws
from dem.kernels.arguments import Array, ForceTable, Shape
from dem.spheres import hertz_energy, hertz_overlap, hertz_stiffness

EXPONENTS = (1.0, 4.0)  # of a power law: below 1 a contact is infinitely stiff at first touch


class ElasticLaw(NamedTuple):
    """F = A phi(delta) of contacts, (..., n_contacts) each; without exponent and table Hertz'."""

    A: Array  # [N/m^n], or a factor on the table
    exponent: Array | None = None  # n of phi = delta^n
    table: ForceTable | None = None

    @property
    def shape(self) -> Shape | None:
        """What kernels take beside A, None for Hertz' law."""
        if self.exponent is not None:
            return Shape(np.ascontiguousarray(self.exponent, float), ForceTable(*np.zeros((6, 0))))
        return None if self.table is None else Shape(None, self.table)

    @property
    def opening(self) -> float:
        """Power a with which the force of a contact sets in, F ~ t^a: the smallest of all."""
        if self.table is not None:
            return 1.0
        return 1.5 if self.exponent is None else float(np.min(self.exponent, initial=np.inf))

    def at(self, contacts: object) -> "ElasticLaw":
        """The law of some contacts, an index of the last axis."""
        exponent = None if self.exponent is None else np.asarray(self.exponent)[..., contacts]
        return ElasticLaw(np.asarray(self.A)[..., contacts], exponent, self.table)

    def force(self, overlap: ArrayLike) -> Array:
        """Force [N] at an overlap >= 0 [m]."""
        overlap = np.asarray(overlap, float)
        if self.shape is None:
            return self.A * overlap * np.sqrt(overlap)
        return self.A * self._each(laws.shape_force, overlap)

    def stiffness(self, overlap: ArrayLike) -> Array:
        """dF/d delta [N/m] at an overlap [m]."""
        if self.shape is None:
            return hertz_stiffness(overlap, self.A)
        return self.A * self._each(laws.shape_slope, overlap)

    def overlap(self, force: ArrayLike) -> Array:
        """Overlap [m] under a force >= 0 [N]."""
        if self.shape is None:
            return hertz_overlap(force, self.A)
        return self._each(laws.shape_overlap, np.asarray(force, float) / self.A)

    def energy(self, force: ArrayLike) -> Array:
        """Elastic energy [J] under a force [N]."""
        if self.shape is None:
            return hertz_energy(force, self.A)
        return self.A * self._each(laws.shape_energy, self.overlap(force))

    def hertz(self, force: ArrayLike) -> Array:
        """A [N/m^1.5] of the Hertz contact that has the same overlap under a force [N], 1 N where
        it is 0: for what is known of Hertz contacts alone, as the shape of their waves."""
        if self.shape is None:
            return self.A
        force = np.where(np.asarray(force, float) > 0.0, force, 1.0)
        return force / self.overlap(force) ** 1.5

    def overlap_of_energy(self, energy: ArrayLike) -> Array:
        """Overlap [m] at which a contact holds an energy [J], to 1e-3 of it, and above."""
        if self.shape is None:
            return (2.5 * np.asarray(energy, float) / self.A) ** 0.4
        if self.exponent is not None:
            power = np.asarray(self.exponent) + 1.0
            return (power * np.asarray(energy, float) / self.A) ** (1.0 / power)

        # U grows with the overlap: a bracket, then halved
        share = np.asarray(energy, float) / self.A
        high = np.full(share.shape, self.table.overlap[-1])
        while (short := self._each(laws.shape_energy, high) < share).any():
            high = np.where(short, 2.0 * high, high)
        low = np.zeros_like(high)
        for _ in range(60):
            middle = 0.5 * (low + high)
            short = self._each(laws.shape_energy, middle) < share
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return high

    def fold(self, compliance: float) -> Array:
        """Overlap [m] at which 1 + s k = 0 for a spring s < 0 in series, beyond which no force
        answers; inf for s >= 0."""
        if compliance >= 0.0:
            return np.full(np.shape(self.A), np.inf)
        if self.shape is None:
            return (2.0 / (3.0 * compliance * self.A)) ** 2
        steepest = -1.0 / (compliance * np.asarray(self.A, float))
        if self.exponent is not None:
            n = np.asarray(self.exponent, float)
            with np.errstate(divide="ignore", over="ignore"):
                return (steepest / n) ** (1.0 / (n - 1.0))

        # the slope b + 2 c x + 3 d x^2 behind a knot reaches the steepest at the lesser root x > 0,
        # written without the difference of its two terms; behind the last knot it is constant
        knots, b, c, d = (self.table.overlap, *self.table[2:5])
        missing = steepest[..., None] - b
        with np.errstate(divide="ignore", invalid="ignore"):
            x = missing / (c + np.sqrt(c**2 + 3.0 * d * missing))
        x = np.where(missing <= 0.0, 0.0, x)
        reached = (x >= 0.0) & (x <= np.append(np.diff(knots), 0.0))
        return np.where(reached, knots + x, np.inf).min(axis=-1)

    def _each(self, shape, values):
        """`shape` of `laws` at every value, beside the exponents or the table."""
        if self.exponent is not None:
            exponent = np.asarray(self.exponent, float)[None]  # contact 0 has all of them
            return shape.py_func(0, np.asarray(values, float), exponent, None)
        each = np.vectorize(lambda value: shape.py_func(0, value, None, self.table), otypes=[float])
        return each(values) if np.size(values) else np.zeros(np.shape(values))


def elastic_law(contact: "ElasticLaw | ArrayLike") -> ElasticLaw:
    """A law as it is, a number as the coefficient A of Hertz' law."""
    return contact if isinstance(contact, ElasticLaw) else ElasticLaw(np.asarray(contact, float))


def force_table(overlap: ArrayLike, force: ArrayLike) -> ForceTable:
    """A table of forces [N] over overlaps [m] as a piecewise cubic; both start at 0 and grow.

    Raises InvalidChain.
    """
    overlap, force = np.array(overlap, float), np.array(force, float)
    require(
        overlap.ndim == 1 and overlap.shape == force.shape and overlap.size >= 3,
        f"a table of forces has {np.size(overlap)} overlaps and {np.size(force)} forces; give as "
        "many of both, 3 or more",
    )
    for name, values, unit in (("overlap", overlap, "m"), ("force", force, "N")):
        bad = np.flatnonzero(~np.isfinite(values))
        require(not bad.size, f"row {bad.min(initial=10**9) + 1} of a table has a {name} that is "
                "not a finite number; correct it")  # fmt: skip
        require(
            values[0] == 0.0,
            f"a table of forces starts at the {name} {values[0]:g} {unit}; start it at 0, 0",
        )
        falls = np.flatnonzero(np.diff(values) <= 0.0)
        if falls.size:
            i = int(falls[0])
            require(
                False,
                f"the {name} of a table goes from {values[i]:g} to {values[i + 1]:g} {unit} in row "
                f"{i + 2}; it must grow from row to row",
            )

    from scipy.interpolate import PchipInterpolator  # a tenth of a second

    with np.errstate(all="ignore"):
        cube, square, slope, _ = PchipInterpolator(overlap, force).c
    for values in (cube, square, slope):
        bad = np.flatnonzero(~np.isfinite(values))
        require(
            not bad.size,
            f"the step of a table to row {bad.min(initial=10**9) + 2} is too small beside its "
            "force; leave the row out",
        )
    h = np.diff(overlap)
    energy = h * (force[:-1] + h * (slope / 2.0 + h * (square / 3.0 + cube * h / 4.0)))

    # behind the last knot a straight line of the slope that the last cubic ends with
    end = slope[-1] + h[-1] * (2.0 * square[-1] + 3.0 * cube[-1] * h[-1])
    end = max(end, 1e-3 * force[-1] / overlap[-1])
    return ForceTable(
        overlap, force, np.append(slope, end), np.append(square, 0.0), np.append(cube, 0.0),
        np.append(0.0, np.cumsum(energy)),
    )  # fmt: skip
