"""How many modes: what a reduced wall gets wrong, against what it costs.

(a) The receptance at the contact against the full model's, rms over rms up to 20 and to 50 kHz,
    with a loss factor of 1 %.
(b) The coupled velocities of the observed spheres against the full model's, over the striker's
    speed.

The full model's answer comes from a Krylov space of the whole structure, grown until its bound (see
rom.contact_modes) is far below the errors that are told, and set beside solutions of the full model
itself at a few frequencies. Seconds are those of the processor, of each reduction as if it were the
only one (see shared_solutions).

Modes are those that the contact moves most up to 50 kHz, or "lowest" in the order of their
frequencies, as reduction.choice says. "+ residual" keeps the static response of all that is not a
mode: the residual-attachment vector of free modes, the constraint modes of Craig-Bampton. Without
it a wall is its modes alone.
"""

from collections.abc import Iterator
from itertools import pairwise, product
from time import process_time
from typing import NamedTuple

import numpy as np

import dem
import fem
import rom
from fem.shared_solutions import SharedSolutions
from workflows.evidence.accuracy.reduction_cost import (
    ERROR,
    Contact,
    costs_of,
    marched,
    reduced_to,
    wall_of,
)
from workflows.evidence.accuracy.reduction_picture import CHOICES, KINDS, Case, method_name, picture
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.accuracy.runs import least_seconds
from workflows.evidence.prose import rendered
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.tables import Table
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.stages.chain import initial_velocity, on_surface
from workflows.stages.pipeline import Progress, Stage, pipeline_of, tables_of
from workflows.stages.reduction import contact_of

SCENE = "rig-rom"
COUNTS = (10, 20, 40, 80, 150)
BANDS_HZ = (20e3, 50e3)
N_FREQUENCIES = 1000  # of the highest band
BOUND = 1e-6  # of the reference's error
CHECKED = (0.013, 0.11, 0.37, 0.71, 0.97)  # of the highest band, solved directly
FINER = 1e-2  # times the scene's error: the march must not show among the differences
REPEATS = 3


class Reduced(NamedTuple):
    """A reduced model, how many modes were asked for and how they were chosen."""

    choice: str
    n_modes: int
    model: rom.ReducedModel
    seconds: float  # of the processor, as if it were the only one


class Reference(NamedTuple):
    """What stands for the full model: reduced, its stated error the bound; beside its solutions
    at checked_hz (k,) it is off by `off`, relative rms."""

    reduced: rom.ReducedModel
    checked_hz: tuple[float, ...]
    off: float


REFERENCE = {
    "reference-response": Stage(
        f"{__name__}:reference", tables_of("patch", "assembly"), ("model", "contact")
    )
}


def reference(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> Reference:
    """The full model's answer at the contact up to the highest band."""
    to_hz = BANDS_HZ[-1]
    asked = rom.Selection(error=BOUND, to_hz=to_hz, choice="contact")
    whole = rom.free_modes(model.K, model.M, contact.w, asked, factorise=fem.factorised)
    whole = whole._replace(T=None, contact=contact_of(scene, model, contact))
    f = tuple(share * to_hz for share in CHECKED)
    direct = fem.receptance(model.K, model.M, contact.w, np.array(f), loss_factor=rom.LOSS)
    off = np.linalg.norm(rom.receptance(whole, None, f, loss=rom.LOSS) - direct)
    return Reference(whole, f, float(off / np.linalg.norm(direct)))


def reduction(scene: Scene, progress: Progress) -> Finding:
    """Error and cost of a reduced wall against the number of its modes."""
    _refuse(scene)
    run = pipeline_of(scene, progress, REFERENCE)
    model, patch = run("model"), run("contact")
    known = contact_of(scene, model, patch)
    scene = on_surface(scene, known)
    contact = Contact(model.K, model.M, patch.w, known, SharedSolutions())
    full = run("reference-response")
    f = np.arange(1, N_FREQUENCIES + 1) / N_FREQUENCIES * BANDS_HZ[-1]
    H = rom.receptance(full.reduced, None, f, loss=rom.LOSS)
    with progress("reference march"):
        finest = marched(scene, wall_of(scene, full.reduced), FINER)
    models = tuple(_models(contact, progress))
    cases = tuple(_cases(scene, models, f, H, finest, progress))
    with progress("what it costs"):
        largest = {
            f"{one.n_modes} {one.choice} modes": one.model
            for one in models
            if (one.model.kind, one.n_modes) == (KINDS[0], COUNTS[-1])
        }
        costs = costs_of(scene, contact, run("modes"), largest, BANDS_HZ[0])
    rows = tuple(row for case in cases for row in _rows(case))
    sentences = rendered(
        __file__, top=BANDS_HZ[-1], full=full, size=len(full.reduced.K), falls=_falls(cases),
        costs=costs, asked=ERROR,
    )  # fmt: skip
    drawn = Picture("accuracy_reduction", picture(cases, BANDS_HZ))
    return Finding((table_of(rows, printed=False), _table(cases)), sentences, (drawn,))


def _refuse(scene: Scene) -> None:
    if scene.assembly is None or scene.chain is None or not isinstance(scene.wall, RomWall):
        raise InvalidScene(
            f'the scene {scene.name} has no chain before an assembly with wall.kind = "rom"; '
            "take rig-rom."
        )
    if any(table.dashpots for table in scene.springs.values()):
        raise InvalidScene(
            "joints have dashpots, which this study would leave out of the responses it compares; "
            "set joints.head.cx .. joints.foot.crz to 0."
        )
    if scene.patch and scene.patch.weights == "thesis":
        raise InvalidScene(
            'patch.weights = "thesis" is read elsewhere than it is pushed, which no number of '
            'modes corrects; take "hertz" or "area".'
        )


def _models(contact: Contact, progress: Progress) -> Iterator[Reduced]:
    for kind, choice, n in product(KINDS, CHOICES, COUNTS):
        with progress(f"{kind} {choice} {n}"):
            started = process_time() + contact.shared.saved
            model = reduced_to(contact, kind, n, choice, BANDS_HZ[-1])
            yield Reduced(choice, n, model, process_time() + contact.shared.saved - started)


def _cases(
    scene: Scene, models: tuple[Reduced, ...], f, full, finest: dem.Trajectory, progress: Progress
) -> Iterator[Case]:
    with progress("marches"):
        for one in models:
            for bare in (False, True)[: 2 if one.choice == CHOICES[0] else 1]:
                yield _case(scene, one, bare, f, full, finest)


def _case(scene: Scene, one: Reduced, bare: bool, f, full, finest) -> Case:
    whole, n = one.model, one.n_modes
    reduced = rom.modes_alone(whole, n) if bare else whole
    error = rom.receptance(reduced, None, f, loss=rom.LOSS) - full
    bands = [f <= band for band in BANDS_HZ]
    # modes alone do not hold the half-space that only many of them add up to: none is taken out
    wall = wall_of(scene, reduced, 0.0 if bare else None)
    v = marched(scene, wall, FINER).v
    observed = [sphere - 1 for sphere in scene.output.spheres] or slice(None)
    speed = np.abs(initial_velocity(scene)).max()
    return Case(
        method=method_name(whole.kind, one.choice, bare),
        n_modes=n,
        reach=float(rom.modes_alone(whole, n).K[-1, -1] ** 0.5 / (2 * np.pi)),
        receptance=tuple(float(np.linalg.norm(error[b]) / np.linalg.norm(full[b])) for b in bands),
        velocities=float(np.abs(v - finest.v)[:, observed].max() / speed),
        reduce=one.seconds,
        march=least_seconds((lambda: marched(scene, wall, 1.0),), REPEATS)[0],
    )


def _rows(case: Case) -> Iterator[Row]:
    for band, error in zip(BANDS_HZ, case.receptance, strict=True):
        name = f"{case.method}: receptance to {band / 1e3:g} kHz"
        yield Row("reduction", name, case.n_modes, error, case.reduce)
    name = f"{case.method}: velocities"
    yield Row("reduction", name, case.n_modes, case.velocities, case.march)


def _table(cases: tuple[Case, ...]) -> Table:
    bands = [f"to {band / 1e3:g} kHz" for band in BANDS_HZ]
    head = ("method", "modes", "up to [kHz]", *bands, "velocities", "reduce [s]", "march [ms]")
    rows = [
        (c.method, c.n_modes, 1e-3 * c.reach, *c.receptance, c.velocities, c.reduce, 1e3 * c.march)
        for c in cases
    ]
    return Table("reduction", head, tuple(rows))


class Fall(NamedTuple):
    """How the error of a method in a band goes with the number of modes."""

    method: str
    band_hz: float
    error: dict[int, float]  # by number of modes

    @property
    def falls(self) -> bool:
        """With every step of the modes."""
        return all(finer < coarser for coarser, finer in pairwise(self.error.values()))


def _falls(cases: tuple[Case, ...]) -> Iterator[Fall]:
    for method, band in product((method_name(kind, CHOICES[0], False) for kind in KINDS), (0, 1)):
        errors = {c.n_modes: c.receptance[band] for c in cases if c.method == method}
        yield Fall(method, BANDS_HZ[band], errors)
