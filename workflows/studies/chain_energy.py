"""Energy of the bare chain on its way to a half-space and back: thesis, figure 2.7.

The thesis: first all is the striker's motion, then motion and elastic contacts share it, and at the
largest penetration into the wall it is mainly elastic. On its way a solitary wave is 5/9 motion and
4/9 elastic (virial theorem of the Hertz chain).
"""

from typing import NamedTuple

import numpy as np

import coupling
import dem
from dem.spheres import time_scale
from workflows.chain_stages import initial_velocity
from workflows.scene import Scene
from workflows.studies.observed import ERROR, N_SAVE, bare
from workflows.study_figures import Line, Panel

WAVE = 0.99366  # of the striker's energy; the rest is the recoil of the first spheres
MOVING = 5 / 9  # of the wave's energy


class ChainEnergy(NamedTuple):
    """Shares of the striker's energy: on the way, and when the wall is pressed hardest."""

    trajectory: dem.Trajectory
    moving_on_the_way: float  # mean
    moving_at_the_wall: float
    last_contact: float  # elastic, at the wall


def chain_energy(scene: Scene) -> ChainEnergy:
    """The scene's spheres against a half-space of their own material, nothing that holds them."""
    row, v0 = bare(scene), initial_velocity(scene)
    unit = time_scale(row.mass[0], row.A[0], np.abs(v0).max())
    run = coupling.impact(
        row, dem.rigid_wall(), v0, duration=2.8 * len(v0) * unit, error=ERROR, n_save=N_SAVE
    ).trajectory
    force, whole = run.contact_force, run.energy_kinetic[0]
    k = int(force[:, -1].argmax())
    # from the third contact on the wave has its shape, until it comes near the wall
    way = slice(int(force[:k, 2].argmax()), int(force[:k, -4].argmax()))
    return ChainEnergy(
        run,
        float(run.energy_kinetic[way].mean() / whole),
        float(run.energy_kinetic[k] / whole),
        float(0.4 * force[k, -1] ** (5 / 3) / row.A[-1] ** (2 / 3) / whole),
    )


def sentence(found: ChainEnergy) -> str:
    """Figure 2.7 in numbers, beside what the thesis says of it."""
    elastic = 1 - found.moving_at_the_wall
    return (
        f"Figure 2.7, the chain alone: on its way the wave is {100 * found.moving_on_the_way:.1f} "
        f"% motion (reference: 5/9 of the wave and the recoil, "
        f"{100 * (1 - WAVE * (1 - MOVING)):.1f} %). The thesis says that it is mainly "
        f"elastic when the wall is pressed hardest, and not quite at rest: {100 * elastic:.0f} % "
        f"are elastic, {100 * found.last_contact:.0f} % in the last contact alone, "
        f"{100 * found.moving_at_the_wall:.0f} % still move."
    )


def panel(found: ChainEnergy) -> Panel:
    """Kinetic, elastic and total energy over time."""
    run, whole = found.trajectory, found.trajectory.energy_kinetic[0]
    curves = {
        "spheres, kinetic": run.energy_kinetic,
        "contacts, elastic": run.energy_contact,
        "total": run.energy_total,
    }
    lines = [Line(name, 1e3 * run.t, 100 * value / whole) for name, value in curves.items()]
    title, label = "the chain alone (figure 2.7)", "energy [% of the striker's]"
    return Panel(title, "time [ms]", label, lines, y_limits=(-5.0, 150.0))
