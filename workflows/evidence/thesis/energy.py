"""Energy of the coupled run against three walls, with and without the wall's share, in two schemes.

A half-space takes no energy; a large block and the assembly do. In the thesis the total shows bumps
whenever the last sphere touches the wall, higher on a finer mesh: the contact node is pushed, its
local dent holds energy, and the sphere does not see that dent since it reads other nodes. With one
functional for both the bumps are gone. Thesis, figures 2.7 and 7.1 to 7.9.
"""

from typing import NamedTuple

import numpy as np

import coupling
import dem
import fem
import geometry
from dem.spheres import time_scale
from dem.waves.measures import WaveEnergy, wave_energy
from workflows.evidence.prose import rendered
from workflows.evidence.thesis.energy_run import EnergyRun
from workflows.evidence.thesis.observed_run import ERROR, N_SAVE
from workflows.evidence.thesis.requirements import bare, require_chain, require_rig
from workflows.evidence.thesis.schemes import Body, impact_run, of_the_thesis, ours
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages import assembly as stages
from workflows.stages.assembly import material
from workflows.stages.chain import initial_velocity
from workflows.stages.pipeline import Progress

DURATION = 3e-3  # [s]
SIDE = 0.3  # [m] of the large block
SHORTEST = 8  # spheres on which a wave takes its shape and keeps it for a while
ROUNDING = 1e-9  # of the striker's energy: below, the march's own error
WAVE = 0.99366  # of the striker's energy; the rest is the recoil of the first spheres
MOVING = 5 / 9  # of the wave's energy, by the virial theorem of the Hertz chain
FINER = 0.5  # of the contact seed on the large block: the thesis' two meshes differed as well


class Wall(NamedTuple):
    """A wall in both schemes."""

    name: str
    one_functional: EnergyRun
    thesis: EnergyRun


def energy(scene: Scene, progress: Progress) -> Finding:
    """Energy of coupled runs with and without the wall's (thesis, figures 2.7, 7.1 to 7.9)."""
    require_rig(scene)
    require_chain(scene, SHORTEST)
    with progress("chain alone"):
        alone, shares = chain_alone(scene)
    with progress("half-space"):
        still = impact_run(scene, "half-space", dem.rigid_wall(), DURATION)
    walls = []
    for name, body in (("ROM half-space", large_block(scene)), ("ROM assembly", _assembly(scene))):
        with progress(name):
            mine = impact_run(scene, "one functional", ours(scene, body), DURATION)
            walls.append(
                Wall(name, mine, impact_run(scene, "thesis", of_the_thesis(body), DURATION))
            )
    rows = ((still.name, *_measures(still)), *(row for wall in walls for row in _rows(wall)))
    columns = ("wall", "bump", "gain_at_end", "missing_without_wall")
    picture = Picture("study_energy", _picture(alone, still, *walls))
    sentences = rendered(
        __file__, alone=shares, on_the_way=1 - WAVE * (1 - MOVING), walls=walls,
        seeds=[FINER * scene.mesh.contact_seed, scene.mesh.contact_seed],
        rise=max(ROUNDING, 1.5 * max(wall.one_functional.gain.largest for wall in walls)),
        missing=[wall.one_functional.missing for wall in walls],
        held=_held_energy(walls[-1].one_functional),
    )  # fmt: skip
    return Finding((Table("energy", columns, rows),), sentences, (picture,))


def chain_alone(scene: Scene) -> tuple[dem.Trajectory, WaveEnergy]:
    """The scene's spheres against a half-space of their own material, nothing that holds them."""
    row, v0 = bare(scene), initial_velocity(scene)
    unit = time_scale(row.mass[0], row.A[0], np.abs(v0).max())
    run = coupling.impact(
        row, dem.rigid_wall(), v0, duration=2.8 * len(v0) * unit, error=ERROR, n_save=N_SAVE
    ).trajectory
    return run, wave_energy(run, row)


def large_block(scene: Scene) -> Body:
    """A cube of the block's steel, held at its back, struck in the middle."""
    cube = geometry.Assembly(block_x=SIDE, block_y=SIDE, block_z=SIDE, parts=("block",))
    mesh = geometry.hex_mesh(
        cube, seed=SIDE, block_seed=SIDE / 6, support_seed=SIDE,
        contact_seed=FINER * scene.mesh.contact_seed,
    )  # fmt: skip
    structure = fem.assemble(geometry.by_body(mesh), {"block": material(scene.assembly, "block")})
    model = fem.joined(structure, fem.Connections(held=[fem.Held("block:-x")]))
    return Body(model, (0.0, 0.0), scene.patch.radius)


def _assembly(scene: Scene) -> Body:
    model = stages.model(scene, stages.mesh(scene))
    return Body(model, scene.patch.point, scene.patch.radius)


def _measures(run: EnergyRun) -> tuple[float, float, float]:
    """Largest rise of the total energy, what is left of it, largest gap without the wall."""
    return run.gain.largest, run.gain.final, run.missing


def _rows(wall: Wall):
    yield f"{wall.name}, one functional", *_measures(wall.one_functional)
    yield f"{wall.name}, thesis", *_measures(wall.thesis)


def _held_energy(run: EnergyRun) -> dict[str, float]:
    """Largest changes of what the thesis leaves out in a first approximation."""
    held = {"preload": run.trajectory.work_preload, "leaf": run.trajectory.energy_leaf}
    return {name: run.change(energy) for name, energy in held.items()}


def _picture(alone: dem.Trajectory, still: EnergyRun, block: Wall, assembly: Wall) -> bytes:
    rows = [
        _alone(alone),
        _displacements("half-space (figure 7.1)", still),
        _energies("half-space, total (figure 7.2)", {"total": still.total}, full=True),
    ]
    for wall, (moved, total, without) in ((block, "345"), (assembly, "786")):
        rows += [
            _displacements(f"{wall.name}, one functional (figure 7.{moved})", wall.one_functional),
            _compared(f"{wall.name}, total (figure 7.{total})", wall, "total"),
            _compared(f"{wall.name}, wall not counted (figure 7.{without})", wall, "without_wall"),
        ]
    with_and_without = {
        "half-space": still.total,
        "ROM half-space": block.one_functional.total,
        "assembly": assembly.one_functional.total,
        "assembly, wall not counted": assembly.one_functional.without_wall,
    }
    rows += [
        _energies("one functional, all walls (figure 7.9)", with_and_without),
        _wall_energy(assembly.one_functional),
        _holding(assembly.one_functional),
    ]
    return panels(rows, columns=3, size=(4.6, 3))


def _alone(run: dem.Trajectory) -> Panel:
    curves = {
        "spheres, kinetic": run.energy_kinetic,
        "contacts, elastic": run.energy_contact,
        "total": run.energy_total,
    }
    share = 100 / run.energy_kinetic[0]
    lines = [Line(name, 1e3 * run.t, share * value) for name, value in curves.items()]
    title, label = "the chain alone (figure 2.7)", "energy [% of the striker's]"
    return Panel(title, "time [ms]", label, lines, y_limits=(-5.0, 150.0))


def _displacements(title: str, run: EnergyRun) -> Panel:
    motion = run.trajectory
    lines = [
        Line("last sphere", run.milliseconds, 1e6 * (motion.x[:, -1] - motion.x[0, -1])),
        Line("wall", run.milliseconds, 1e6 * (motion.wall_x - motion.wall_x[0])),
    ]
    return Panel(title, "time [ms]", "displacement [µm]", lines)


def _energies(title: str, totals: dict[str, np.ndarray], full: bool = False) -> Panel:
    t = np.linspace(0, 1e3 * DURATION, len(next(iter(totals.values()))))
    lines = [Line(name, t, 100 * total) for name, total in totals.items()]
    lowest = min(total.min() for total in totals.values())
    # room for the legend below the curves
    span = (90.0, 110.0) if full else (100 * (1.8 * lowest - 0.8) - 1, 103.0)
    return Panel(title, "time [ms]", "energy [% of the striker's]", lines, y_limits=span)


def _wall_energy(run: EnergyRun) -> Panel:
    held = run.total - run.without_wall
    lines = [
        Line("missing without the wall", run.milliseconds, 100 * (1 - run.without_wall)),
        Line("energy of the wall", run.milliseconds, 100 * held),
    ]
    title = "ROM assembly: the missing energy is the wall's (figure 7.9)"
    return Panel(title, "time [ms]", "energy [% of the striker's]", lines)


def _holding(run: EnergyRun) -> Panel:
    motion, whole = run.trajectory, run.trajectory.energy_kinetic[0]
    terms = {"work of the preload": motion.work_preload, "leaf springs": motion.energy_leaf}
    lines = [
        Line(name, run.milliseconds, 100 * (value - value[0]) / whole)
        for name, value in terms.items()
    ]
    return Panel("preload and leaf springs", "time [ms]", "change [% of the striker's]", lines)


def _compared(title: str, wall: Wall, share: str) -> Panel:
    lines = [
        Line(run.name, run.milliseconds, 100 * getattr(run, share), colour=i)
        for i, run in ((1, wall.thesis), (0, wall.one_functional))
    ]
    return Panel(title, "time [ms]", "energy [% of the striker's]", lines)
