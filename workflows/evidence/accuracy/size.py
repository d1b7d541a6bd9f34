"""Seconds and memory of each stage against the unknowns, the exponents, and what bounds them.

    cost = c dofs^p

by least squares over logarithms. All elements grow and shrink together. The stages are those of
`beadwave reduce`: mesh, assembly of K and M with what joins them, one factorisation of K, the
lowest modes and the reduction, which both solve with it. CalculiX, where it is
installed, finds ten modes of the same deck in the same run.
"""

from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.abaqus import input_deck
from beadwave.fem.correlation import RIGID
from beadwave.fem.factorisation import has_pardiso
from beadwave.workflows.evidence.accuracy.cost import Cost, cost_growth, cost_of_command, costed
from beadwave.workflows.evidence.accuracy.row import AccuracyRow, table_of
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.parts import with_assembly
from beadwave.workflows.stages import assembly as stages
from beadwave.workflows.stages.krylov_space import krylov_space
from beadwave.workflows.stages.progress import Progress
from beadwave.workflows.stages.reduction import reduction

SCENE = "rig-rom"  # whose mesh no holes keep fine
TIMES = (2.83, 2.0, 1.41, 1.0)  # the scene's element sizes: its own mesh is the finest
ALONE = True  # 50 000 unknowns and three coarser meshes
CALCULIX, N_CALCULIX = "CalculiX", 10  # modes of its deck


class SizedMesh(NamedTuple):
    """One mesh: what its modes are, and what its stages cost."""

    times: float  # the scene's element sizes
    dofs: int
    hz: NDArray[np.float64]  # the lowest elastic modes, at most six
    costs: dict[str, Cost]  # by stage
    n_modes: int  # all that the stage computes


def size(scene: Scene, progress: Progress, *, times: tuple[float, ...] = TIMES) -> Finding:
    """Seconds and memory of mesh, assembly, factor, modes and reduction against the unknowns.

    `times` are factors on the scene's element sizes; errors are those of the frequencies against
    the finest mesh, costs grow by a power of the unknowns.
    """
    with_assembly(scene)
    meshes = []
    for factor in sorted(times, reverse=True):
        with progress(f"elements times {factor:g}"):
            scaled = scene.but(mesh={"scale": factor * scene.mesh.scale})
            meshes.append(_costed_mesh(scaled, factor))
    finest = meshes[-1]
    errors = [float(np.abs(mesh.hz / finest.hz - 1).max()) for mesh in meshes[:-1]] + [None]
    names = tuple(dict.fromkeys(name for mesh in meshes for name in mesh.costs))
    growths = {
        name: cost_growth(name, {m.dofs: m.costs[name] for m in meshes if name in m.costs})
        for name in names
    }

    # seconds and gigabytes (meshes,) of each stage; None where it was not run or is not told
    seconds, gigabytes = {}, {}
    for name in names:
        costs = [mesh.costs.get(name) for mesh in meshes]
        seconds[name] = [None if cost is None else cost.seconds for cost in costs]
        gigabytes[name] = [
            None if cost is None or cost.bytes is None else cost.bytes / 1e9 for cost in costs
        ]

    # a row for each mesh; printed a column for each mesh, seconds first, and the power of each row
    columns = [f"{name} [{unit}]" for name in names for unit in ("s", "GB")]
    lines = []
    for i, mesh in enumerate(meshes):
        costs = (column[i] for name in names for column in (seconds[name], gigabytes[name]))
        lines.append((mesh.times, mesh.dofs, errors[i], *costs))
    printed = [("unknowns", *(mesh.dofs for mesh in meshes), "power")]
    printed += [(f"{name} [s]", *seconds[name], growths[name].seconds) for name in names]
    printed += [(f"{name} [GB]", *gigabytes[name], growths[name].bytes) for name in names]
    printed.append(("error", *errors, None))
    rows = tuple(
        AccuracyRow("size", name, mesh.dofs, error, cost.seconds)
        for mesh, error in zip(meshes, errors, strict=True)
        for name, cost in mesh.costs.items()
    )
    tables = (
        table_of(rows, printed=False),
        Table("size", ("elements", "dofs", "error", *columns), tuple(lines), tuple(printed)),
        Table("exponents", ("stage", "seconds", "memory"), tuple(growths.values()), ()),
    )

    # CalculiX beside our factorisation and modes
    solved_by_both = [mesh for mesh in meshes if CALCULIX in mesh.costs]
    our_costs = {name: cost for name, cost in finest.costs.items() if name != CALCULIX}
    sentences = rendered(
        __file__, last=finest, growths=growths, compared=len(finest.hz), n_modes=N_CALCULIX,
        slowest=max(our_costs, key=lambda name: our_costs[name].seconds),
        largest=max(our_costs, key=lambda name: our_costs[name].bytes or 0.0),
        seconds=sum(cost.seconds for cost in our_costs.values()),
        solver="PARDISO" if has_pardiso() else None, both=solved_by_both[-1:],
    )  # fmt: skip

    axes = []
    for label, values in (("time [s]", seconds), ("memory held at most [GB]", gigabytes)):
        curves = []
        for name in names:
            measured = zip(meshes, values[name], strict=True)
            points = [(mesh.dofs, value) for mesh, value in measured if name in mesh.costs]
            curves.append(Line(name, *np.array(points, dtype=float).T, "o-"))
        axes.append(Panel("", "unknowns", label, curves, "xy"))
    picture = panels(axes, columns=2, size=(4.5, 3.8))
    return Finding(tables, sentences, (Picture("size", picture),))


def _costed_mesh(scene: Scene, times: float) -> SizedMesh:
    """The stages of `beadwave reduce`, each with its cost."""
    costs = {}

    def stage(name, call):
        result, costs[name] = costed(call)
        return result

    mesh = stage("mesh", lambda: stages.mesh(scene))
    model = stage("assemble", lambda: stages.model(scene, mesh))
    factor = stage("factorise", lambda: stages.factor(scene, model))
    space = stage("Krylov space", lambda: krylov_space(scene, mesh, model, factor))
    modes = stage("modes", lambda: stages.modes(scene, model, space))
    if scene.written_out.strike is not None:
        contact = stages.contact(scene, mesh, model)
        stage("reduce", lambda: reduction(scene, model, contact, modes, factor, space))
    if which("ccx") and model.K.shape[0] < 1e5:  # beyond it minutes with its default solver
        with TemporaryDirectory() as folder:
            deck = input_deck(model, mesh.materials, n_modes=N_CALCULIX)
            Path(folder, "deck.inp").write_text(deck, encoding="utf-8", newline="\n")
            peer = cost_of_command(["ccx", "deck"], Path(folder))
        if peer is not None:
            costs[CALCULIX] = peer
    elastic = modes.omega[modes.omega > RIGID * modes.omega.max()]
    return SizedMesh(times, modes.n_dofs, elastic[:6] / (2 * np.pi), costs, len(modes.omega))
