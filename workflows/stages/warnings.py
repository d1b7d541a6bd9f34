"""Warnings of a run: scenes that can be run, but whose results are unreliable in part, or that were
probably not meant so.

Each function decides one warning and yields its sentences, none where there is nothing to say. They
are listed in `of_chain` (the impact and its waves), `of_friction` (the motion across) and
`of_structure` (an assembly), which the stages of a run's numbers ask and keep: what they read of
the scene has to be in the row of their stage in `pipeline`. Those on errors of models are asked by
`workflows.run.run`, those on a list of modes by `workflows.structure.mode_table`. What a room below
finds out by itself comes here as sentences: `coupling.verdict`, `dem.validity`, `rom.health`,
`rom.imported`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil, isfinite, isnan, nan
from typing import TYPE_CHECKING

import numpy as np

from beadwave.workflows.files.cache_folder import cache_folder
from beadwave.workflows.report.number_format import percent, si
from beadwave.workflows.scene import DashpotWall, RomWall, Scene
from beadwave.workflows.scene.tables.bolts import ADVISED_UTILISATION
from beadwave.workflows.stages.engine.cache import fault

if (
    TYPE_CHECKING
):  # a run whose results are kept loads no chain, one without a structure no elements
    from beadwave import coupling, dem
    from beadwave.dem.lateral import LateralTrajectory
    from beadwave.dem.waves.chain_waves import ChainWaves
    from beadwave.fem.assembly.constraints import Overconstrained
    from beadwave.fem.modes.assembly_modes import AssemblyModes
    from beadwave.workflows.report.summary import MeshNumbers, ReductionHealth
    from beadwave.workflows.stages.chain.chain import Start

CURES = {
    "reduction": "keep more modes (reduction.modes, reduction.to_hz, wall.cutoff)",
    "mesh": "take smaller elements (mesh.error, or mesh.scale below 1)",
    "receptance": "measure with less noise, more averages or in a wider band",
    "theory": "draw the beam or plate as a body, see solid-beam and solid-plate of the gallery",
}


# Limits beyond which a run has a warning; chosen
LARGE_MODEL_ERROR = 0.1  # error of the velocities over the striker's speed
# wavenumber times thickness k h, up to which Zener's thin plate absorbs the energy of a solid
# one within a tenth (`examples/gallery/wall_thickness.py`)
SLENDER_KH = 0.65
LOW_QUALITY = 0.7  # of a wave: below it, time and peak are those of overlapping waves
PRESSED_ENERGY = 0.05  # elastic energy when the record ends, over the striker's
# energy of the force at the wall above the band of a measured response, of the whole
BEYOND_BAND_ENERGY = 0.01
# of a mode of measured parts, by their noise and band, from which on it is doubtful
LARGE_PART_ERROR = 0.1
# ratio of frequencies of a measured mode and the computed one that its shape is paired with;
# chosen, not varied
DISTANT_PAIR = 1.6
SAMPLES_PER_WAVE = 5  # samples within the width of a wave that show its crest


def strain(scene: Scene, start: Start, run: dem.Trajectory) -> dem.Strain:
    """Strain of a run beyond Hertz' law, by the materials of the chain and of the face struck; a
    rigid wall does not yield."""
    from beadwave import dem

    struck = scene.wall
    if isinstance(struck, RomWall):
        struck = scene.struck_material if scene.has_structure and struck.file is None else None
    young, yield_stress = getattr(struck, "young", None), getattr(struck, "yield_stress", None)
    if isinstance(young, tuple):  # orthotropic
        young = min(young)
    of_wall = None if young is None else (young, nan if yield_stress is None else yield_stress)
    return dem.strain(
        start.chain, scene.chain.young, run.contact_force, run.v,
        yield_stress=scene.chain.yield_stress, of_wall=of_wall,
    )  # fmt: skip


def of_chain(
    scene: Scene, start: Start, impact: coupling.Impact, waves: ChainWaves
) -> Iterator[str]:
    """All warnings on a run of the chain and its waves."""
    from beadwave import dem
    from beadwave.coupling.verdict import large_step_error

    run = impact.trajectory
    yield from judged(impact)
    yield from dem.outside(strain(scene, start, run))
    yield from long_contact(scene, start, run)
    yield from beyond_the_table(start, run)
    yield from large_step_error(run.error_estimate)
    yield from beyond_the_horizon(scene)
    if isinstance(scene.wall, RomWall) and scene.wall.file is not None:
        yield from unusual_wall_file(scene.wall)
    yield from shortened_step(scene)
    yield from thick_plate(scene, run)
    yield from unequal_spheres(start)
    yield from overlapping_waves(waves)
    yield from short_record(scene, start, waves, run)


def of_friction(scene: Scene, start: Start, lateral: LateralTrajectory) -> Iterator[str]:
    """All warnings on the motion of the last sphere across the chain."""
    yield from high_friction(scene)
    yield from neglected_coupling(scene, start)
    yield from unbalanced(lateral)


def of_structure(modes: AssemblyModes, health: ReductionHealth) -> Iterator[str]:
    """All warnings on an assembly and its reduced model."""
    yield from health.findings
    yield from overconstrained(modes.overconstrained)


def long_contact(scene: Scene, start: Start, run: dem.Trajectory) -> Iterator[str]:
    """A contact ellipse on a curved face whose longer half axis at the peak force is not small
    relative to the sphere's radius, as Hertz' law assumes."""
    from beadwave.coupling import PLANE
    from beadwave.dem.validity import SMALL_CONTACT
    from beadwave.workflows.stages.chain.chain import contact_radius

    if start.ellipse == PLANE:
        return
    peak, sphere = float(run.contact_force[:, -1].max()), float(start.chain.radius[-1])
    half = start.ellipse.longest(contact_radius(scene, start, peak))
    if half > SMALL_CONTACT * sphere:
        yield (
            f"The contact with the curved wall grows {2e3 * half:.2g} mm long, "
            f"{half / sphere:.2g} of the sphere's radius to either side, where Hertz' law asks for "
            f"less than {SMALL_CONTACT:g}; reduce striker.velocity, or strike a flatter face."
        )


def beyond_the_table(start: Start, run: dem.Trajectory) -> Iterator[str]:
    """Forces of tabulated contacts above their last row, behind which the force is a straight
    line that nobody has measured."""
    table = start.chain.table
    if table is None:
        return
    share = run.contact_force.max(axis=0) / (start.chain.A * table.force[-1])
    beyond = np.flatnonzero(share > 1.0)
    if beyond.size:
        worst = int(np.argmax(share))
        yield (
            f"The force of {beyond.size} of {share.size} contacts goes beyond the last row of "
            f"contact.file, most at contact {worst + 1}, {share[worst]:.3g} times, where it is "
            "continued as a straight line; add rows to the table, or reduce striker.velocity."
        )


def overconstrained(twice: Sequence[Overconstrained]) -> Iterator[str]:
    """Nodes that two constraints would hold: the first one does."""
    for slaves, face, holder in twice:
        yield (
            f"{len(set(slaves // 3))} nodes of {face} are held by {holder} as well, which alone "
            "holds them; let the two faces end apart, or drop one of the two."
        )


def rigid_motions(numbers: Sequence[int]) -> Iterator[str]:
    """Modes, counted from 1, that strain nothing, which targets do not count."""
    if len(numbers):
        first = next(n for n in range(1, max(numbers) + 2) if n not in numbers)
        yield (
            f"Modes {', '.join(map(str, numbers))} are rigid motions, free or on springs: --match "
            f"and the number of a target count the others, mode {first} as 1."
        )


def unheld_motions(numbers: Sequence[int]) -> Iterator[str]:
    """Modes, counted from 1, of a structure that is held which strain nothing."""
    if len(numbers):
        yield (
            f"Modes {', '.join(map(str, numbers))} have no frequency although the structure is "
            "held: a piece of a body moves as if nothing joined it; look for nodes of its mesh "
            "that are not merged, and for pieces that nothing ties."
        )


def overloaded_bolts(used: Mapping[str, float]) -> Iterator[str]:
    """Bolts, by joint, whose preload is near what they bear: the share of their proof load."""
    for joint, share in used.items():
        if share > ADVISED_UTILISATION:
            yield (
                f"joints.{joint}: the preload is {100 * share:.0f} % of the bolt's proof load, "
                "which it bears without a lasting strain; advised are "
                f"{100 * ADVISED_UTILISATION:g} % at most: tighten it less, or take a stronger one."
            )


def distant_pairs(pairs: Mapping[int, tuple[float, float]]) -> Iterator[str]:
    """Measured modes, by number, whose shape is that of a computed mode at a distant frequency,
    (measured, computed) [Hz]. At few points such shapes look alike."""
    for number, (measured, computed) in pairs.items():
        apart = computed / measured
        if not 1 / DISTANT_PAIR < apart < DISTANT_PAIR:
            yield (
                f"Measured mode {number}, {measured:.5g} Hz, is paired with {computed:.5g} Hz by "
                f"its shape alone, {apart:.2g} times its frequency: at few points modes of distant "
                "frequencies look alike. Measure more points, or correct the model's stiffness or "
                "mass first."
            )


def doubtful_parts(errors: Mapping[int, float]) -> Iterator[str]:
    """Modes whose frequency, relative error by number from 1, changes with what measured parts
    leave open."""
    doubtful = [str(number) for number, error in errors.items() if error > LARGE_PART_ERROR]
    if doubtful:
        yield (
            f"Modes {', '.join(doubtful)} change by more than {100 * LARGE_PART_ERROR:g} % with "
            "the noise of the receptances or the end of their band: they rest on oscillators that "
            "noise makes, or on motions that these points hardly show; measure with less noise, or "
            "at points farther apart."
        )


def results_not_kept() -> Iterator[str]:
    """A cache folder that cannot be written, or that other users may write."""
    if why := fault():
        yield (
            f"Nothing is kept for the next run, {cache_folder()} {why}; "
            "BEADWAVE_CACHE_DIR names another folder."
        )


def judged(impact: coupling.Impact) -> Iterator[str]:
    """Findings of the verdict on the wall, and the energy that a wall has made that is not
    passive."""
    yield from impact.verdict.findings
    gain = impact.energy_gain
    if not impact.verdict.passive:
        yield (
            f"This wall does not conserve energy: the largest gain is {gain.largest:.3g} of the "
            f"striker's at {gain.time * 1e3:.3g} ms, at the end it is {gain.final:+.3g}."
        )


def large_model_error(name: str, error: float) -> Iterator[str]:
    """A reduction or a mesh ("reduction" or "mesh") whose relative error of the velocities is
    large."""
    if error > LARGE_MODEL_ERROR:
        yield (
            f"The error of the {name} is about {100 * error:.0f} % of the striker's speed: "
            f"{CURES[name]}."
        )


def unknown_model_error(name: str, reason: Exception) -> Iterator[str]:
    """A reduction or a mesh without a second model to measure its error by."""
    yield f"The error of the {name} could not be estimated: {reason}"


def model_errors_left_out() -> Iterator[str]:
    """A run with friction, of which no second model is marched."""
    yield (
        "Errors of reduction and mesh are of runs without friction; run the scene without "
        "[friction] and [[shakers]] for them."
    )


def model_errors_of_coupled_modes() -> Iterator[str]:
    """A run whose wall's modes are coupled, of which no second model is marched."""
    yield (
        "Errors of reduction and mesh are not estimated where dashpots, measured parts or the "
        "contact of the thesis couple the wall's modes: `beadwave modes` states what the mesh "
        "leaves in frequencies; run the scene with half of mesh.scale as well to see it in waves."
    )


def beyond_the_horizon(scene: Scene) -> Iterator[str]:
    """A run that lasts longer than the horizon up to which its velocities meet the error."""
    time = scene.time
    if time.dt is None and time.duration > time.horizon:
        yield (
            f"The velocities stay within the error until {1e3 * time.horizon:g} ms; beyond, only "
            "the energy is, since spheres move chaotically after tens of impacts. time.horizon "
            "moves it."
        )


def shortened_step(scene: Scene) -> Iterator[str]:
    """A given step longer than the spacing of the samples, which is then the step taken."""
    spacing, dt = scene.time.duration / (scene.output.samples - 1), scene.time.dt
    if dt is not None and dt > spacing * (1 + 1e-9):
        yield (
            f"time.dt = {dt:g} s is longer than the spacing of the saved samples, which is the "
            f"step that was taken, {spacing:g} s; lower output.samples to march with time.dt."
        )


def thick_plate(scene: Scene, run: dem.Trajectory) -> Iterator[str]:
    """A plate too thick for Zener's law, relative to the bending waves of its contact time."""
    from beadwave import coupling
    from beadwave.dem.waves.measures import contact_time

    wall = scene.wall
    if not isinstance(wall, DashpotWall) or wall.plate_thickness is None:
        return
    plate = coupling.Plate(wall.young, wall.poisson, wall.density, wall.plate_thickness)
    seconds = contact_time(run.t, run.contact_force[:, -1]).seconds
    slender = coupling.slenderness(plate, seconds) if 0 < seconds < np.inf else 0.0
    if slender >= SLENDER_KH:
        yield (
            f"The plate is thick relative to its bending waves (k h = {slender:.2f}, thin is below "
            f"{SLENDER_KH:g}); a solid one absorbs over 10 % more energy, see "
            "wall-thickness of the gallery."
        )


def unequal_spheres(start: Start) -> Iterator[str]:
    """Masses that differ between the first and the last sphere."""
    from beadwave.dem.waves.chain_waves import UNEQUAL, mass_spread

    spread = mass_spread(start.chain.mass)
    if spread >= UNEQUAL:
        yield (
            f"The spheres' masses differ by a factor of {spread:.3g}, to which the solitary wave "
            "of equal spheres does not apply: waves at a sphere are the peaks of its velocity, "
            "without names, and wave speeds, ARR and TOF are unreliable."
        )


def overlapping_waves(waves: ChainWaves) -> Iterator[str]:
    """Waves at the observed spheres whose quality is low."""
    named = [label.arrival for labels in waves.labels.values() for label in labels]
    poor = sum(wave.quality < LOW_QUALITY for wave in named)
    if not poor:
        return
    has, it, its = ("has", "it overlaps", "its") if poor == 1 else ("have", "they overlap", "their")
    yield (
        f"{poor} of {len(named)} waves at the observed spheres {has} a quality below "
        f"{LOW_QUALITY:g}: {it} with others too much to be separated, or the spheres differ; do "
        f"not rely on {its} velocit{'y' if poor == 1 else 'ies'}."
    )


def short_record(
    scene: Scene, start: Start, waves: ChainWaves, run: dem.Trajectory
) -> Iterator[str]:
    """A record that ends before the impact at the wall is over, or whose samples miss it."""
    if waves.contact is None:
        return
    ends = f"time.duration = {scene.time.duration:g} s ends"
    pressed = run.energy_contact[-1] - run.energy_contact[0]
    # the striker's energy, or what gravity and preload give if that is more
    given = run.energy_kinetic.max() + np.ptp(run.work_gravity) + np.ptp(run.work_preload)
    share = float(pressed / given) if given else 0.0
    if run.v.max() <= 0.0 and isnan(waves.contact.contact_time.seconds):
        yield "No sphere moves towards the wall: nothing is measured there."
    elif isnan(waves.contact.contact_time.seconds):
        too_early = (
            f"{ends} before a wave is at the wall: nothing is measured there; take a longer one."
        )
        yield from coarse_samples(scene, start) or (too_early,)
    elif share >= PRESSED_ENERGY:
        yield (
            f"{ends} while contacts hold {100 * share:.0f} % of the impact's energy more than at "
            "rest: the velocity sum ratio and the restitution are not those of spheres that "
            "have parted; take a longer one."
        )


def coarse_samples(scene: Scene, start: Start) -> tuple[str, ...]:
    """A sentence where samples are farther apart than the width of the striker's wave."""
    from beadwave.dem.waves import solitary

    row, striker = start.chain, float(np.abs(start.velocity).max())
    spacing = scene.time.duration / (scene.output.samples - 1)
    energy = np.full(row.A.shape, 0.5 * row.mass.max() * striker**2)
    A = row.elastic.hertz(row.elastic.force(row.elastic.overlap_of_energy(energy)))
    width = solitary.WIDTH / float(solitary.speed(striker, row.mass[: row.A.size], A).max())
    if not spacing > width:
        return ()
    return (
        f"output.samples = {scene.output.samples} leaves {spacing:.2g} s between samples, in which "
        f"waves of {width:.2g} s pass unseen: nothing is measured at the wall; take at least "
        f"{ceil(SAMPLES_PER_WAVE * scene.time.duration / width)}.",
    )


def narrow_band(scene: Scene, run: dem.Trajectory) -> Iterator[str]:
    """A measured wall whose band ends within the spectrum of the force on it."""
    from beadwave.workflows.files.receptance_file import fitted

    highest = fitted(scene.wall).highest_hz
    power = np.abs(np.fft.rfft(run.contact_force[:, -1])) ** 2
    f = np.fft.rfftfreq(len(run.t), float(run.t[1]))
    beyond = float(power[f > highest].sum() / power.sum()) if power.any() else 0.0
    if beyond > BEYOND_BAND_ENERGY:
        enough = f[np.searchsorted(np.cumsum(power), (1 - BEYOND_BAND_ENERGY) * power.sum())]
        yield (
            f"The response of wall.receptance ends at {highest:.4g} Hz, above which the force has "
            f"{100 * beyond:.0f} % of its energy: measure up to {1.1 * enough:.2g} Hz, with a "
            "harder tip of the hammer."
        )


def unusual_wall_file(wall: RomWall) -> Iterator[str]:
    """A reduced model from a file whose surface material is not stated, whose weights do not sum to
    1, whose units are not N/m and kg, whose bodies are loose, which floats, or whose half-space is
    more compliant than the whole (`rom.imported.unusual`)."""
    from beadwave.rom.imported import unusual
    from beadwave.workflows.files.wall_file import measured

    reduced, health = measured(wall)
    missing = [f"wall.{key}" for key in ("young", "poisson") if getattr(wall, key) is None]
    if missing:
        yield (
            f"Neither the scene nor wall.file says {' and '.join(missing)} of the surface that is "
            "struck: that of steel is assumed."
        )
    yield from unusual(reduced, health.modes, "wall.file")


def high_friction(scene: Scene) -> Iterator[str]:
    """Coefficients above those of dry solids in air; only soft rubber, and metals that were cleaned
    in vacuum, stick more."""
    highest = 2.0  # chosen, not varied
    for key in ("coefficient", "between_spheres"):
        value = getattr(scene.friction, key)
        if value is not None and value > highest:
            yield (
                f"friction.{key} = {value:g} is above that of dry solids in air, up to "
                f"{highest:g}: lower it, unless it is meant to keep the contact from slipping."
            )


def unbalanced(lateral: LateralTrajectory) -> Iterator[str]:
    """A loop of friction whose error is a good part of it, as of a contact that nearly sticks, and
    a periodic state in which what the shakers give and what is lost differ by as much: the loop is
    small against what modes take, or the state is not yet periodic."""
    cycle = lateral.cycle
    if cycle is None:
        return
    balanced = 0.05  # of a loop, up to which work and losses may differ unreported
    if isfinite(cycle.energy_error) and cycle.energy_error > balanced * cycle.energy:
        yield (
            f"The loop of friction of a period, {si(cycle.energy, 'J')}, has an error of "
            f"{si(cycle.energy_error, 'J')}: hardly anything of the contact slips, less than its "
            "cells show; lower time.error, or shake harder, before you rely on the loop."
        )
    if cycle.unbalanced is not None and cycle.unbalanced > balanced * cycle.energy:
        yield (
            f"In the periodic state the shakers' work and all losses of a period differ by "
            f"{si(cycle.unbalanced, 'J')}, at a loop of friction of {si(cycle.energy, 'J')}: "
            "lower time.error before you rely on the loop."
        )


def neglected_coupling(scene: Scene, start: Start) -> Iterator[str]:
    """A sphere and a wall of different materials, whose friction changes the normal
    force as well: Dundurs' constant (K. L. Johnson, Contact Mechanics (1985), 5.3b)."""
    E, nu = (float(np.atleast_1d(x)[-1]) for x in (scene.chain.young, scene.chain.poisson))
    a, b = ((1.0 - 2.0 * n) * (1.0 + n) / e for e, n in ((E, nu), start.flat))
    c, d = ((1.0 - n) * (1.0 + n) / e for e, n in ((E, nu), start.flat))
    beta = 0.5 * (a - b) / (c + d)
    # 0.01 of Dundurs' constant: from there on the neglected coupling is reported
    if abs(beta) > 0.01:
        yield (
            f"Sphere and wall differ, Dundurs' constant is {beta:.2g}: friction and pressure then "
            "act on each other, which the tangential law leaves out; take it for an estimate, or "
            "strike a wall of the spheres' material."
        )


def beyond_backbones(displacement: Mapping[int, float]) -> Iterator[str]:
    """Modes, by number, at amplitudes [m] beyond those at which whole bolts begin to slip."""
    for mode, x in displacement.items():
        yield (
            f"Mode {mode} reaches {si(x, 'm')}, more than its faces carry without slipping as a "
            "whole; it has frequency and damping of the largest amplitude that modes --amplitude "
            "shows, and really less of the one and more of the other."
        )


def mesh_above_asked(mesh: MeshNumbers) -> Iterator[str]:
    """The mesh states more than mesh.error, since a bound ended the search for its sizes, or since
    they were chosen for another scene."""
    if mesh.bounded_by is None:
        return
    what = f"The mesh states an error of {percent(mesh.stated, 2)}, mesh.error = {mesh.asked:g} "
    what += f"asks for {percent(mesh.asked, 2)}: "
    cost = ""
    if mesh.unknowns_for_asked and mesh.seconds_for_asked:
        cost = f"some {mesh.unknowns_for_asked:.1e} unknowns and {mesh.seconds_for_asked:.0f} s"
    if mesh.bounded_by == "unknowns":
        yield f"{what}that takes {cost}, more than mesh.unknowns allows. Most arises {mesh.where}."
    elif mesh.bounded_by == "sizes":
        yield f"{what}its sizes were chosen with other values; a run of its own chooses them anew."
    elif mesh.bounded_by == "floor":
        # of each feature its own; those of all of them and of the dents add up to the floor
        of_features = sum(feature.error for feature in mesh.left_out)
        cause, remedy = "dents under springs", "take larger radii there"
        if of_features >= 0.5 * mesh.floor:
            cause, remedy = "features that mesh.simplify leaves out", "lower it"
        yield (f"{what}{percent(mesh.floor, 2)} are {cause}, which no mesh lowers; {remedy}.")
    else:
        yield (
            f"{what}errors fall slowly with the size of elements {mesh.where}, where a fillet, a "
            f"larger washer or a larger mesh.error helps{f' ({cost} foreseen)' if cost else ''}."
        )
