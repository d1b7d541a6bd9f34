"""Seconds and memory of each stage of a reduction against the unknowns.

You will see, for meshes of one assembly from coarse to fine, the seconds and the most memory held
in each stage of `beadwave reduce`, the power p of

    cost = c unknowns^p

by least squares over logarithms, and the error of the six lowest elastic frequencies against the
finest mesh. CalculiX, where it is installed, finds ten modes of the same deck.

A factor of a solid by nested dissection has entries with the power 4/3 of the unknowns and takes
work with their square; every mode is found by solutions that read it twice, so that memory's
bandwidth bounds modes and reduction, arithmetic the factorisation. Thin parts grow more slowly.

Run it: python benchmarks/size.py [SCENE [KEY=VALUE ...]]        rig-rom by default, minutes
"""

import sys
from pathlib import Path
from shutil import which
from subprocess import DEVNULL, Popen
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

import numpy as np

from beadwave.fem.exchange.abaqus import input_deck
from beadwave.fem.modes.mac import RIGID
from beadwave.fem.modes.solver.factorisation import has_pardiso
from beadwave.system import peak_memory, reset_peak_memory
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.report.tables import Table, text
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.required_parts import with_assembly
from beadwave.workflows.stages.structure import assembly as stages
from beadwave.workflows.stages.structure.krylov_space import krylov_space
from beadwave.workflows.stages.structure.reduction import reduction

CALCULIX, N_CALCULIX = "CalculiX", 10  # modes of its deck
Cost = tuple[float, float | None]  # [s], and [bytes] at most; None where the system does not say


def main(
    name: str = "rig-rom", *changes: str, times: tuple[float, ...] = (2.83, 2.0, 1.41, 1.0)
) -> list[tuple]:
    """Print the table; `times` are factors on the scene's element sizes. Returns the table's rows,
    unknowns and a column for each mesh, the power last."""
    scene = with_assembly(load_scene(name, changes))
    dofs, hz, costs = [], [], []
    for factor in sorted(times, reverse=True):
        scaled = scene.but(mesh={"scale": factor * scene.mesh.scale})
        n, frequencies, of_stages = costed_mesh(scaled)
        dofs.append(n)
        hz.append(frequencies)
        costs.append(of_stages)

    # a row for the seconds and one for the memory of each stage, a column for each mesh
    rows = []
    for unit, i, scale in (("s", 0, 1.0), ("GB", 1, 1e-9)):
        for stage in dict.fromkeys(stage for of_stages in costs for stage in of_stages):
            values = [of_stages.get(stage, (None, None))[i] for of_stages in costs]
            values = [None if value is None else scale * value for value in values]
            rows.append((f"{stage} [{unit}]", *values, power(dofs, values)))
    errors = [float(np.abs(f / hz[-1] - 1).max()) for f in hz[:-1]]
    rows.append(("error", *errors, None, None))
    print(text(Table("size", ("unknowns", *map(str, dofs), "power"), tuple(rows))))
    print(f"\nfactorised by {'PARDISO' if has_pardiso() else 'our own Cholesky'}")
    return rows


def power(dofs: list[int], values: list[float | None]) -> float:
    """Exponent of values over unknowns; nan where the sizes are too alike to tell it."""
    known = [(n, value) for n, value in zip(dofs, values, strict=True) if value]
    if not known or known[-1][0] < 1.5 * known[0][0]:  # it would be that of the noise
        return np.nan
    return float(np.polyfit(*np.log(known).T, 1)[0])


def costed_mesh(scene: Scene) -> tuple[int, np.ndarray, dict[str, Cost]]:
    """Unknowns, the lowest elastic frequencies [Hz], at most six, and the cost of each stage."""
    costs: dict[str, Cost] = {}

    def stage(name, call):
        reset_peak_memory()
        started = perf_counter()
        result = call()
        costs[name] = perf_counter() - started, peak_memory()
        return result

    mesh = stage("mesh", lambda: stages.mesh(scene))
    model = stage("assemble", lambda: stages.model(scene, mesh))
    factor = stage("factorise", lambda: stages.factor(scene, model))
    space = stage("Krylov space", lambda: krylov_space(scene, mesh, model, factor))
    modes = stage("modes", lambda: stages.modes(scene, model, space))
    if scene.strike is not None:
        contact = stages.contact(scene, mesh, model)
        stage("reduce", lambda: reduction(scene, model, contact, modes, factor, space))
    if which("ccx") and model.K.shape[0] < 1e5:  # beyond it minutes with its default solver
        with TemporaryDirectory() as folder:
            deck = input_deck(model, mesh.materials, n_modes=N_CALCULIX)
            Path(folder, "deck.inp").write_text(deck, encoding="utf-8", newline="\n")
            cost = cost_of_command(["ccx", "deck"], Path(folder))
        if cost is not None:
            costs[CALCULIX] = cost
    elastic = modes.omega[modes.omega > RIGID * modes.omega.max()]
    return modes.n_dofs, elastic[:6] / (2 * np.pi), costs


def cost_of_command(command: list[str], folder: Path) -> Cost | None:
    """Cost of another program; None where it failed.

    Its peak is read while it runs, every 20 ms: the system's own figure of an ended process begins
    with what its parent held.
    """
    started, largest = perf_counter(), None
    with Popen(command, cwd=folder, stdout=DEVNULL, stderr=DEVNULL) as program:
        while program.poll() is None:
            largest = peak_memory(program.pid) or largest
            sleep(0.02)
    return None if program.returncode else (perf_counter() - started, largest)


if __name__ == "__main__":
    main(*sys.argv[1:])
