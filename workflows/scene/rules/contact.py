"""Keys of the contact law that are each allowed but not together, a sentence each."""

from collections.abc import Iterator

import numpy as np

from beadwave.workflows.scene.tables.contact import ContactTable

MIN_YIELD_PRESSURE = 1e-6  # over Young's modulus, at least; that of lead is 1e-3


def of_yield(contact: ContactTable, where: str, young: float | tuple[float, ...]) -> Iterator[str]:
    """A sentence on contacts, of the table at the key `where`, that yield at next to no force;
    young [Pa] of the spheres."""
    if contact.law != "thornton":
        return
    found, allowed = np.min(contact.yield_pressure), MIN_YIELD_PRESSURE * np.min(young)
    if found < allowed:
        yield (
            f"{where}.yield_pressure = {found:g} Pa must be at least {allowed:g} Pa, a millionth "
            "of the spheres' young; raise it."
        )
