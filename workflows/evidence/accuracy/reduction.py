"""Error of a reduced wall against its cost, by its number of modes.

(a) The receptance at the contact against the full model's, rms over rms up to 20 and to 50 kHz,
    with a loss factor of 1 %.
(b) The coupled velocities of the observed spheres against the full model's, over the striker's
    speed.

The full model's answer comes from a Krylov space of the whole structure, grown until its bound (see
rom.contact_modes) is far below the errors that are stated. It is set beside solutions of the full
model itself at a few frequencies. Seconds are those of the processor, of each reduction as if it
were the only one (see shared_solutions).

Modes are those that the contact moves most up to 50 kHz, whose error has a bound, or "lowest" in
the order of their frequencies, as reduction.choice says. "+ residual" keeps the static response of
all that is not a mode: the residual-attachment vector of free modes, the constraint modes of
Craig-Bampton. Without it a wall is its modes alone, and more modes do not improve the velocities:
they add up to a growing part of the local deformation at the contact, which Hertz' law already
holds.
"""

from collections.abc import Callable
from itertools import pairwise, product
from time import process_time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, dem, fem, rom
from beadwave.coupling.reduced_wall import wall_from_reduced
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.workflows.evidence.accuracy.runs import AccuracyRow, table_of
from beadwave.workflows.evidence.accuracy.shared_solutions import SharedSolutions
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import InvalidScene, RomWall, Scene
from beadwave.workflows.stages.chain.chain import chain, initial_velocity, on_surface
from beadwave.workflows.stages.chain.damping import damping
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import Progress
from beadwave.workflows.stages.engine.stage_table import Stage, tables_of
from beadwave.workflows.stages.structure.reduction import contact_of, selection, targets_kept

ERROR = 1e-4  # of the reduction, and of the marches that are compared
KINDS = ("free-modes", "craig-bampton")
CHOICES = ("contact", "lowest")
COUNTS = (10, 20, 40, 80, 150)
BANDS_HZ = (20e3, 50e3)
BOUND = 1e-6  # of the reference's error
FINER = 1e-2  # times the scene's error: the march must not show among the differences
REFERENCE = (
    Stage(
        "reference-response",
        f"{__name__}:reference",
        tables_of("strike", "assembly"),
        ("model", "contact"),
    ),
)


class FullReference(NamedTuple):
    """Stand-in for the full model: reduced, with its stated error as the bound."""

    reduced: rom.ReducedModel
    checked_hz: tuple[float, ...]  # (k,) where it is set beside solutions of the full model
    difference: float  # to those, relative rms


def reference(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> FullReference:
    """The full model's answer at the contact up to the highest band."""
    to_hz = BANDS_HZ[-1]
    selection = rom.Selection(error=BOUND, to_hz=to_hz, choice="contact")
    reduced = rom.free_modes(model.K, model.M, contact.w, selection, factorise=fem.factorised)
    reduced = reduced._replace(T=None, contact=contact_of(scene, model, contact))
    f = tuple(share * to_hz for share in (0.013, 0.11, 0.37, 0.71, 0.97))
    direct = fem.receptance(model.K, model.M, contact.w, np.array(f), loss_factor=rom.LOSS)
    difference = np.linalg.norm(rom.receptance(reduced, None, f, loss=rom.LOSS) - direct)
    return FullReference(reduced, f, float(difference / np.linalg.norm(direct)))


class ReductionCase(NamedTuple):
    """One reduced wall: what it gets wrong and the seconds it takes."""

    method: str
    n_modes: int
    reach: float  # [Hz] of the highest mode
    receptance: tuple[float, ...]  # relative rms error per band
    velocities: float  # relative to the striker
    reduce: float  # [s] of the processor
    march: float  # [s] of the processor


def reduction(scene: Scene, progress: Progress) -> Finding:
    """Error and cost of a reduced wall against the number of its modes.

    Raises InvalidScene for scenes without such a wall, with dashpots, which the responses compared
    here leave out, and with the thesis' scheme.
    """
    if scene.assembly is None or scene.chain is None or not isinstance(scene.wall, RomWall):
        raise InvalidScene(
            f'the scene {scene.name} has no chain before an assembly with wall.kind = "rom"; '
            "take rig-rom."
        )
    if scene.has_dashpots:
        raise InvalidScene(
            "joints or springs have dashpots, which this study would leave out of the responses it "
            "compares; set them to 0 (joints.head.cx .. joints.foot.crz of the rig)."
        )
    strike = scene.strike
    if strike and strike.weights == "thesis":
        raise InvalidScene(
            'the patch with weights = "thesis" is read elsewhere than it is pushed, which no '
            'number of modes corrects; take "hertz" or "area".'
        )

    # the full model, and what all reductions of it share: each is timed as if it were the only one
    run = pipeline_of(scene, progress, REFERENCE)
    model, patch = run("model"), run("contact")
    contact = contact_of(scene, model, patch)
    scene = on_surface(scene, contact)
    full = FullMatrices(model.K, model.M, patch.w, contact, SharedSolutions())

    # what the reduced walls are compared with: receptance H at a thousand frequencies, and a march
    truth = run("reference-response")
    f = np.arange(1, 1001) / 1000 * BANDS_HZ[-1]
    H = rom.receptance(truth.reduced, None, f, loss=rom.LOSS)
    with progress("reference march"):
        finest = marched(scene, wall_of(scene, truth.reduced), FINER)

    models = []  # the choice, the number of modes, the model and its seconds as if the only one
    for kind, choice, n in product(KINDS, CHOICES, COUNTS):
        with progress(f"{kind} {choice} {n}"):
            to_hz = BANDS_HZ[-1] if choice == "contact" else None
            selection = rom.Selection(n_modes=n, choice=choice, to_hz=to_hz)
            started = process_time() + full.shared.saved
            reduced = reduced_by(full, kind, selection, full.shared)
            seconds = process_time() + full.shared.saved - started
            models.append((choice, n, reduced, seconds))

    # every model with its residual vector, those of the lowest modes without as well
    cases = []
    observed = [sphere - 1 for sphere in scene.output.spheres] or slice(None)
    speed = np.abs(initial_velocity(scene)).max()
    with progress("marches"):
        for choice, n, reduced, seconds in models:
            for residual in (True, False) if choice == CHOICES[0] else (True,):
                modes_alone = rom.modes_alone(reduced, n)
                compared = reduced if residual else modes_alone
                error = rom.receptance(compared, None, f, loss=rom.LOSS) - H
                bands = [f <= band for band in BANDS_HZ]
                # modes alone do not hold the half-space that only many of them add up to: none is
                # taken out
                wall = wall_of(scene, compared, None if residual else 0.0)
                v = marched(scene, wall, FINER).v
                cases.append(ReductionCase(
                    method=method_name(reduced.kind, choice, residual),
                    n_modes=n,
                    reach=float(modes_alone.K[-1, -1] ** 0.5 / (2 * np.pi)),
                    receptance=tuple(
                        float(np.linalg.norm(error[b]) / np.linalg.norm(H[b])) for b in bands
                    ),
                    velocities=float(np.abs(v - finest.v)[:, observed].max() / speed),
                    reduce=seconds,
                    march=least_seconds((lambda wall=wall: marched(scene, wall, 1.0),), 3)[0],
                ))  # fmt: skip

    with progress("what it costs"):
        largest = {
            f"{n} {choice} modes": reduced
            for choice, n, reduced, _ in models
            if (reduced.kind, n) == (KINDS[0], COUNTS[-1])
        }
        solve = solve_costs(scene, full, run("modes"))
        marches = march_costs(scene, full, largest, BANDS_HZ[0])

    # a row for each error, a line for each wall, and whether more modes always help
    rows = []
    for c in cases:
        for band, error in zip(BANDS_HZ, c.receptance, strict=True):
            name = f"{c.method}: receptance to {band / 1e3:g} kHz"
            rows.append(AccuracyRow("reduction", name, c.n_modes, error, c.reduce))
        name = f"{c.method}: velocities"
        rows.append(AccuracyRow("reduction", name, c.n_modes, c.velocities, c.march))
    bands = [f"to {band / 1e3:g} kHz" for band in BANDS_HZ]
    head = ("method", "modes", "up to [kHz]", *bands, "velocities", "reduce [s]", "march [ms]")
    lines = [
        (c.method, c.n_modes, 1e-3 * c.reach, *c.receptance, c.velocities, c.reduce, 1e3 * c.march)
        for c in cases
    ]
    sentences = [
        f"Errors are relative to a model of {len(truth.reduced.K)} coordinates whose own error "
        f"bound is {truth.reduced.error:.1e}; it differs from solutions of the full model at "
        f"{', '.join(f'{f / 1e3:.3g}' for f in truth.checked_hz)} kHz by {truth.difference:.1e}."
    ]
    for method in (method_name(kind, CHOICES[0], True) for kind in KINDS):
        for i, band in enumerate(BANDS_HZ):
            errors = {c.n_modes: c.receptance[i] for c in cases if c.method == method}
            falls = all(a > b for a, b in pairwise(errors.values()))
            sentences.append(
                f"{method}: the rms error of the receptance to {band / 1e3:g} kHz "
                f"{'falls' if falls else 'does not fall'} with every increase of the number of "
                f"modes: {', '.join(f'{error:.1e} with {n}' for n, error in errors.items())}."
            )
    n_modes, factor, eigen, reduce = solve
    sentences.append(
        f"The scene's reduction takes {reduce:.2f} s and the eigenvalue solution for {n_modes} "
        f"modes {eigen:.2f} s of the processor (ratio {reduce / eigen:.2f}). Each includes a "
        f"factorisation of about {factor:.2f} s; without it they take "
        f"{max(reduce - factor, 0):.2f} s and {max(eigen - factor, 0):.2f} s."
    )
    sentences += [
        f"Time integration to an error of {ERROR:g} with {wall}, {n} oscillators: "
        f"{1e3 * seconds:.1f} ms, {seconds / rigid:.2f} times that with a rigid wall."
        for wall, n, seconds, rigid in marches
    ]
    tables = table_of(tuple(rows), printed=False), Table("reduction", head, tuple(lines))
    pictures = (Picture("accuracy_reduction", _picture(cases)),)
    return Finding(tables, tuple(sentences), pictures)


def method_name(kind: str, choice: str, residual: bool) -> str:
    """Name of a way to reduce, in the table."""
    lowest = "" if choice == CHOICES[0] else f" {choice}"
    return f"{kind}{lowest}{' + residual' if residual else ''}"


def _picture(cases: list[ReductionCase]) -> bytes:
    """PNG: errors and costs over the number of modes. A kind of reduction has a colour, a choice
    of modes its dashes; they are named once, in the last panel."""

    def lines(value: Callable[[ReductionCase], float], *, named: bool = False) -> list[Line]:
        curves = []
        styles = (("contact", True, "o-"), ("lowest", True, "o--"), ("contact", False, "o:"))
        for (i, kind), (choice, residual, style) in product(enumerate(KINDS), styles):
            method = method_name(kind, choice, residual)
            same = [case for case in cases if case.method == method]
            n_modes, values = np.array([c.n_modes for c in same]), np.array([*map(value, same)])
            curves.append(Line(method if named else None, n_modes, values, style, i))
        return curves

    sets = []
    for i, band in enumerate(BANDS_HZ):
        receptance = lines(lambda c, i=i: c.receptance[i])
        title = f"receptance to {band / 1e3:g} kHz"
        sets.append(Panel(title, "modes", "relative error", receptance, "xy"))
    velocities, title = lines(lambda c: c.velocities), "velocities of the observed spheres"
    sets.append(Panel(title, "modes", "relative error", velocities, "xy"))
    reduce = lines(lambda c: c.reduce)
    sets.append(Panel("cost of the reduction", "modes", "seconds", reduce, "xy"))
    march = lines(lambda c: 1e3 * c.march, named=True)
    sets.append(Panel("cost of the time integration", "modes", "milliseconds", march, "xy"))
    return panels(sets, columns=3, size=(4.6, 3.6), legend_apart=True)


def least_seconds(calls: tuple[Callable[[], object], ...], repeats: int) -> list[float]:
    """Processor seconds of the quickest of some runs of every call, the calls in turns."""
    seconds = np.empty((repeats, len(calls)))
    for i, j in np.ndindex(seconds.shape):
        started = process_time()
        calls[j]()
        seconds[i, j] = process_time() - started
    return seconds.min(axis=0).tolist()


class FullMatrices(NamedTuple):
    """The full model as the reductions need it."""

    K: object
    M: object
    w: NDArray[np.float64]  # (n,) weights of the contact patch
    contact: rom.Contact
    shared: SharedSolutions


def reduced_by(
    full: FullMatrices, kind: str, selection: rom.Selection, factorise: rom.Factorise
) -> rom.ReducedModel:
    """The full model reduced by "free-modes" or "craig-bampton", without its T."""
    if kind == "free-modes":
        reduced = rom.free_modes(full.K, full.M, full.w, selection, factorise=factorise)
    else:
        boundary = np.flatnonzero(full.w)
        reduced = rom.craig_bampton(
            full.K, full.M, full.w, boundary, selection, factorise=factorise
        )  # fmt: skip
    return reduced._replace(T=None, contact=full.contact)


def wall_of(scene: Scene, reduced: rom.ReducedModel, without: float | None = None) -> dem.Wall:
    """The wall less the compliance `without` [m/N], that of the half-space if None: Hertz' law
    holds it already."""
    local = reduced.contact.half_space if without is None else without
    return wall_from_reduced(reduced, half_space=local, damping=damping(scene.damping, reduced))


def marched(scene: Scene, wall: dem.Wall, finer: float) -> dem.Trajectory:
    """The scene's chain against the wall, to its error times `finer`."""
    observed = [sphere - 1 for sphere in scene.output.spheres] or None
    return coupling.impact(
        chain(scene),
        wall,
        initial_velocity(scene),
        duration=scene.time.duration,
        error=finer * (scene.time.error or ERROR),
        observed=observed,
        n_save=scene.output.samples - 1,
    ).trajectory


def solve_costs(
    scene: Scene, full: FullMatrices, modes: AssemblyModes
) -> tuple[int, float, float, float]:
    """Number of modes, and seconds of a factorisation, of their eigen-solve and of the scene's
    reduction, each with a factorisation of its own."""
    n_modes = scene.reduction.modes or 40
    of_scene = selection(scene)
    if of_scene.by_contact:
        of_scene = of_scene._replace(modes=targets_kept(modes))
    solutions = (
        lambda: fem.factorised(full.K),
        lambda: fem.modes(full.K, full.M, n_modes),
        lambda: reduced_by(full, scene.reduction.kind, of_scene, fem.factorised),
    )
    return n_modes, *least_seconds(solutions, repeats=2)


def march_costs(
    scene: Scene, full: FullMatrices, largest: dict[str, rom.ReducedModel], to_hz: float
) -> list[tuple[str, int, float, float]]:
    """Of marches to ERROR with the `largest` models, and with the modes that this error up to
    to_hz [Hz] keeps: the wall, its number of oscillators, seconds, and those of a rigid wall."""
    to_error = rom.Selection(error=ERROR, choice="contact", to_hz=to_hz)
    reduced = reduced_by(full, "free-modes", to_error, full.shared)
    models = largest | {f"the modes of reduction.error = {ERROR:g}": reduced}
    march_scene = scene.but(time={"error": ERROR})
    walls = {name: wall_of(march_scene, model) for name, model in models.items()}
    rigid, *seconds = least_seconds(
        tuple(
            lambda wall=wall: marched(march_scene, wall, 1.0)
            for wall in (dem.rigid_wall(), *walls.values())
        ),
        repeats=15,
    )
    return [
        (name, len(wall.omega), march, rigid)
        for (name, wall), march in zip(walls.items(), seconds, strict=True)
    ]
