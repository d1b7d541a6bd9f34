"""The elastic law of many contacts at once, for states at rest and estimates: F = A phi(delta).

The formulas are those of `dem.kernels.laws`, which run here uncompiled on arrays; Hertz' law has
its own in `dem.spheres`. A table becomes a piecewise cubic that keeps its monotony (F. N. Fritsch,
R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238): the force has a continuous stiffness, and the
energy is its exact integral.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.dem.checks import require
from beadwave.dem.kernels import laws
from beadwave.dem.kernels.arguments import Array, ForceShape, ForceTable
from beadwave.dem.spheres import hertz_energy, hertz_overlap, hertz_stiffness


class ElasticLaw(NamedTuple):
    """F = A phi(delta) of contacts, (..., n_contacts) each; Hertz' without parameters and table."""

    A: Array  # [N/m^n], or a factor on the table
    # by the names of `laws.SHAPE_PARAMETERS`, as the exponent n of phi = delta^n
    parameters: Mapping[str, Array] = {}
    table: ForceTable | None = None

    @property
    def name(self) -> str | None:
        """The law of `laws.ELASTIC_LAWS` that has just these parameters, or the table; None for
        Hertz' law, and where parameters and table belong to no law together."""
        names = set(self.parameters)
        for name, law in laws.ELASTIC_LAWS.items():
            tabulated = law.number == laws.TABLE
            if names == {p.name for p in law.parameters} and tabulated == (self.table is not None):
                return name
        return None

    @property
    def shape(self) -> ForceShape | None:
        """Shape of the force that kernels take in addition to A, parameters (n_parameters, ...,
        n_contacts); None for Hertz' law."""
        if self.name is None:
            return None
        law = laws.ELASTIC_LAWS[self.name]
        parameters = np.zeros((0, 0))
        if law.parameters:
            rows = (np.asarray(self.parameters[p.name], float) for p in law.parameters)
            parameters = np.stack(np.broadcast_arrays(*rows))
        return ForceShape(law.number, parameters, self.table or ForceTable(*np.zeros((6, 0))))

    @property
    def opening(self) -> float:
        """Power a with which the force of a contact sets in, F ~ t^a: the smallest of all."""
        return laws.opening(self.shape)

    def at(self, contacts: object) -> "ElasticLaw":
        """The law of some contacts: an index or a slice of the last axis, (..., n_contacts)."""
        of_these = {
            name: np.asarray(values)[..., contacts] for name, values in self.parameters.items()
        }
        return ElasticLaw(np.asarray(self.A)[..., contacts], of_these, self.table)

    def force(self, overlap: ArrayLike) -> Array:
        """Force [N] at an overlap >= 0 [m] that broadcasts against A (..., n_contacts), as do
        overlaps, forces and energies of the methods below."""
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
        """Overlap [m] under a force >= 0 [N], the inverse of `force`."""
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
        """Overlap [m] at which a contact holds an energy [J]: of a table the upper end of a
        bracket that was halved 60 times, for upper bounds."""
        if self.shape is None:
            return (2.5 * np.asarray(energy, float) / self.A) ** 0.4
        return self._each(laws.shape_overlap_of_energy, np.asarray(energy, float) / self.A)

    def by_parameters(self, overlap: Array) -> Array:
        """Derivatives of the force at an overlap (n_contacts,) by the law's parameters,
        (n_parameters, n_contacts); 0 where a contact is open."""
        shape = self.shape
        derivative = np.zeros((len(self.parameters), overlap.size))
        for j, i in np.ndindex(derivative.shape):
            if overlap[i] > 0.0:
                by = laws.shape_by_parameter.py_func(j, i, overlap[i], shape)[0]
                derivative[j, i] = self.A[i] * by
        return derivative

    def fold(self, compliance: float) -> Array:
        """Overlap [m] at which 1 + s k = 0 for a spring s < 0 in series, beyond which no force
        answers; inf for s >= 0."""
        if compliance >= 0.0:
            return np.full(np.shape(self.A), np.inf)
        if self.shape is None:
            return (2.0 / (3.0 * compliance * self.A)) ** 2
        steepest = -1.0 / (compliance * np.asarray(self.A, float))
        return self._each(laws.shape_fold, steepest)

    def _each(self, formula, values):
        """A formula of `laws`, uncompiled, at every value (..., n_contacts) with the parameters
        of its contact."""
        formula, shape = getattr(formula, "py_func", formula), self.shape
        values = np.asarray(values, float)
        if laws.ELASTIC_LAWS[self.name].on_arrays:  # contact 0 has the parameters of all
            return formula(0, values, shape._replace(parameters=shape.parameters[:, None]))

        def at(value, *parameters):
            of_contact = np.array(parameters).reshape(-1, 1)
            return formula(0, value, shape._replace(parameters=of_contact))

        each = np.vectorize(at, otypes=[float])
        return each(values, *shape.parameters) if values.size else np.zeros(values.shape)


def elastic_law(contact: "ElasticLaw | ArrayLike") -> ElasticLaw:
    """A law as it is; numbers, (..., n_contacts) or one, as the coefficient A of Hertz' law."""
    return contact if isinstance(contact, ElasticLaw) else ElasticLaw(np.asarray(contact, float))


def force_table(overlap: ArrayLike, force: ArrayLike) -> ForceTable:
    """A table of forces (m,) [N] over overlaps (m,) [m] as a piecewise cubic through all its rows
    that grows wherever they do (Fritsch and Carlson); straight on behind the last one.

    Raises InvalidChain for fewer than 3 rows, for numbers that are not finite, and where a column
    does not start at 0 and grow from row to row.
    """
    # checked row by row, so that the sentence names the row
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
            f"the step of a table to row {bad.min(initial=10**9) + 2} is too small for its "
            "force; leave the row out",
        )

    # energy of each piece, the integral of its cubic
    h = np.diff(overlap)
    energy = h * (force[:-1] + h * (slope / 2.0 + h * (square / 3.0 + cube * h / 4.0)))

    # behind the last knot a straight line of the slope that the last cubic ends with
    end = slope[-1] + h[-1] * (2.0 * square[-1] + 3.0 * cube[-1] * h[-1])
    end = max(end, 1e-3 * force[-1] / overlap[-1])
    return ForceTable(
        overlap, force, np.append(slope, end), np.append(square, 0.0), np.append(cube, 0.0),
        np.append(0.0, np.cumsum(energy)),
    )  # fmt: skip
