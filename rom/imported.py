"""A reduced model made elsewhere: what forbids it as a wall, and what was probably meant otherwise.

Other units than SI, weights that are no average, loose parts, a wall that was to float, a
half-space larger than what holds it.
"""

from collections.abc import Iterator

import numpy as np

from rom.factorisation import ReductionError
from rom.health import Health, health
from rom.reduced_model import ModalWall, ReducedModel, modal_compliance

MOST_COORDINATES = 4000  # whose modes take half a minute, with the cube of their number
MOST = 1e40  # in size of K, M, C, w: rigid springs of any code, with room for products
FEW_DIGITS = -1e-5  # of the largest eigenvalue: what rounding makes of a wall that floats

COMPLIANCE = (1e-13, 0.1)  # [m/N] a block of steel to a ruler, held at one end
LOWEST_HZ = (0.1, 50e3)
HIGHEST_HZ = (50.0, 1e9)  # of several: a chain's waves last a tenth of a millisecond
RIGID = 6  # motions of a body without stiffness
SOFT = 1 / 100  # of the next frequency: nothing bolted sways as slowly as that beside it


def sound(reduced: ReducedModel) -> Health:
    """The health of a model that can be a wall; raises ReductionError for any other, in a sentence
    without its subject."""
    if len(reduced.w) > MOST_COORDINATES:
        raise ReductionError(
            f"has {len(reduced.w)} coordinates, allowed are {MOST_COORDINATES}; reduce it further."
        )
    for finding in _overflowing(reduced):
        raise ReductionError(f"cannot be used as a wall: {finding}")
    found = health(reduced)
    for finding in _unsound(found):
        raise ReductionError(f"cannot be used as a wall: {finding}")
    return found


def _overflowing(reduced: ReducedModel):
    """Numbers whose products are none any more; found before anything is computed with them."""
    for name in ("K", "M", "C", "w"):
        A = getattr(reduced, name)
        if A is not None and np.abs(A).max() > MOST:
            yield f"{name} holds {np.abs(A).max():.3g}, allowed is up to {MOST:g}; write it in SI."


def _unsound(health: Health):
    hint = " A wall that floats, written with few digits, looks so: write K with 16."
    rounding = FEW_DIGITS < health.lowest_stiffness < 0
    yield from (finding + hint * bool(rounding) for finding in health.findings)


def unusual(reduced: ReducedModel, modes: ModalWall, name: str) -> Iterator[str]:
    """Sentences on what can be run, but was probably meant otherwise, of a model by its name."""
    compliance = modal_compliance(modes)
    yield from _no_average(reduced, name)
    yield from _other_units(modes, compliance, name)
    yield from _loose(modes, name)
    yield from _hardly_held(modes, name)
    yield from _too_large_half_space(modes, compliance, reduced.contact.half_space or 0.0, name)


def _no_average(reduced: ReducedModel, name: str):
    total = float(reduced.w.sum())
    modal = not np.any(reduced.K - np.diag(np.diag(reduced.K)))
    # its sign is no matter: the force enters through it as well
    if reduced.kind != "imported" or modal or abs(abs(total) - 1) < 1e-6:
        return
    yield (
        f"The weights w of {name} sum to {total:.6g}, not to 1: they read {total:.6g} m where "
        "all its points move by 1 m. That is right for coordinates other than displacements only."
    )


def _other_units(modes: ModalWall, compliance: float, name: str):
    elastic = modes.omega[modes.omega > 0]
    lowest = elastic[0] / (2 * np.pi) if len(elastic) else None
    highest = elastic[-1] / (2 * np.pi) if len(elastic) > 1 else None
    measures = (
        ("static compliance at the contact", compliance or None, COMPLIANCE, "m/N"),
        ("lowest elastic mode", lowest, LOWEST_HZ, "Hz"),
        ("highest mode", highest, HIGHEST_HZ, "Hz"),
    )
    for what, value, (least, most), unit in measures:
        if value is not None and not least < value < most:
            yield (
                f"The {what} of {name} is {value:.3g} {unit}, far from {least:g} to {most:g} "
                f"{unit} of solid walls; K is taken in N/m, M in kg, both in SI."
            )


def _loose(modes: ModalWall, name: str):
    n, rigid = len(modes.omega), int(np.count_nonzero(modes.omega == 0))
    if rigid == n > 1:
        yield f"K of {name} is zero: its {n} coordinates are loose masses."
    elif rigid > RIGID:
        yield (
            f"{rigid} of the {n} modes of {name} have no stiffness, a body that floats has "
            f"{RIGID}: parts of it are loose."
        )


def _hardly_held(modes: ModalWall, name: str):
    """A K of few digits holds a wall that floats by springs that are rounding."""
    hz = modes.omega[modes.omega > 0] / (2 * np.pi)
    steps = hz[:RIGID][: len(hz) - 1] / hz[1:][:RIGID]
    if len(steps) and steps.min() < SOFT:
        slow = int(steps.argmin())
        yield (
            f"{name} has {slow + 1} modes up to {hz[slow]:.3g} Hz, the next is at "
            f"{hz[slow + 1]:.3g} Hz: a wall that floats, its K written with too few digits, looks "
            "so. Write 16 digits, or take it as held that softly."
        )


def _too_large_half_space(modes: ModalWall, whole: float, local: float, name: str):
    if modes.omega.all() and local > whole:
        yield (
            f"The half-space taken off is {local:.3g} m/N, more than the {whole:.3g} m/N of all of "
            f"{name}: the compliance left for the structure is negative. Is wall.half_space that "
            "of its patch?"
        )
