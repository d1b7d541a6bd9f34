"""A reduced model made elsewhere: what forbids it as a wall, and what was probably meant otherwise.

Other units than SI, weights that are no average, loose parts, a wall that was to float, a
half-space larger than what holds it.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from beadwave.rom.factorisation import ReductionError
from beadwave.rom.health import Health, health
from beadwave.rom.reduced_model import ModalWall, ReducedModel, modal_compliance

RIGID = 6  # motions of a body without stiffness


class Limits(NamedTuple):
    """Up to where a model is taken as a wall."""

    n_coordinates: int = 4000  # whose modes take half a minute, with the cube of their number
    size: float = 1e40  # of K, M, C, w: rigid springs of any code, with room for products
    # lowest eigenvalue of K over the largest, that rounding makes of a wall that floats
    few_digits: float = -1e-5


# Ranges of solid walls: outside of them other units or loose parts are likely
USUAL_COMPLIANCE = (1e-13, 0.1)  # [m/N] a block of steel to a ruler, clamped
USUAL_LOWEST_HZ = (0.1, 50e3)
# of several modes: waves of a chain last a tenth of a millisecond
USUAL_HIGHEST_HZ = (50.0, 1e9)
SOFTEST_RATIO = 1 / 100  # of the next frequency: nothing bolted sways as slowly as that


def sound(reduced: ReducedModel, limits: Limits = Limits()) -> Health:
    """The health of a model that can be a wall; raises ReductionError for any other. The message is
    a sentence without its subject, which the caller knows: "FILE has 5000 coordinates, ..."."""
    if len(reduced.w) > limits.n_coordinates:
        raise ReductionError(
            f"has {len(reduced.w)} coordinates, allowed are {limits.n_coordinates}; reduce it "
            "further."
        )

    # numbers whose products overflow, before anything is computed with them
    for name in ("K", "M", "C", "w"):
        A = getattr(reduced, name)
        if A is not None and np.abs(A).max() > limits.size:
            raise ReductionError(
                f"cannot be used as a wall: {name} holds {np.abs(A).max():.3g}, allowed is up to "
                f"{limits.size:g}; write it in SI."
            )

    measures = health(reduced)
    if measures.findings:
        floats = limits.few_digits < measures.lowest_stiffness < 0
        hint = " A wall that floats, written with few digits, looks so: write K with 16."
        raise ReductionError(
            f"cannot be used as a wall: {measures.findings[0]}{hint if floats else ''}"
        )
    return measures


def unusual(reduced: ReducedModel, modes: ModalWall, name: str) -> Iterator[str]:
    """Sentences on a model, called `name`, that can be run but was probably meant otherwise.

    modes are those of `modal(reduced)`. Nothing is refused here: values outside of their usual
    range are allowed, and a sentence on them in the report shows a wrong unit.
    """
    omega, hz = modes.omega, modes.omega[modes.omega > 0] / (2 * np.pi)
    compliance = modal_compliance(modes)

    # weights that are no average. Their sign is no matter, the force enters through it as well;
    # modal coordinates are no displacements
    total = float(reduced.w.sum())
    in_modes = not np.any(reduced.K - np.diag(np.diag(reduced.K)))
    if reduced.kind == "imported" and not in_modes and not abs(abs(total) - 1) < 1e-6:
        yield (
            f"The weights w of {name} sum to {total:.6g}, not to 1: they read {total:.6g} m where "
            "all its points move by 1 m. That is right for coordinates other than displacements "
            "only."
        )

    # other units than SI
    measures = (
        ("static compliance at the contact", compliance or None, USUAL_COMPLIANCE, "m/N"),
        ("lowest elastic mode", hz[0] if len(hz) else None, USUAL_LOWEST_HZ, "Hz"),
        ("highest mode", hz[-1] if len(hz) > 1 else None, USUAL_HIGHEST_HZ, "Hz"),
    )
    for what, value, (low, high), unit in measures:
        if value is not None and not low < value < high:
            yield (
                f"The {what} of {name} is {value:.3g} {unit}, far from {low:g} to {high:g} "
                f"{unit} of solid walls; K is taken in N/m, M in kg, both in SI."
            )

    # loose parts
    n, n_rigid = len(omega), int(np.count_nonzero(omega == 0))
    if n_rigid == n > 1:
        yield f"K of {name} is zero: its {n} coordinates are loose masses."
    elif n_rigid > RIGID:
        yield (
            f"{n_rigid} of the {n} modes of {name} have no stiffness, a body that floats has "
            f"{RIGID}: parts of it are loose."
        )

    # a K of few digits holds a wall that floats by springs that are rounding
    steps = hz[:RIGID][: len(hz) - 1] / hz[1:][:RIGID]
    if len(steps) and steps.min() < SOFTEST_RATIO:
        slow = int(steps.argmin())
        yield (
            f"{name} has {slow + 1} modes up to {hz[slow]:.3g} Hz, the next is at "
            f"{hz[slow + 1]:.3g} Hz: a wall that floats, its K written with too few digits, looks "
            "so. Write 16 digits, or take it as held that softly."
        )

    # more half-space than wall
    half_space = reduced.contact.half_space or 0.0
    if omega.all() and half_space > compliance:
        yield (
            f"The half-space taken off is {half_space:.3g} m/N, more than the {compliance:.3g} m/N "
            f"of all of {name}: the compliance left for the structure is negative. Is "
            "wall.half_space that of its patch?"
        )
