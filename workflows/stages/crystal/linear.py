"""Small motions of a scene's pressed crystal: modes, waves of its perfect lattice."""

from typing import NamedTuple

import numpy as np

from beadwave.dem import space
from beadwave.dem.kernels.arguments import Array
from beadwave.dem.space.linear import Cell, CrystalModes, band_edges, cell, dispersion, modes
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.tables.crystal import PLANAR
from beadwave.workflows.stages.crystal.packing import CrystalStart, pressed_overlap

POINTS = 121  # of a branch
SIDES = 6  # columns of the packing from which a cell is taken


class Branches(NamedTuple):
    """Frequencies of the lattice's waves along its axes."""

    axes: tuple[str, ...]  # x, y, z
    wave_number: Array  # (d, POINTS) [1/m] up to the edge of the zone
    frequency: Array  # (d, POINTS, b) [Hz]


def free_directions(scene: Scene) -> Array:
    """Directions in which spheres move: those of a plane lattice in its plane."""
    planar = scene.crystal.lattice in (*PLANAR, "y")
    return np.arange(2 if planar else 3)


def lattice_cell(scene: Scene) -> tuple[Cell, Array] | None:
    """A cell of the scene's pressed perfect lattice, and its reciprocal vectors (d, 3) [1/m]; None
    where nothing presses it."""
    crystal = scene.crystal
    overlap = pressed_overlap(scene) if crystal.nodes is None else 0.0
    if not overlap:
        return None
    size = (SIDES,) * crystal.dimensions
    lattice = space.lattice(crystal.lattice, size, periodic=True)
    pairs, arm = space.touching(lattice.centre, lattice.period, 1.0 + space.CLOSE)
    diameter = 2.0 * crystal.radius
    scale = np.full(3, 1.0 - overlap / diameter)
    if crystal.sides == "free":  # columns that stand on their own
        scale[: lattice.axis] = 1.0
    packing = space.packing_of(
        diameter * scale * lattice.centre, crystal.radius, crystal.density, crystal.young,
        crystal.poisson, pairs=pairs, arm=diameter * scale * arm,
    )  # fmt: skip
    packing = packing._replace(A=packing.A * scene.contact.stiffness_factor)
    vectors, kinds = space.unit_cell(crystal.lattice)
    reciprocal = 2.0 * np.pi * np.linalg.pinv(diameter * scale * vectors).T
    of_kind = lattice.place[:, -1] % kinds
    return cell(packing, of_kind, free_directions(scene)), reciprocal


def crystal_band_edges(scene: Scene) -> tuple[float, ...] | None:
    """Edges [Hz] of the bands of the pressed lattice; None where nothing presses it."""
    found = lattice_cell(scene)
    return None if found is None else band_edges(*found)


def branches(scene: Scene) -> Branches | None:
    """Frequencies along the axes, up to the edge of the zone; None where nothing presses."""
    found = lattice_cell(scene)
    if found is None:
        return None
    of_cell, _ = found
    rows, numbers = [], []
    axes = range(len(of_cell.free))
    for axis in axes:
        # planes of spheres across the axis lie as far apart as the neighbours' nearest
        along = np.abs(of_cell.arm[:, axis])
        apart = along[along > 1e-3 * along.max()].min()
        q = np.linspace(0.0, np.pi / apart, POINTS)
        numbers.append(q)
        rows.append(dispersion(of_cell, q[:, None] * np.eye(3)[axis]))
    return Branches(tuple("xyz"[axis] for axis in axes), np.array(numbers), np.array(rows))


def crystal_modes(scene: Scene, start: CrystalStart) -> CrystalModes:
    """Modes of the crystal at rest, on what it leans on."""
    return modes(start.packing, free_directions(scene))
