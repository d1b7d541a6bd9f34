"""Energy of the coupled run against three walls, with and without the wall's share, in two schemes.

A half-space takes no energy; a large block and the assembly do. In the thesis the total shows bumps
whenever the last sphere touches the wall, higher on a finer mesh: the contact node is pushed, its
local dent holds energy, and the sphere does not see that dent since it reads other nodes. With one
functional for both the bumps are gone. Thesis, figures 2.7 and 7.1 to 7.9.
"""

from typing import NamedTuple

import numpy as np

from beadwave import coupling, dem, fem
from beadwave.dem.waves.measures import WaveEnergy, wave_energy
from beadwave.geometry.grid_lines import refined
from beadwave.geometry.lined import SAME, lined_mesh
from beadwave.geometry.lined import Lines as GridLines
from beadwave.geometry.shapes import Box
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis.observed_run import RecordOptions, round_trip
from beadwave.workflows.evidence.thesis.requirements import bare, require_chain, require_rig
from beadwave.workflows.evidence.thesis.schemes import (
    ROUNDING,
    EnergyRun,
    SchemeOptions,
    StruckBody,
    impact_run,
    of_the_thesis,
    one_functional,
)
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages import assembly as stages
from beadwave.workflows.stages.chain import initial_velocity
from beadwave.workflows.stages.progress import Progress

WAVE = 0.99366  # of the striker's energy; the rest is the recoil of the first spheres
MOVING = 5 / 9  # of the wave's energy, by the virial theorem of the Hertz chain
SHARE = "energy [% of the striker's]"


class EnergyOptions(NamedTuple):
    """The runs and the large block; not varied."""

    duration: float = 3e-3  # [s]
    side: float = 0.3  # [m] of the large block
    # of the contact seed on the large block: the thesis' two meshes differed as well
    finer: float = 0.5
    schemes: SchemeOptions = SchemeOptions()


def energy(scene: Scene, progress: Progress, options: EnergyOptions = EnergyOptions()) -> Finding:
    """Energy of coupled runs with and without the wall's (thesis, figures 2.7, 7.1 to 7.9)."""
    require_rig(scene)
    # on 8 spheres a wave takes its shape and keeps it for a while
    require_chain(scene, 8)
    duration, schemes = options.duration, options.schemes
    with progress("chain alone"):
        free, shares = chain_alone(scene)
    with progress("half-space"):
        still = impact_run(scene, "half-space", dem.rigid_wall(), duration, schemes)

    # a cube of the block's steel, held at its back, struck in the middle; and the assembly
    side, steel = options.side, stages.solid(scene, "block")
    fine = options.finer * scene.mesh.contact_seed
    lines = GridLines(*([refined(at, fine)] for at in (side / 2, 0.0, 0.0)))
    cube = lined_mesh(Box((side, side, side)), lines, side / 6)
    ends = {"strike": lambda x: x[0] > side / 2 - SAME, "-x": lambda x: x[0] < SAME - side / 2}
    structure = fem.assemble({"block": cube.with_boundaries(ends)}, {"block": steel})
    block_model = fem.joined(structure, fem.Connections(held=[fem.HeldFace("block:-x")]))
    rig_model = stages.model(scene, stages.mesh(scene))
    bodies = {
        "ROM half-space": StruckBody(block_model, (0.0, 0.0), scene.patch.radius),
        "ROM assembly": StruckBody(rig_model, scene.patch.point, scene.patch.radius),
    }
    ours, theirs, named = [], [], [(still.name, still)]  # of both bodies
    for name, body in counted(bodies.items(), progress, lambda pair: pair[0]):
        wall = one_functional(scene, body, schemes)
        ours.append(impact_run(scene, "one functional", wall, duration, schemes))
        wall = of_the_thesis(body, schemes)
        theirs.append(impact_run(scene, "thesis", wall, duration, schemes))
        named += [(f"{name}, one functional", ours[-1]), (f"{name}, thesis", theirs[-1])]

    # largest rise of the total energy, what is left of it, largest gap without the wall's part
    rows = tuple((name, run.gain.largest, run.gain.final, run.missing) for name, run in named)

    # what the thesis leaves out in a first approximation
    block, assembly = ours
    run = assembly.trajectory
    preload, leaf_springs = assembly.change(run.work_preload), assembly.change(run.energy_leaf)

    # figure 2.7: the chain alone
    share = 100 / free.energy_kinetic[0]
    lines = [
        Line(name, 1e3 * free.t, share * values)
        for name, values in (
            ("spheres, kinetic", free.energy_kinetic),
            ("contacts, elastic", free.energy_contact),
            ("total", free.energy_total),
        )
    ]
    title = "the chain alone (figure 2.7)"
    figure = [Panel(title, "time [ms]", SHARE, lines, y_limits=(-5.0, 150.0))]

    # each wall's displacement and energy, in the thesis with two figures for the latter
    figure.append(_displacements("half-space (figure 7.1)", still))
    lines = [Line("total", still.milliseconds, 100 * still.total)]
    title = "half-space, total (figure 7.2)"
    figure.append(Panel(title, "time [ms]", SHARE, lines, y_limits=(90.0, 110.0)))
    for name, one, thesis, (moved, total, without) in zip(
        bodies, ours, theirs, ("345", "786"), strict=True
    ):
        figure.append(_displacements(f"{name}, one functional (figure 7.{moved})", one))
        for title, ledger in (
            (f"{name}, total (figure 7.{total})", "total"),
            (f"{name}, wall not counted (figure 7.{without})", "without_wall"),
        ):
            lines = [
                Line(run.name, run.milliseconds, 100 * getattr(run, ledger), colour=i)
                for i, run in ((1, thesis), (0, one))
            ]
            figure.append(Panel(title, "time [ms]", SHARE, lines))

    # all walls in one, with room for the legend below the curves
    lines = [
        Line("half-space", still.milliseconds, 100 * still.total),
        Line("ROM half-space", block.milliseconds, 100 * block.total),
        Line("assembly", assembly.milliseconds, 100 * assembly.total),
        Line("assembly, wall not counted", assembly.milliseconds, 100 * assembly.without_wall),
    ]
    lowest = min(line.y.min() for line in lines) / 100
    limits = (100 * (1.8 * lowest - 0.8) - 1, 103.0)
    title = "one functional, all walls (figure 7.9)"
    figure.append(Panel(title, "time [ms]", SHARE, lines, y_limits=limits))

    # the missing energy is the wall's; what preload and leaf springs do
    t = assembly.milliseconds
    lines = [
        Line("missing without the wall", t, 100 * (1 - assembly.without_wall)),
        Line("energy of the wall", t, 100 * (assembly.total - assembly.without_wall)),
    ]
    title = "ROM assembly: the missing energy is the wall's (figure 7.9)"
    figure.append(Panel(title, "time [ms]", SHARE, lines))
    lines = [
        Line("work of the preload", t, 100 * preload),
        Line("leaf springs", t, 100 * leaf_springs),
    ]
    label = "change [% of the striker's]"
    figure.append(Panel("preload and leaf springs", "time [ms]", label, lines))

    return concluded(
        __file__,
        ("wall", "bump", "gain_at_end", "missing_without_wall"),
        rows,
        panels(figure, columns=3, size=(4.6, 3)),
        alone=shares, on_the_way=1 - WAVE * (1 - MOVING), theirs=theirs,
        seeds=[options.finer * scene.mesh.contact_seed, scene.mesh.contact_seed],
        rise=max(ROUNDING, 1.5 * max(run.gain.largest for run in ours)),
        missing=[run.missing for run in ours],
        preload=float(np.abs(preload).max()), leaf=float(np.abs(leaf_springs).max()),
    )  # fmt: skip


def chain_alone(scene: Scene) -> tuple[dem.Trajectory, WaveEnergy]:
    """The scene's spheres against a half-space of their own material, nothing that holds them."""
    row, v0 = bare(scene), initial_velocity(scene)
    duration, record = round_trip(row, np.abs(v0).max()), RecordOptions()
    run = coupling.impact(
        row, dem.rigid_wall(), v0, duration=duration, error=record.error, n_save=record.n_save
    ).trajectory
    return run, wave_energy(run, row)


def _displacements(title: str, run: EnergyRun) -> Panel:
    """Of the last sphere and of the wall, from rest."""
    motion = run.trajectory
    lines = [
        Line("last sphere", run.milliseconds, 1e6 * (motion.x[:, -1] - motion.x[0, -1])),
        Line("wall", run.milliseconds, 1e6 * (motion.wall_x - motion.wall_x[0])),
    ]
    return Panel(title, "time [ms]", "displacement [µm]", lines)
