"""Contact and mass of a reduced model, as fields of a file.

Until version 0.1 they stood as text among the notes, under the same names; what a file does not
say is None.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave.rom.factorisation import ReductionError
from beadwave.rom.reduced_model import Contact, MassProperties, ReducedModel


class Field(NamedTuple):
    """A field of a file: its name, how many values it has (None: any), and which are allowed."""

    name: str
    count: int | None = 1
    allowed: Callable[[np.ndarray], np.ndarray] = np.isfinite
    rule: str = "it must hold one number, leave it out"


ANY = "it must hold numbers, leave it out"
THREE = "it must hold three numbers, leave it out"
CONTACT = {
    "half_space": Field(
        "half_space_compliance_m_per_N", 1, lambda s: s >= 0, "a compliance is one number >= 0"
    ),
    "weights_read": Field("reading_weights", None, rule=ANY),
    "young": Field("surface_young_Pa", 1, lambda E: E > 0, "a modulus is one number > 0"),
    "poisson": Field(
        "surface_poisson",
        1,
        lambda nu: (nu > -1) & (nu <= 0.5),
        "Poisson's ratio is one number above -1 and up to 0.5",
    ),
    "curvatures": Field(
        "surface_curvatures_per_m", 2, rule="it must hold two numbers, leave it out"
    ),
    "modes_hz": Field("hammer_modes_hz", None, rule=ANY),
    "point": Field("contact_point_m", 3, rule=THREE),
    "direction": Field("contact_direction", 3, rule=THREE),
}
MASS = {
    "mass": Field("mass_kg"),
    "centre": Field("centre_m", 3, rule=THREE),
    "grounding": Field("grounding"),
    "captured": Field("effective_mass_captured"),
}


def known_fields(reduced: ReducedModel) -> dict[str, np.ndarray]:
    """The numbers that are known of contact and mass, by their names in a file: arrays of shape ()
    for one number and (count,) for several, in the units that the names end with."""
    numbers = {}
    for properties, fields in ((reduced.contact, CONTACT), (reduced.mass, MASS)):
        numbers |= {field.name: getattr(properties, name) for name, field in fields.items()}
    return {name: np.asarray(value) for name, value in numbers.items() if value is not None}


def contact(content: Mapping[str, object], r: int, path: str | Path) -> Contact:
    """Contact of a model of r coordinates, as a file has it; fields that the file lacks are None.

    Raises ReductionError for a field with another number of values, or with a value that its rule
    in CONTACT does not allow.
    """
    fields = Contact(**{name: _value(content, field, path) for name, field in CONTACT.items()})
    if fields.weights_read is None:
        return fields
    n = len(fields.weights_read)
    if n > r:
        raise ReductionError(f"{path}: reading_weights has {n} values for {r} coordinates.")
    # files until version 0.1 hold the weights of the boundary alone; all others are zero
    weights = np.zeros(r)
    weights[:n] = fields.weights_read
    return fields._replace(weights_read=weights)


def mass_properties(content: Mapping[str, object], path: str | Path) -> MassProperties:
    """Mass properties in a file; raises ReductionError if they are impossible."""
    return MassProperties(**{name: _value(content, field, path) for name, field in MASS.items()})


def _value(
    content: Mapping[str, object], field: Field, path: str | Path
) -> float | tuple[float, ...] | None:
    """The number or numbers of a field, None where the file has none; raises ReductionError."""
    if field.name not in content:
        return None
    # an array, or the words of a note; what is no number becomes nan, which no field allows
    entry = content[field.name]
    values = np.ravel(entry.split() if isinstance(entry, str) else entry)
    try:
        values = values.astype(float) if values.dtype.kind in "fiuU" else np.array([np.nan])
    except ValueError:
        values = np.array([np.nan])
    counted = len(values) == field.count if field.count else len(values) > 0
    if not (counted and np.isfinite(values).all() and field.allowed(values).all()):
        raise ReductionError(f"{path}: {field.name} is {entry!r}; {field.rule}.")
    return float(values[0]) if field.count == 1 else tuple(values.tolist())
