"""ARR against the thickness of a plate: Zener's infinite one, and solid plates of finite elements.

The thesis tells thick walls from thin ones by whether a longitudinal wave crosses the wall and
returns within the contact. What a plate takes is carried along it by bending waves: both models
here have those, and the solid one the way through the thickness as well. Thesis, section 2.2.2.
"""

from typing import NamedTuple

import numpy as np

import coupling
import dem
from workflows.run_folder import Picture
from workflows.scene import Scene
from workflows.stages import Watch
from workflows.studies import plates
from workflows.studies.plates import Blow, Sizes
from workflows.studies.thickness_figure import picture
from workflows.study import Finding

RATIOS = (0.125, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)  # D/t
N_CURVE = 49  # of thicknesses on Zener's curve
CHECKED = 4.0  # D/t at which mesh, modes, size of the plate and patch are varied
NEGLIGIBLE = 5.0  # D/t of the thesis, after its reference [8]
DEEP_LOSS = 0.05  # of the energy, thesis: what a wall thicker than c T_c takes
CLOSE = 0.1  # difference of the energies lost up to which Zener's plate is said to hold
FAINT = 0.05  # ARR that nobody would look for
REBOUNDS = 6.0  # D/t up to which one sphere rebounds at more than a tenth of its speed

VARIED = {
    "elements halved": plates.refined,
    "modes doubled": plates.with_more_modes,
    "1.5 times as wide": plates.widened,
    "patch halved": plates.with_half_the_patch,
}
COLUMNS = (
    "model", "d_over_t", "t_mm", "k_h", "restitution", "arr", "lost_%", "contact_us",
    "force_N",
)  # fmt: skip


class Answer(NamedTuple):
    """One plate by one model."""

    ratio: float  # D/t
    restitution: float  # of one sphere
    blow: Blow  # of the chain


class Results(NamedTuple):
    """All that is computed."""

    half_space: Blow
    radiated: float  # share of the striker's energy that leaves into a half-space
    curve: list[Answer]  # Zener's
    thin: list[Answer]  # Zener's, at the thicknesses of the solid ones
    solid: list[Answer]
    checks: list[tuple[str, Answer]]


def wall_thickness(scene: Scene, watch: Watch) -> Finding:
    """Zener's curve, solid plates of the same thickness, and what mesh and modes do to them."""
    plates.require_chain(scene)
    with watch("half-space and infinite plates"):
        deep = plates.blow(scene, dem.rigid_wall())
        curve = [_zener(scene, r) for r in np.geomspace(RATIOS[0], RATIOS[-1], N_CURVE)]
        thin = [_zener(scene, ratio) for ratio in RATIOS]
    size = {z.ratio: _size(scene, z, deep) for z in thin}
    solid, checks = [], []
    for ratio in RATIOS:
        with watch(f"solid plate, D/t = {ratio:g}"):
            solid.append(_solid(scene, ratio, size[ratio]))
    for name, varied in VARIED.items():
        with watch(f"D/t = {CHECKED:g}, {name}"):
            checks.append((name, _solid(scene, CHECKED, varied(size[CHECKED]))))
    found = Results(deep, _radiated(scene, deep), curve, thin, solid, checks)
    sentences = _sentences(scene, found, size[CHECKED])
    drawn = Picture("study_wall_thickness", picture(found, NEGLIGIBLE, plates.watched(scene)))
    return Finding("wall-thickness", COLUMNS, _rows(scene, found), sentences, (drawn,))


def _plate(scene: Scene, ratio: float) -> coupling.Plate:
    return plates.steel(scene, plates.diameter(scene) / ratio)


def _zener(scene: Scene, ratio: float) -> Answer:
    wall = coupling.infinite_plate(_plate(scene, ratio))
    return Answer(ratio, plates.rebound(scene, wall), plates.blow(scene, wall))


def _solid(scene: Scene, ratio: float, size: Sizes) -> Answer:
    wall = plates.middle_wall(_plate(scene, ratio), size)
    return Answer(ratio, plates.rebound(scene, wall), plates.blow(scene, wall))


def _size(scene: Scene, zener: Answer, deep: Blow) -> Sizes:
    rise, until = deep.contact.seconds, zener.blow.contact.seconds
    return plates.sizes(_plate(scene, zener.ratio), rise, until)


def _radiated(scene: Scene, deep: Blow) -> float:
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
    slender = coupling.slenderness(plate, answer.blow.contact.seconds)
    return (
        model, answer.ratio, 1e3 * plate.thickness, slender,
        answer.restitution, *_of_chain(answer.blow),
    )  # fmt: skip


def _of_chain(blow: Blow) -> tuple[float, ...]:
    lost = 100 * round(blow.lost, 8) + 0.0  # what an elastic run loses is the march's error
    return blow.arr, lost, 1e6 * blow.contact.seconds, blow.peak_force


def _sentences(scene: Scene, found: Results, size: Sizes) -> tuple[str, ...]:
    return (
        f"ARR is (2.9), the velocities to the power 6/5, at sphere {plates.watched(scene)}; plates "
        "of the spheres' steel, elastic contacts, no preload. Energies are shares of the "
        "striker's, lost when the contact with the wall ends; restitution is of one sphere alone.",
        *_agreement(found),
        _echoes(scene, found, size),
        *_against_the_thesis(scene, found),
        _accuracy(found),
    )


def _agreement(found: Results) -> tuple[str, str]:
    both = list(zip(found.thin, found.solid, strict=True))
    worst = max(abs(s.restitution / z.restitution - 1) for z, s in both if s.ratio <= REBOUNDS)
    thinnest = both[-1]
    close = [s.ratio for z, s in both if abs(s.blow.lost / z.blow.lost - 1) < CLOSE]
    zener, solid = both[0]
    return (
        f"One sphere rebounds from the solid plate as from Zener's within {100 * worst:.1f} % up "
        f"to D/t = {REBOUNDS:g}; at D/t = {thinnest[0].ratio:g} hardly, with "
        f"{thinnest[1].restitution:.3f} and {thinnest[0].restitution:.3f} of its speed.",
        f"Zener's plate takes the energy that the solid one takes within {100 * CLOSE:.0f} % from "
        f"D/t = {min(close):g} on. Thicker plates are no longer thin against their bending waves "
        f"(k h in the table): Zener's takes {100 * zener.blow.lost:.2f} % at D/t = "
        f"{zener.ratio:g}, the solid one {100 * solid.blow.lost:.2f} %, a half-space, by the "
        f"waves that this force radiates, {100 * found.radiated:.2f} %.",
    )


def _echoes(scene: Scene, found: Results, size: Sizes) -> str:
    plate = _plate(scene, CHECKED)
    omega = plates.CARRIED * np.pi / found.half_space.contact.seconds
    speed = coupling.group_speed(plate, omega)
    return (
        f"At D/t = {CHECKED:g} bending waves of {omega / (2e3 * np.pi):.1f} kHz travel at "
        f"{speed:.0f} m/s (2 omega / k); the edges, {1e3 * size.reach:.0f} mm away, answer after "
        f"{2e6 * size.reach / speed:.0f} µs, the contact lasts "
        f"{1e6 * _at(found.solid, CHECKED).blow.contact.seconds:.0f} µs."
    )


def _against_the_thesis(scene: Scene, found: Results) -> tuple[str, ...]:
    flat, deep = plates.steel(scene, 1.0), found.half_space
    half_way = np.sqrt(flat.young / flat.density) * deep.contact.seconds / 2
    striker = np.abs(deep.trajectory.v[0]).max()
    fast = striker * (DEEP_LOSS / found.radiated) ** (5 / 3)
    two, five, four = (_at(found.solid, ratio).blow for ratio in (2.0, NEGLIGIBLE, CHECKED))
    softer = four.contact.seconds > deep.contact.seconds and four.arr < deep.arr
    return (
        f'Thesis: "L <= c T_c / 2 ... the energy loss is minimal". That is {half_way:.2f} m here, '
        f"{_within(scene, half_way)}. {plates.verdict(two.lost < DEEP_LOSS)} for plates: the one "
        f"of D/t = 2 takes {100 * two.lost:.0f} %. The rule is that of a bar, along which waves go "
        "to and fro; a plate's bending waves go away.",
        f"Thesis: beyond c T_c the wall takes about {100 * DEEP_LOSS:.0f} %. At {striker:.2g} m/s "
        f"a half-space takes {100 * found.radiated:.2f} %; the share grows with the speed to the "
        f"power 3/5 and reaches {100 * DEEP_LOSS:.0f} % at {fast:.0f} m/s, were it elastic.",
        f"Thesis, after its reference [8]: at D/t = {NEGLIGIBLE:g} no reflected wave to speak of. "
        f"{plates.verdict(five.arr < FAINT)}: the plate takes {100 * five.lost:.0f} % of the "
        f"energy there, but ARR goes with the root of what is left and is {five.arr:.2f}; it falls "
        f"below {FAINT:g} at D/t = {_faint(found):.1f}.",
        f"Thesis: a thinner plate lengthens T_c and lowers ARR. {plates.verdict(softer)}; T_c goes "
        f"from {1e6 * deep.contact.seconds:.0f} µs to {1e6 * four.contact.seconds:.0f} µs at D/t = "
        f"{CHECKED:g} only, while ARR goes from {deep.arr:.2f} to {four.arr:.2f}.",
    )


def _within(scene: Scene, thickness: float) -> str:
    met = sum(plates.diameter(scene) / ratio <= thickness for ratio in RATIOS)
    return f"which {met} of the table's {len(RATIOS)} plates meet"


def _at(answers: list[Answer], ratio: float) -> Answer:
    return next(answer for answer in answers if answer.ratio == ratio)


def _faint(found: Results) -> float:
    """D/t at which ARR falls below FAINT on Zener's curve."""
    ratio = np.array([z.ratio for z in found.curve])
    arr = np.array([z.blow.arr for z in found.curve])
    return float(np.interp(-FAINT, -arr, ratio))


def _accuracy(found: Results) -> str:
    base = _at(found.solid, CHECKED)
    changes = [
        f"{name}: {answer.blow.arr - base.blow.arr:+.1e} and "
        f"{answer.restitution - base.restitution:+.1e}"
        for name, answer in found.checks
    ]
    return (
        f"Solid plate at D/t = {CHECKED:g}, changes of ARR ({base.blow.arr:.4f}) and of one "
        f"sphere's restitution ({base.restitution:.4f}); {'; '.join(changes)}."
    )
