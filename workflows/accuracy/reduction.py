"""How many modes: what a reduced wall gets wrong, against what it costs.

(a) The receptance at the contact against the full model's, rms over rms up to 20 and to 50 kHz,
    with a loss factor of 1 %.
(b) The coupled velocities of the observed spheres against the full model's, over the striker's
    speed.

The full model's answer comes from a Krylov space of the whole structure, grown until its bound (see
rom.contact_modes) is far below the errors that are told, and set beside direct solutions at a few
frequencies: direct ones at every frequency would take longer than all the rest. Seconds are those
of the processor, of each reduction as if it were the only one (see shared_solutions).

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
from workflows.accuracy.accuracy import Row, Study, aligned, short
from workflows.accuracy.reduction_cost import (
    Contact,
    cost_sentences,
    least_seconds,
    marched,
    reduced_to,
    wall_of,
)
from workflows.accuracy.reduction_picture import CHOICES, KINDS, Case, method_name, picture
from workflows.accuracy.shared_solutions import SharedSolutions
from workflows.chain_stages import initial_velocity
from workflows.reduced_wall import half_space
from workflows.reduction_stage import provenance
from workflows.run_folder import Picture
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.stages import Watch, pipeline_of

COUNTS = (10, 20, 40, 80, 150)
BANDS_HZ = (20e3, 50e3)
N_FREQUENCIES = 1000  # of the highest band
BOUND = 1e-6  # of the reference's error
CHECKED = (0.013, 0.11, 0.37, 0.71, 0.97)  # of the highest band, solved directly
LOSS = 0.01
FINER = 1e-2  # times the scene's error: the march must not show among the differences
REPEATS = 3


class Reduced(NamedTuple):
    """A reduced model, how many modes were asked for and how they were chosen."""

    choice: str
    n_modes: int
    model: rom.ReducedModel
    seconds: float  # of the processor, as if it were the only one


class Reference(NamedTuple):
    """What stands for the full model: reduced, its stated error the bound; beside direct solutions
    at checked_hz (k,) it is off by `off`, relative rms."""

    reduced: rom.ReducedModel
    checked_hz: tuple[float, ...]
    off: float


def reference(scene: Scene, model: fem.Model, contact: fem.ContactPatch) -> Reference:
    """The full model's answer at the contact up to the highest band."""
    to_hz = BANDS_HZ[-1]
    whole = rom.free_modes(
        model.K, model.M, contact.w, error=BOUND, to_hz=to_hz, choice="contact",
        factorise=fem.factorised, provenance=provenance(scene, model, contact),
    )._replace(T=None)  # fmt: skip
    f = tuple(share * to_hz for share in CHECKED)
    direct = fem.receptance(model.K, model.M, contact.w, np.array(f), loss_factor=LOSS)
    off = np.linalg.norm(rom.receptance(whole, None, f, loss=LOSS) - direct)
    return Reference(whole, f, float(off / np.linalg.norm(direct)))


def reduction(scene: Scene, watch: Watch) -> Study:
    """Number of modes x with and without residual x kind, of the scene's assembly."""
    _refuse(scene)
    run = pipeline_of(scene, watch)
    model, patch = run("model"), run("contact")
    notes = provenance(scene, model, patch)
    contact = Contact(model.K, model.M, patch.w, notes, SharedSolutions())
    full = run("reference-response")
    f = np.arange(1, N_FREQUENCIES + 1) / N_FREQUENCIES * BANDS_HZ[-1]
    H = rom.receptance(full.reduced, None, f, loss=LOSS)
    with watch("reference march"):
        finest = marched(scene, wall_of(scene, full.reduced), FINER)
    models = tuple(_models(contact, watch))
    cases = tuple(_cases(scene, models, f, H, finest, watch))
    with watch("what it costs"):
        largest = {
            f"{one.n_modes} {one.choice} modes": one.model
            for one in models
            if (one.model.kind, one.n_modes) == (KINDS[0], COUNTS[-1])
        }
        costs = tuple(cost_sentences(scene, contact, run("modes"), largest, BANDS_HZ[0]))
    return Study(
        tuple(row for case in cases for row in _rows(case)),
        (table(cases), *_reading(), _of_the(full), *_sentences(cases), *costs),
        (Picture("accuracy_reduction", picture(cases, BANDS_HZ)),),
    )


def _refuse(scene: Scene) -> None:
    if scene.assembly is None or scene.chain is None or not isinstance(scene.wall, RomWall):
        raise InvalidScene(
            f'the scene {scene.name} has no chain before an assembly with wall.kind = "rom"; '
            "take rig-rom."
        )
    if scene.joints and any(table.dashpots for _, table in scene.joints):
        raise InvalidScene(
            "joints have dashpots, which this study would leave out of the responses it compares; "
            "set joints.head.cx .. joints.foot.crz to 0."
        )
    if scene.patch.weights == "thesis":
        raise InvalidScene(
            'patch.weights = "thesis" is read elsewhere than it is pushed, which no number of '
            'modes mends; take "hertz" or "area".'
        )


def _models(contact: Contact, watch: Watch) -> Iterator[Reduced]:
    for kind, choice, n in product(KINDS, CHOICES, COUNTS):
        with watch(f"{kind} {choice} {n}"):
            started = process_time() + contact.shared.saved
            model = reduced_to(contact, kind, n, choice, BANDS_HZ[-1])
            yield Reduced(choice, n, model, process_time() + contact.shared.saved - started)


def _cases(
    scene: Scene, models: tuple[Reduced, ...], f, full, finest: dem.Trajectory, watch: Watch
) -> Iterator[Case]:
    with watch("marches"):
        for one in models:
            for bare in (False, True)[: 2 if one.choice == CHOICES[0] else 1]:
                yield _case(scene, one, bare, f, full, finest)


def _case(scene: Scene, one: Reduced, bare: bool, f, full, finest) -> Case:
    whole, n = one.model, one.n_modes
    reduced = modes_alone(whole, n) if bare else whole
    error = rom.receptance(reduced, None, f, loss=LOSS) - full
    bands = [f <= band for band in BANDS_HZ]
    # modes alone do not hold the half-space that only many of them add up to: none is taken out
    wall = wall_of(scene, reduced, 0.0 if bare else half_space(reduced))
    v = marched(scene, wall, FINER).v
    observed = [sphere - 1 for sphere in scene.output.spheres] or slice(None)
    speed = np.abs(initial_velocity(scene)).max()
    return Case(
        method=method_name(whole.kind, one.choice, bare),
        n_modes=n,
        reach=float(modes_alone(whole, n).K[-1, -1] ** 0.5 / (2 * np.pi)),
        receptance=tuple(float(np.linalg.norm(error[b]) / np.linalg.norm(full[b])) for b in bands),
        velocities=float(np.abs(v - finest.v)[:, observed].max() / speed),
        reduce=one.seconds,
        march=least_seconds((lambda: marched(scene, wall, 1.0),), REPEATS)[0],
    )


def modes_alone(reduced: rom.ReducedModel, n: int) -> rom.ReducedModel:
    """The n lowest modes of a reduced model, nothing for the rest."""
    wall = rom.modal(reduced)
    return reduced._replace(
        K=np.diag(wall.omega[:n] ** 2), M=np.eye(n), C=None, w=wall.phi[:n], n_boundary=0,
        n_residual=0, kind="free-modes",
    )  # fmt: skip


def _rows(case: Case) -> Iterator[Row]:
    for band, error in zip(BANDS_HZ, case.receptance, strict=True):
        name = f"{case.method}: receptance to {band / 1e3:g} kHz"
        yield Row("reduction", name, case.n_modes, error, case.reduce)
    name = f"{case.method}: velocities"
    yield Row("reduction", name, case.n_modes, case.velocities, case.march)


def table(cases: tuple[Case, ...]) -> str:
    """All cases, a line each."""
    bands = [f"to {band / 1e3:g} kHz" for band in BANDS_HZ]
    head = ("method", "modes", "up to [kHz]", *bands, "velocities", "reduce [s]", "march [ms]")
    lines = [
        (c.method, *map(short, (c.n_modes, 1e-3 * c.reach, *c.receptance, *_costs(c))))
        for c in cases
    ]
    return aligned([head, *lines], left=1)


def _costs(case: Case) -> tuple[float, ...]:
    return case.velocities, case.reduce, 1e3 * case.march


def _of_the(full: Reference) -> str:
    listed = ", ".join(f"{hz / 1e3:.3g}" for hz in full.checked_hz)
    return (
        f"Errors are against a model of {len(full.reduced.K)} coordinates whose own is stated as "
        f"{full.reduced.error:.1e}; beside direct solutions of the full model at {listed} kHz it "
        f"is off by {full.off:.1e}."
    )


def _reading() -> tuple[str, ...]:
    return (
        "Seconds to reduce are those of the processor, each reduction as if it were the only one. "
        f"Modes of the contact are chosen, and their error is bounded, up to {BANDS_HZ[-1] / 1e3:g}"
        " kHz, which costs about the same for few and for many; the lowest are bounded nowhere.",
        "Without the residual more modes do not bring the velocities nearer: modes alone add up "
        "to a part of the contact's own dent, which the Hertz law holds already, and more of them "
        "to more of it. With the residual the dent is whole and is taken off.",
    )


def _sentences(cases: tuple[Case, ...]) -> Iterator[str]:
    for method, band in product((method_name(kind, CHOICES[0], False) for kind in KINDS), (0, 1)):
        errors = [case.receptance[band] for case in cases if case.method == method]
        falls = all(finer < coarser for coarser, finer in pairwise(errors))
        listed = ", ".join(f"{error:.1e} with {n}" for n, error in zip(COUNTS, errors, strict=True))
        yield (
            f"{method}: the rms error to {BANDS_HZ[band] / 1e3:g} kHz "
            f"{'falls' if falls else 'does not fall'} with every step of the modes, {listed}."
        )
