"""One wall coupled in two ways: one functional for force and reading, or the thesis' two.

Ours loads and reads a patch. The thesis pushes at the contact node and reads two others' mean: the
wall receives other work than the sphere delivers, and the energy of the run tells. Shared by
`damping.py` and `energy.py`.
"""

from typing import NamedTuple

import numpy as np

from beadwave import coupling, dem, fem, rom
from beadwave.coupling.coupled_march import EnergyGain
from beadwave.coupling.reduced_wall import coupled_wall, wall_from_reduced
from beadwave.workflows.stages.chain.chain import chain, initial_velocity

ROUNDING = 1e-9  # of the striker's energy: what is smaller is the march's own error
FACE = "block:strike"  # struck, as the mesh names it
N_MODES = 40
N_SAVE = 2000  # instants of a record
ERROR = 1e-6  # of the velocities, and of a step of the coupled march
HORIZON = 2e-3  # [s] for which that error holds; spheres move chaotically later


class StruckBody(NamedTuple):
    """A body to be struck."""

    model: fem.Model
    steel: fem.Material
    point: tuple[float, float]  # y, z [m] from the middle of its face
    radius: float  # [m] of the patch, and of the recovery points' distance


class EnergyRun(NamedTuple):
    """A coupled run by its energy: the ledger over the striker's, with and without the wall."""

    name: str
    trajectory: dem.Trajectory
    gain: EnergyGain

    @property
    def milliseconds(self):
        """Times of the record, (k,) [ms]."""
        return 1e3 * self.trajectory.t

    @property
    def total(self):
        """The whole ledger over the striker's energy, (k,), 1 at the start."""
        return 1 + self.change(self.trajectory.energy_total)

    @property
    def without_wall(self):
        """The ledger without the wall's part over the striker's energy, (k,), 1 at the start."""
        run = self.trajectory
        wall = run.energy_wall + run.energy_residual + run.dissipated_wall
        return 1 + self.change(run.energy_total - wall)

    def change(self, energy):
        """Change of a part of the ledger since the start over the striker's energy, (k,)."""
        return (energy - energy[0]) / self.trajectory.energy_kinetic[0]


def one_functional(body, n_modes=N_MODES):
    """The wall that is loaded and read over a patch: free modes and a residual, the half-space
    taken out, which Hertz' law holds already."""
    model = body.model
    patch = fem.contact_patch(model, FACE, body.point, body.radius)
    local = fem.half_space_on_mesh(model, FACE, patch, body.steel)
    selection = rom.Selection(n_modes=n_modes)
    reduced = rom.free_modes(model.K, model.M, patch.w, selection, factorise=fem.factorised)
    return wall_from_reduced(reduced, half_space=local)


def of_the_thesis(body, n_modes=N_MODES, recovery=None):
    """Force at the contact node, reading at two others, a radius to either side unless `recovery`
    says where; the reduced matrices taken whole."""
    model, (y, z) = body.model, body.point
    spots = recovery or ((y - body.radius, z), (y + body.radius, z))
    force = fem.node_patch(model, FACE, [body.point]).w
    reading = fem.node_patch(model, FACE, spots).w
    boundary, selection = np.flatnonzero(force + reading), rom.Selection(n_modes=n_modes)
    reduced = rom.craig_bampton(
        model.K, model.M, force, boundary, selection, factorise=fem.factorised
    )
    reduced = reduced._replace(contact=rom.Contact(weights_read=reading @ reduced.T))
    return coupled_wall(reduced, half_space=0.0, damping=None, cutoff_hz=np.inf)


def energy_run(rig, name, wall, duration, error=ERROR):
    """The scene's chain against a wall for duration [s]."""
    # over many impacts spheres move chaotically: no step holds an error of velocities for long
    horizon = {"horizon": min(duration, HORIZON)} if isinstance(wall, dem.Wall) else {}
    run = coupling.impact(
        chain(rig), wall, initial_velocity(rig), duration=duration, error=error, n_save=N_SAVE,
        **horizon,
    )  # fmt: skip
    return EnergyRun(name, run.trajectory, run.energy_gain)
