"""Seconds and memory of each stage against the unknowns, the exponents, and what bounds them.

    cost = c dofs^p

by least squares over logarithms. All elements grow and shrink together. The stages are those of
`beadwave reduce`: mesh, assembly of K and M with what joins them, one factorisation of K, the
lowest modes and the reduction, which both solve with it. CalculiX, where it is
installed, finds ten modes of the same deck in the same run.
"""

from collections.abc import Iterable
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.abaqus import input_deck
from fem.correlation import RIGID
from fem.factorisation import has_pardiso
from workflows.evidence.accuracy.cost import Cost, CostGrowth, cost_growth, cost_of_command, costed
from workflows.evidence.accuracy.row import Row
from workflows.evidence.accuracy.rows import table_of
from workflows.evidence.prose import rendered
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Mesh, Scene
from workflows.scene.parts import with_assembly
from workflows.stages import assembly as stages
from workflows.stages.pipeline import Progress
from workflows.stages.reduction import reduction

SCENE = "rig-rom"  # whose mesh no holes keep fine
TIMES = (2.83, 2.0, 1.41, 1.0)  # the scene's element sizes: its own mesh is the finest
CALCULIX, N_MODES = "CalculiX", 10
PEER_UNTIL = 1e5  # unknowns, minutes with its default solver
COMPARED = 6  # elastic modes


class Sized(NamedTuple):
    """One mesh: what its modes are, and what its stages cost."""

    times: float  # the scene's element sizes
    dofs: int
    hz: NDArray[np.float64]  # (COMPARED,)
    costs: dict[str, Cost]  # by stage
    n_modes: int  # that were found


def size(scene: Scene, progress: Progress, *, times: tuple[float, ...] = TIMES) -> Finding:
    """Seconds and memory of mesh, assembly, factor, modes and reduction against the unknowns."""
    with_assembly(scene)
    sized = []
    for factor in sorted(times, reverse=True):
        with progress(f"elements times {factor:g}"):
            sized.append(_sized(_scaled(scene, factor), factor))
    errors = [_error(one, sized[-1]) for one in sized[:-1]] + [None]
    names = tuple(dict.fromkeys(name for one in sized for name in one.costs))
    rows = tuple(
        Row("size", name, one.dofs, error, cost.seconds)
        for one, error in zip(sized, errors, strict=True)
        for name, cost in one.costs.items()
    )
    growths = {
        name: cost_growth(name, {one.dofs: one.costs[name] for one in sized if name in one.costs})
        for name in names
    }
    tables = (
        table_of(rows, printed=False),
        Table("size", *_lines(sized, errors, names), _printed(sized, errors, growths)),
        Table("exponents", ("stage", "seconds", "memory"), tuple(growths.values()), ()),
    )
    last = sized[-1]
    ours = {name: cost for name, cost in last.costs.items() if name != CALCULIX}
    sentences = rendered(
        __file__, last=last, growths=growths, compared=COMPARED, n_modes=N_MODES,
        slowest=max(ours, key=lambda name: ours[name].seconds),
        largest=max(ours, key=lambda name: ours[name].bytes or 0.0),
        seconds=sum(cost.seconds for cost in ours.values()),
        solver="PARDISO" if has_pardiso() else None,
        peer=_beside_the_peer(sized),
    )  # fmt: skip
    return Finding(tables, sentences, (Picture("size", _picture(sized, names)),))


def _scaled(scene: Scene, factor: float) -> Scene:
    """The scene with its element sizes times a factor."""
    sizes = {name: factor * value for name, value in scene.mesh if isinstance(value, float)}
    return scene.model_copy(update={"mesh": Mesh.model_copy(scene.mesh, update=sizes)})


def _sized(scene: Scene, times: float) -> Sized:
    costs = {}

    def stage(name, call):
        result, costs[name] = costed(call)
        return result

    mesh = stage("mesh", lambda: stages.mesh(scene))
    model = stage("assemble", lambda: stages.model(scene, mesh))
    factor = stage("factorise", lambda: stages.factor(scene, model))
    modes = stage("modes", lambda: stages.modes(scene, model, factor))
    if not scene.is_general or scene.strike is not None:
        contact = stages.contact(scene, mesh, model)
        stage("reduce", lambda: reduction(scene, model, contact, modes, factor))
    if which("ccx") and model.K.shape[0] < PEER_UNTIL:
        peer = _calculix(input_deck(model, mesh.materials, n_modes=N_MODES))
        costs |= {} if peer is None else {CALCULIX: peer}
    elastic = modes.omega[modes.omega > RIGID * modes.omega.max()]
    return Sized(times, modes.n_dofs, elastic[:COMPARED] / (2 * np.pi), costs, len(modes.omega))


def _calculix(deck: str) -> Cost | None:
    with TemporaryDirectory() as folder:
        Path(folder, "deck.inp").write_text(deck, encoding="utf-8")
        return cost_of_command(["ccx", "deck"], Path(folder))


def _error(one: Sized, finest: Sized) -> float:
    """Largest relative difference of the frequencies."""
    return float(np.abs(one.hz / finest.hz - 1).max())


def _lines(sized: Iterable[Sized], errors, stages: tuple[str, ...]):
    """Columns and rows of the table."""
    units = [f"{stage} [{unit}]" for stage in stages for unit in ("s", "GB")]
    rows = tuple(
        (one.times, one.dofs, error, *(x for s in stages for x in _told(one.costs.get(s))))
        for one, error in zip(sized, errors, strict=True)
    )
    return ("elements", "dofs", "error", *units), rows


def _printed(sized: list[Sized], errors, growths: dict[str, CostGrowth]) -> tuple[tuple, ...]:
    """A column for each mesh: seconds of each stage, then memory, and the power of each."""
    rows = [("unknowns", *(one.dofs for one in sized), "power")]
    for i, unit in enumerate(("s", "GB")):
        for stage, growth in growths.items():
            told = (_told(one.costs.get(stage))[i] for one in sized)
            rows.append((f"{stage} [{unit}]", *told, growth[1 + i]))
    return (*rows, ("error", *errors, None))


def _told(cost: Cost | None) -> tuple[float | None, float | None]:
    if cost is None:
        return None, None
    return cost.seconds, None if cost.bytes is None else cost.bytes / 1e9


class Beside(NamedTuple):
    """The largest mesh that both solved."""

    dofs: int
    ours: Cost  # of our factor and modes
    theirs: Cost
    n_ours: int  # modes


def _beside_the_peer(sized: list[Sized]) -> Beside | None:
    both = [one for one in sized if CALCULIX in one.costs]
    if not both:
        return None
    one = both[-1]
    costs = one.costs
    ours = costs["modes"]._replace(seconds=costs["factorise"].seconds + costs["modes"].seconds)
    return Beside(one.dofs, ours, costs[CALCULIX], one.n_modes)


def _picture(sized: list[Sized], stages: tuple[str, ...]) -> bytes:
    """Seconds and memory of each stage against the unknowns."""
    told = {s: np.array([(one.dofs, *_told(one.costs[s])) for one in sized if s in one.costs],
                        dtype=float).T for s in stages}  # fmt: skip
    sets = [
        Panel("", "unknowns", label, [Line(s, told[s][0], told[s][i], "o-") for s in stages], "xy")
        for i, label in ((1, "time [s]"), (2, "memory held at most [GB]"))
    ]
    return panels(sets, columns=2, size=(4.5, 3.8))
