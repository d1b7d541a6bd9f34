"""ARR against the thickness of a plate: Zener's infinite one, and solid plates of finite elements.

The thesis tells thick walls from thin ones by whether a longitudinal wave crosses the wall and
returns within the contact. What a plate takes is carried along it by bending waves: both models
here have those, and the solid one the way through the thickness as well. Thesis, section 2.2.2.
"""

from typing import Any, NamedTuple

import numpy as np

import coupling
import dem
from workflows.evidence.prose import rendered
from workflows.evidence.thesis import plate_sizes, plates
from workflows.evidence.thesis.collision import Collision
from workflows.evidence.thesis.plate_sizes import Sizes
from workflows.evidence.thesis.requirements import FEWEST, require_chain
from workflows.evidence.thesis.thickness_figure import picture
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

RATIOS = (0.125, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)  # D/t
N_CURVE = 49  # of thicknesses on Zener's curve
CHECKED = 4.0  # D/t at which mesh, modes, size of the plate and patch are varied
NEGLIGIBLE = 5.0  # D/t of the thesis, after its reference [8]
DEEP_LOSS = 0.05  # of the energy, thesis: what a wall thicker than c T_c takes
CLOSE = 0.1  # difference of the energies lost up to which Zener's plate is said to hold
FAINT = 0.05  # ARR that nobody would look for
REBOUNDS = 6.0  # D/t up to which one sphere rebounds at more than a tenth of its speed

VARIED = {
    "elements halved": plate_sizes.refined,
    "modes doubled": plate_sizes.with_more_modes,
    "1.5 times as wide": plate_sizes.widened,
    "patch halved": plate_sizes.with_half_the_patch,
}
COLUMNS = (
    "model", "d_over_t", "t_mm", "k_h", "restitution", "arr", "lost_%", "contact_us",
    "force_N",
)  # fmt: skip


class Answer(NamedTuple):
    """One plate by one model."""

    ratio: float  # D/t
    restitution: float  # of one sphere
    collision: Collision  # of the chain


class Results(NamedTuple):
    """All that is computed."""

    half_space: Collision
    radiated: float  # share of the striker's energy that leaves into a half-space
    curve: list[Answer]  # Zener's
    thin: list[Answer]  # Zener's, at the thicknesses of the solid ones
    solid: list[Answer]
    checks: list[tuple[str, Answer]]


def wall_thickness(scene: Scene, progress: Progress) -> Finding:
    """Reflected waves from plates of any thickness, thin and solid (thesis, section 2.2.2)."""
    require_chain(scene, FEWEST)
    with progress("half-space and infinite plates"):
        deep = plates.collision(scene, dem.rigid_wall())
        curve = [_zener(scene, r) for r in np.geomspace(RATIOS[0], RATIOS[-1], N_CURVE)]
        thin = [_zener(scene, ratio) for ratio in RATIOS]
    size = {z.ratio: _size(scene, z, deep) for z in thin}
    solid, checks = [], []
    for ratio in RATIOS:
        with progress(f"solid plate, D/t = {ratio:g}"):
            solid.append(_solid(scene, ratio, size[ratio]))
    for name, varied in VARIED.items():
        with progress(f"D/t = {CHECKED:g}, {name}"):
            checks.append((name, _solid(scene, CHECKED, varied(size[CHECKED]))))
    found = Results(deep, _radiated(scene, deep), curve, thin, solid, checks)
    sentences = rendered(__file__, **_numbers(scene, found, size[CHECKED]))
    drawn = Picture(
        "study_wall_thickness", picture(found, NEGLIGIBLE, plates.observed_sphere(scene))
    )
    return Finding((Table("wall-thickness", COLUMNS, _rows(scene, found)),), sentences, (drawn,))


def _plate(scene: Scene, ratio: float) -> coupling.Plate:
    return plates.steel(scene, plates.diameter(scene) / ratio)


def _zener(scene: Scene, ratio: float) -> Answer:
    wall = coupling.infinite_plate(_plate(scene, ratio))
    return Answer(ratio, plates.rebound(scene, wall), plates.collision(scene, wall))


def _solid(scene: Scene, ratio: float, size: Sizes) -> Answer:
    wall = plates.middle_wall(_plate(scene, ratio), size)
    return Answer(ratio, plates.rebound(scene, wall), plates.collision(scene, wall))


def _size(scene: Scene, zener: Answer, deep: Collision) -> Sizes:
    rise, until = deep.contact.seconds, zener.collision.contact.seconds
    return plate_sizes.sizes(_plate(scene, zener.ratio), rise, until)


def _radiated(scene: Scene, deep: Collision) -> float:
    flat, run = plates.steel(scene, 1.0), deep.trajectory
    force = run.contact_force[:, -1]
    energy = coupling.radiated_energy(run.t, force, flat.young, flat.poisson, flat.density)
    return energy / float(run.energy_kinetic[0])


def _rows(scene: Scene, found: Results) -> tuple[tuple, ...]:
    rows = [("half-space", None, None, None, 1.0, *_of_chain(found.half_space))]
    for thin, solid in zip(found.thin, found.solid, strict=True):
        rows.append(_row(scene, "infinite (Zener)", thin))
        rows.append(_row(scene, "solid", solid))
    rows += [_row(scene, f"solid, {name}", answer) for name, answer in found.checks]
    return tuple(rows)


def _row(scene: Scene, model: str, answer: Answer) -> tuple:
    plate = _plate(scene, answer.ratio)
    slender = coupling.slenderness(plate, answer.collision.contact.seconds)
    return (
        model, answer.ratio, 1e3 * plate.thickness, slender,
        answer.restitution, *_of_chain(answer.collision),
    )  # fmt: skip


def _of_chain(found: Collision) -> tuple[float, ...]:
    lost = 100 * round(found.lost, 8) + 0.0  # what an elastic run loses is the march's error
    return found.arr, lost, 1e6 * found.contact.seconds, found.peak_force


def _numbers(scene: Scene, found: Results, size: Sizes) -> dict[str, Any]:
    flat, deep = plates.steel(scene, 1.0), found.half_space
    both = list(zip(found.thin, found.solid, strict=True))
    close = [s.ratio for z, s in both if abs(s.collision.lost / z.collision.lost - 1) < CLOSE]
    omega = plate_sizes.CARRIED * np.pi / deep.contact.seconds
    striker = np.abs(deep.trajectory.v[0]).max()
    half_way = np.sqrt(flat.young / flat.density) * deep.contact.seconds / 2
    return {
        "sphere": plates.observed_sphere(scene),
        "rebounds": REBOUNDS,
        "worst": max(
            abs(s.restitution / z.restitution - 1) for z, s in both if s.ratio <= REBOUNDS
        ),
        "thickest": both[0],
        "thinnest": both[-1],
        "close": CLOSE,
        "close_from": min(close, default=None),
        "radiated": found.radiated,
        "carried_hz": omega / (2 * np.pi),
        "speed": coupling.group_speed(_plate(scene, CHECKED), omega),
        "reach": size.reach,
        "half_way": half_way,
        "n_within": sum(plates.diameter(scene) / ratio <= half_way for ratio in RATIOS),
        "n_plates": len(RATIOS),
        "deep_loss": DEEP_LOSS,
        "striker": striker,
        "fast": striker * (DEEP_LOSS / found.radiated) ** (5 / 3),
        "two": _at(found.solid, 2.0).collision,
        "negligible": NEGLIGIBLE,
        "five": _at(found.solid, NEGLIGIBLE).collision,
        "faint": FAINT,
        "faint_from": _faint(found),
        "deep": deep,
        "checked": _at(found.solid, CHECKED),
        "checks": found.checks,
    }


def _at(answers: list[Answer], ratio: float) -> Answer:
    return next(answer for answer in answers if answer.ratio == ratio)


def _faint(found: Results) -> float:
    """D/t at which ARR falls below FAINT on Zener's curve."""
    ratio = np.array([z.ratio for z in found.curve])
    arr = np.array([z.collision.arr for z in found.curve])
    return float(np.interp(-FAINT, -arr, ratio))
