"""How many modes: what a reduced wall gets wrong, against what it costs.

(a) The receptance at the contact against direct solutions of the full model, rms over rms up to
    20 and to 50 kHz, with a loss factor of 1 %.
(b) The coupled velocities of the observed spheres against a model of twice the largest number of
    modes, over the striker's speed.

Modes are those that the contact moves most up to 50 kHz, or "lowest" in the order of their
frequencies, as reduction.choice says. "+ residual" keeps the static response of all that is not a
mode: the residual-attachment vector of free modes, the constraint modes of Craig-Bampton. Without
it a wall is its modes alone.
"""

from collections.abc import Callable, Iterator
from itertools import pairwise, product
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import dem
import fem
import rom
from workflows.accuracy import Row, Study, aligned, short
from workflows.assembly_stages import provenance
from workflows.chain_stages import initial_velocity
from workflows.reduced_wall import half_space
from workflows.reduction_cost import (
    Contact,
    cost_sentences,
    marched,
    reduced_to,
    wall_of,
)
from workflows.run_folder import Picture
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.stages import Watch, pipeline_of
from workflows.study_figures import Line, Panel, panels

COUNTS = (10, 20, 40, 80, 150)
BANDS_HZ = (20e3, 50e3)
SPACING_HZ = 1e3  # of the direct solutions
LOSS = 0.01
KINDS = ("free-modes", "craig-bampton")
CHOICES = ("contact", "lowest")
FINER = 1e-2  # times the scene's error: the march must not show among the differences
REPEATS = 3


class Case(NamedTuple):
    """One reduced wall: what it gets wrong and the seconds it takes."""

    method: str
    n_modes: int
    reach: float  # [Hz] of the highest mode
    receptance: tuple[float, ...]  # relative rms error per band
    velocities: float  # relative to the striker
    reduce: float  # [s]
    march: float  # [s]


def direct(
    scene: Scene, model: fem.Model, contact: fem.ContactPatch
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Frequencies [Hz] and the full model's receptance [m/N] at the contact."""
    f = np.arange(0.5, BANDS_HZ[-1] / SPACING_HZ) * SPACING_HZ
    return f, fem.receptance(model.K, model.M, contact.w, f, loss_factor=LOSS)


def reduction(scene: Scene, watch: Watch) -> Study:
    """Number of modes x with and without residual x kind, of the scene's assembly."""
    _refuse(scene)
    run = pipeline_of(scene, watch)
    model, patch = run("model"), run("contact")
    contact = Contact(model.K, model.M, patch.w, provenance(scene, model, patch))
    f, full = run("direct-response")
    most = reduced_to(contact, KINDS[0], 2 * COUNTS[-1], CHOICES[0], BANDS_HZ[-1])
    reference = marched(scene, wall_of(scene, most), FINER)
    cases = tuple(_cases(scene, contact, f, full, reference, watch))
    with watch("what it costs"):
        costs = tuple(cost_sentences(scene, contact, run("modes"), COUNTS[-1], BANDS_HZ))
    return Study(
        tuple(row for case in cases for row in _rows(case)),
        (table(cases), *_sentences(cases), *costs),
        (Picture("accuracy_reduction", _picture(cases)),),
    )


def _refuse(scene: Scene) -> None:
    if scene.assembly is None or scene.chain is None or not isinstance(scene.wall, RomWall):
        raise InvalidScene(
            f'the scene {scene.name} has no chain before an assembly with wall.kind = "rom"; '
            "take rig-rom."
        )
    if scene.patch.weights == "thesis":
        raise InvalidScene(
            'patch.weights = "thesis" is read elsewhere than it is pushed, which no number of '
            'modes mends; take "hertz" or "area".'
        )


def _cases(
    scene: Scene, contact: Contact, f, full, reference: dem.Trajectory, watch: Watch
) -> Iterator[Case]:
    for kind, choice, n in product(KINDS, CHOICES, COUNTS):
        with watch(f"{kind} {choice} {n}"):
            started = perf_counter()
            reduced = reduced_to(contact, kind, n, choice, BANDS_HZ[-1])
            seconds = perf_counter() - started
            for bare in (False, True)[: 2 if choice == CHOICES[0] else 1]:
                yield _case(scene, reduced, choice, n, bare, f, full, reference, seconds)


def _case(
    scene: Scene, whole: rom.ReducedModel, choice: str, n: int, bare: bool, f, full, reference,
    seconds: float,
) -> Case:  # fmt: skip
    reduced = modes_alone(whole, n) if bare else whole
    error = rom.receptance(reduced, None, f, loss=LOSS) - full
    bands = [f < band for band in BANDS_HZ]
    # modes alone do not hold the half-space that only many of them add up to: none is taken out
    wall = wall_of(scene, reduced, 0.0 if bare else half_space(reduced))
    v = marched(scene, wall, FINER).v
    observed = [sphere - 1 for sphere in scene.output.spheres] or slice(None)
    speed = np.abs(initial_velocity(scene)).max()
    return Case(
        method=_method(whole.kind, choice, bare),
        n_modes=n,
        reach=float(modes_alone(whole, n).K[-1, -1] ** 0.5 / (2 * np.pi)),
        receptance=tuple(float(np.linalg.norm(error[b]) / np.linalg.norm(full[b])) for b in bands),
        velocities=float(np.abs(v - reference.v)[:, observed].max() / speed),
        reduce=seconds,
        march=_least(lambda: marched(scene, wall, 1.0)),
    )


def _method(kind: str, choice: str, bare: bool) -> str:
    lowest = "" if choice == CHOICES[0] else f" {choice}"
    return f"{kind}{lowest}{'' if bare else ' + residual'}"


def modes_alone(reduced: rom.ReducedModel, n: int) -> rom.ReducedModel:
    """The n lowest modes of a reduced model, nothing for the rest."""
    wall = rom.modal(reduced)
    return reduced._replace(
        K=np.diag(wall.omega[:n] ** 2), M=np.eye(n), C=None, w=wall.phi[:n], n_boundary=0,
        n_residual=0, kind="free-modes",
    )  # fmt: skip


def _least(call: Callable[[], object]) -> float:
    """Seconds of the quickest of some calls."""
    times = []
    for _ in range(REPEATS):
        started = perf_counter()
        call()
        times.append(perf_counter() - started)
    return min(times)


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


def _sentences(cases: tuple[Case, ...]) -> Iterator[str]:
    for method, band in product((_method(kind, CHOICES[0], False) for kind in KINDS), (0, 1)):
        errors = [case.receptance[band] for case in cases if case.method == method]
        falls = all(finer < coarser for coarser, finer in pairwise(errors))
        listed = ", ".join(f"{error:.1e} with {n}" for n, error in zip(COUNTS, errors, strict=True))
        yield (
            f"{method}: the rms error to {BANDS_HZ[band] / 1e3:g} kHz "
            f"{'falls' if falls else 'does not fall'} with every step of the modes, {listed}."
        )


def _picture(cases: tuple[Case, ...]) -> bytes:
    measures = [
        (f"receptance to {band / 1e3:g} kHz", lambda c, i=i: c.receptance[i])
        for i, band in enumerate(BANDS_HZ)
    ]
    measures += [("velocities of the observed spheres", lambda c: c.velocities)]
    errors = [
        Panel(name, "modes", "relative error", _lines(cases, error), "xy")
        for name, error in measures
    ]
    shown = [(kind, choice) for kind in KINDS for choice in CHOICES]
    cost = [
        Line(name, *_points(cases, name, lambda c: c.reduce), "o-", i)
        for i, (kind, choice) in enumerate(shown)
        for name in (_method(kind, choice, False),)
    ]
    seconds = Panel("what the reduction costs", "modes", "seconds", cost, "xy")
    return panels([*errors, seconds], columns=2, size=(5.6, 3.8))


def _lines(cases: tuple[Case, ...], error: Callable[[Case], float]) -> list[Line]:
    styles = (("contact", False, "o-"), ("lowest", False, "o:"), ("contact", True, "o--"))
    return [
        Line(name, *_points(cases, name, error), style, 2 * i + (choice == "lowest"))
        for i, kind in enumerate(KINDS)
        for choice, bare, style in styles
        for name in (_method(kind, choice, bare),)
    ]


def _points(cases, method: str, value: Callable[[Case], float]):
    chosen = [case for case in cases if case.method == method]
    return np.array([c.n_modes for c in chosen]), np.array([value(c) for c in chosen])
