"""The same wall coupled in two ways: one functional for force and reading, or the thesis' two.

Ours loads and reads a patch. The thesis pushes at the contact node and reads two others' mean.
"""

from typing import NamedTuple

import numpy as np

import coupling
import dem
import fem
import rom
from coupling.wall import coupled_wall, wall_from_reduced
from workflows.evidence.thesis.energy_run import EnergyRun
from workflows.scene import Scene
from workflows.stages.assembly import material
from workflows.stages.chain import chain, initial_velocity
from workflows.stages.rig import STRUCK

N_MODES = 40
N_SAVE = 2000
HORIZON = 2e-3  # [s] for which the error of the velocities is held
ERROR = 1e-6  # of a step of the coupled march


class Body(NamedTuple):
    """A body to be struck."""

    model: fem.Model
    point: tuple[float, float]  # y, z [m] from the middle of its face
    radius: float  # [m] of the patch, and of the recovery points' distance


def ours(scene: Scene, body: Body, *, damping: coupling.Damping | None = None) -> dem.Wall:
    """One functional, free modes and a residual, the half-space taken out."""
    patch = fem.contact_patch(body.model, STRUCK, body.point, body.radius)
    local = fem.half_space_on_mesh(body.model, STRUCK, patch, material(scene.assembly, "block"))
    reduced = rom.free_modes(
        body.model.K,
        body.model.M,
        patch.w,
        rom.Selection(n_modes=N_MODES),
        factorise=fem.factorised,
    )
    return wall_from_reduced(reduced, half_space=local, damping=damping)


def of_the_thesis(
    body: Body,
    recovery: tuple[tuple[float, float], ...] | None = None,
    *,
    damping: coupling.Damping | None = None,
) -> coupling.CoupledWall:
    """Force at the contact node, reading at two others; the reduced matrices taken whole."""
    y, z = body.point
    spots = recovery or ((y - body.radius, z), (y + body.radius, z))
    force = fem.node_patch(body.model, STRUCK, [body.point]).w
    reading = fem.node_patch(body.model, STRUCK, spots).w
    boundary = np.flatnonzero(force + reading)
    reduced = rom.craig_bampton(
        body.model.K,
        body.model.M,
        force,
        boundary,
        rom.Selection(n_modes=N_MODES),
        factorise=fem.factorised,
    )
    reduced = reduced._replace(contact=rom.Contact(weights_read=reading @ reduced.T))
    return coupled_wall(reduced, half_space=0.0, damping=damping, cutoff_hz=np.inf)


def impact_run(
    scene: Scene, name: str, wall: dem.Wall | coupling.CoupledWall, duration: float
) -> EnergyRun:
    """The scene's chain against a wall for duration [s]."""
    # over many impacts spheres move chaotically: no step holds an error of velocities for long
    held = {"horizon": min(duration, HORIZON)} if isinstance(wall, dem.Wall) else {}
    run = coupling.impact(
        chain(scene), wall, initial_velocity(scene), duration=duration, error=ERROR,
        n_save=N_SAVE, **held,
    )  # fmt: skip
    return EnergyRun(name, run.trajectory, run.energy_gain)
