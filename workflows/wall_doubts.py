"""What in the file of a wall can be run, but was probably meant otherwise, a sentence each."""

import numpy as np

import rom
from workflows.reduced_wall import half_space
from workflows.scene import RomWall
from workflows.wall_file import loaded

COMPLIANCE = (1e-12, 1e-4)  # [m/N] of anything that a steel sphere rebounds from
LOWEST_HZ = (0.1, 50e3)
RIGID = 6  # motions of a body without stiffness
SOFT = 1 / 100  # of the next frequency: nothing bolted sways as slowly as that beside it


def doubts(wall: RomWall) -> tuple[str, ...]:
    """Weights that are no average, other units than N/m and kg, loose parts, a wall that was to
    float, a half-space larger than what holds it."""
    reduced = loaded(wall)
    modes = rom.modal(reduced)
    return (
        *_no_average(reduced),
        *_other_units(modes),
        *_loose(modes),
        *_hardly_held(modes),
        *_too_large_half_space(modes, half_space(reduced)),
    )


def _no_average(reduced: rom.ReducedModel):
    total = float(reduced.w.sum())
    modal = not np.any(reduced.K - np.diag(np.diag(reduced.K)))
    # its sign is no matter: the force enters through it as well
    if reduced.kind != "imported" or modal or abs(abs(total) - 1) < 1e-6:
        return
    yield (
        f"The weights w of wall.file sum to {total:.6g}, not to 1: they read {total:.6g} m where "
        "all its points move by 1 m. That is right for coordinates other than displacements only."
    )


def _other_units(modes: rom.ModalWall):
    compliance, elastic = rom.modal_compliance(modes), modes.omega[modes.omega > 0]
    lowest = elastic[0] / (2 * np.pi) if len(elastic) else None
    measures = (
        ("static compliance at the contact", compliance or None, COMPLIANCE, "m/N"),
        ("lowest elastic mode", lowest, LOWEST_HZ, "Hz"),
    )
    for name, value, (least, most), unit in measures:
        if value is not None and not least < value < most:
            yield (
                f"The {name} of wall.file is {value:.3g} {unit}, far from {least:g} to {most:g} "
                f"{unit} of solid walls; K is taken in N/m, M in kg, both in SI."
            )


def _loose(modes: rom.ModalWall):
    n, rigid = len(modes.omega), int(np.count_nonzero(modes.omega == 0))
    if rigid == n > 1:
        yield f"K of wall.file is zero: its {n} coordinates are loose masses."
    elif rigid > RIGID:
        yield (
            f"{rigid} of the {n} modes of wall.file have no stiffness, a body that floats has "
            f"{RIGID}: parts of it are loose."
        )


def _hardly_held(modes: rom.ModalWall):
    """A K of few digits holds a wall that floats by springs that are rounding."""
    hz = modes.omega[modes.omega > 0] / (2 * np.pi)
    steps = hz[:RIGID][: len(hz) - 1] / hz[1:][:RIGID]
    if len(steps) and steps.min() < SOFT:
        slow = int(steps.argmin())
        yield (
            f"wall.file has {slow + 1} modes up to {hz[slow]:.3g} Hz, the next is at "
            f"{hz[slow + 1]:.3g} Hz: a wall that floats, its K written with too few digits, looks "
            "so. Write 16 digits, or take it as held that softly."
        )


def _too_large_half_space(modes: rom.ModalWall, local: float):
    whole = rom.modal_compliance(modes)
    if modes.omega.all() and local > whole:
        yield (
            f"The half-space taken off is {local:.3g} m/N, more than the {whole:.3g} m/N of all of "
            "wall.file: what is left of the structure pushes back. Is wall.half_space that of its "
            "patch?"
        )
