"""Warnings of a run: what can be run, but is to be trusted in part or was probably not meant so.

Each function yields sentences on the one thing that its name says.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil, isnan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import coupling
import dem
from coupling.verdict import large_step_error
from dem.validity import SMALL_CONTACT
from dem.waves import solitary
from dem.waves.chain_waves import ChainWaves
from dem.waves.measures import contact_time
from dem.waves.solitary import WIDTH
from workflows.files.cache_folder import cache_folder
from workflows.scene import DashpotWall, RomWall, Scene
from workflows.stages.cache import fault
from workflows.stages.chain import Start, contact_radius

if TYPE_CHECKING:  # a run without a reduced model does not load finite elements
    from fem.constraints import Overconstrained

CURES = {
    "reduction": "keep more modes (reduction.modes, reduction.to_hz, wall.cutoff)",
    "mesh": "take smaller elements (the seeds of [mesh], or mesh.scale)",
    "theory": "draw the beam or plate as a body, see solid-beam and solid-plate of `study`",
}


class Thresholds(NamedTuple):
    """From where on a run is warned of; chosen, not varied."""

    model_error: float = 0.1  # error of the velocities, over the striker's
    # k h up to which Zener's plate takes the energy of a solid one within a tenth, as the study
    # wall-thickness shows
    slender: float = 0.65
    quality: float = 0.7  # of a wave, below which its numbers are not to be believed
    unequal: float = 1.25  # ratio of masses from which on waves are not those of equal spheres
    pressed: float = 0.05  # of the striker's energy, still elastic when the record ends
    per_wave: int = 5  # samples that show a crest


AT = Thresholds()


def of_chain(
    scene: Scene, start: Start, impact: coupling.Impact, waves: ChainWaves
) -> Iterator[str]:
    """All that a run of the chain and its waves give rise to."""
    run = impact.trajectory
    yield from judged(impact)
    yield from dem.outside(dem.strain(start.chain, scene.chain.young, run.contact_force, run.v))
    yield from long_contact(scene, start, run)
    yield from large_step_error(run.error_estimate)
    yield from beyond_the_horizon(scene)
    if isinstance(scene.wall, RomWall) and scene.wall.file is not None:
        yield from unusual_wall_file(scene.wall)
    yield from shortened_step(scene)
    yield from thick_plate(scene, run)
    yield from unequal_spheres(start)
    yield from overlapping_waves(waves)
    yield from short_record(scene, start, waves, run)


def long_contact(scene: Scene, start: Start, run: dem.Trajectory) -> Iterator[str]:
    """A contact ellipse on a curved face that is not small relative to the sphere."""
    if start.ellipse == coupling.PLANE:
        return
    peak, sphere = float(run.contact_force[:, -1].max()), float(start.chain.radius[-1])
    half = start.ellipse.longest(contact_radius(scene, start, peak))
    if half > SMALL_CONTACT * sphere:
        yield (
            f"The contact with the curved wall grows {2e3 * half:.2g} mm long, "
            f"{half / sphere:.2g} of the sphere's radius to either side, where Hertz' law asks for "
            f"less than {SMALL_CONTACT:g}; reduce striker.velocity, or strike a flatter face."
        )


def overconstrained(twice: Sequence[Overconstrained]) -> Iterator[str]:
    """Nodes that two constraints ask for: the first holds them."""
    for slaves, face, holder in twice:
        yield (
            f"{len(set(slaves // 3))} nodes of {face} are held by {holder} as well, which alone "
            "holds them; let the two faces end apart, or drop one of the two."
        )


def results_not_kept() -> Iterator[str]:
    """A folder for results that cannot be written or trusted."""
    if why := fault():
        yield (
            f"Nothing is kept for the next run, {cache_folder()} {why}; "
            "BEADWAVE_CACHE_DIR names another folder."
        )


def judged(impact: coupling.Impact) -> Iterator[str]:
    """Findings of the verdict, and the energy that a wall made that is not passive."""
    yield from impact.verdict.findings
    gain = impact.energy_gain
    if not impact.verdict.passive:
        yield (
            f"This wall does not conserve energy: the largest gain is {gain.largest:.3g} of the "
            f"striker's at {gain.time * 1e3:.3g} ms, at the end it is {gain.final:+.3g}."
        )


def large_model_error(name: str, error: float) -> Iterator[str]:
    """A reduction or a mesh whose error shows in the velocities."""
    if error > AT.model_error:
        yield (
            f"The error of the {name} is about {100 * error:.0f} % of the striker's speed: "
            f"{CURES[name]}."
        )


def beyond_the_horizon(scene: Scene) -> Iterator[str]:
    """A run that goes on beyond the time up to which its velocities keep the error."""
    time = scene.time
    if time.dt is None and time.duration > time.horizon:
        yield (
            f"The velocities stay within the error until {1e3 * time.horizon:g} ms; beyond, only "
            "the energy is, since spheres move chaotically after tens of impacts. time.horizon "
            "moves it."
        )


def shortened_step(scene: Scene) -> Iterator[str]:
    """Samples to save that lie closer than the step that was given."""
    spacing, dt = scene.time.duration / (scene.output.samples - 1), scene.time.dt
    if dt is not None and dt > spacing * (1 + 1e-9):
        yield (
            f"time.dt = {dt:g} s is longer than the spacing of the saved samples, which is the "
            f"step that was taken, {spacing:g} s; lower output.samples to march with time.dt."
        )


def thick_plate(scene: Scene, run: dem.Trajectory) -> Iterator[str]:
    """A plate that is not thin against the bending waves of the contact."""
    wall = scene.wall
    if not isinstance(wall, DashpotWall) or wall.plate_thickness is None:
        return
    plate = coupling.Plate(wall.young, wall.poisson, wall.density, wall.plate_thickness)
    seconds = contact_time(run.t, run.contact_force[:, -1]).seconds
    slender = coupling.slenderness(plate, seconds) if 0 < seconds < np.inf else 0.0
    if slender >= AT.slender:
        yield (
            f"The plate is thick relative to its bending waves (k h = {slender:.2f}, thin is below "
            f"{AT.slender:g}); a solid one absorbs over 10 % more energy, see beadwave study "
            "wall-thickness."
        )


def unequal_spheres(start: Start) -> Iterator[str]:
    """Masses that differ, save the striker's and that of what is fixed to the last sphere."""
    mass = start.chain.mass[1:-1]
    spread = float(mass.max() / mass.min()) if mass.size else 1.0
    if spread >= AT.unequal:
        yield (
            f"The spheres' masses differ by a factor of {spread:.3g}: waves are followed and named "
            "by the solitary wave of equal spheres, which does not apply here; names, "
            "speeds, ARR and TOF are unreliable."
        )


def overlapping_waves(waves: ChainWaves) -> Iterator[str]:
    """Waves of a quality too low to be trusted."""
    named = [label.arrival for labels in waves.labels.values() for label in labels]
    poor = sum(wave.quality < AT.quality for wave in named)
    if not poor:
        return
    has, it, its = ("has", "it overlaps", "its") if poor == 1 else ("have", "they overlap", "their")
    yield (
        f"{poor} of {len(named)} waves at the observed spheres {has} a quality below "
        f"{AT.quality:g}: {it} with others too much to be separated, or the spheres differ; do not "
        f"rely on {its} velocit{'y' if poor == 1 else 'ies'}."
    )


def short_record(
    scene: Scene, start: Start, waves: ChainWaves, run: dem.Trajectory
) -> Iterator[str]:
    """What the end of the record cuts off, or its samples do not show."""
    if waves.contact is None:
        return
    ends = f"time.duration = {scene.time.duration:g} s ends"
    pressed = run.energy_contact[-1] - run.energy_contact[0]
    share = float(pressed / run.energy_kinetic[0]) if run.energy_kinetic[0] else 0.0
    if isnan(waves.contact.contact_time.seconds):
        too_early = (
            f"{ends} before a wave is at the wall: nothing is measured there; take a longer one."
        )
        yield from coarse_samples(scene, start) or (too_early,)
    elif share >= AT.pressed:
        yield (
            f"{ends} while contacts hold {100 * share:.0f} % of the striker's energy more than at "
            "rest: the velocity sum ratio and the restitution are not those of spheres that "
            "have parted; take a longer one."
        )


def coarse_samples(scene: Scene, start: Start) -> tuple[str, ...]:
    """A sentence where a wave passes a sphere between two samples."""
    row, striker = start.chain, float(np.abs(start.velocity).max())
    spacing = scene.time.duration / (scene.output.samples - 1)
    width = WIDTH / float(solitary.speed(striker, row.mass[: row.A.size], row.A).max())
    if not spacing > width:
        return ()
    return (
        f"output.samples = {scene.output.samples} leaves {spacing:.2g} s between samples, in which "
        f"waves of {width:.2g} s pass unseen: nothing is measured at the wall; take at least "
        f"{ceil(AT.per_wave * scene.time.duration / width)}.",
    )


def unusual_wall_file(wall: RomWall) -> Iterator[str]:
    """A material that nobody gave, weights that are no average, other units than N/m and kg, loose
    bodies, a wall that was to float, a half-space larger than what holds it."""
    from rom.imported import unusual
    from workflows.files.wall import measured

    reduced, health = measured(wall)
    missing = [f"wall.{key}" for key in ("young", "poisson") if getattr(wall, key) is None]
    if missing:
        yield (
            f"Neither the scene nor wall.file says {' and '.join(missing)} of the surface that is "
            "struck: that of steel is assumed."
        )
    yield from unusual(reduced, health.modes, "wall.file")
