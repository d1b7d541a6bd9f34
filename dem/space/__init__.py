"""Spheres in space: packings, lattices, their march. SI units.

    packing_of       Packing of centres, pairs that touch and planes
    lattice, y_chain, touching    lattices and networks, and who touches whom
    at_rest          a packing pressed by steady loads between its planes
    march_to_error   the run to a velocity error;  march: at a step dt [s]
    Structure        modes that the points move with where spheres lean on them
    rows_of          chains on points of one structure, as a packing;  row_runs: of a march

>>> import numpy as np
>>> rows = lattice("hexagonal", (3, 8), periodic=True)
>>> pairs, arm = touching(rows.centre, rows.period, 1.0 + CLOSE)
>>> packing = packing_of(
...     0.012 * rows.centre, 0.006, 7800.0, 210e9, 0.3, pairs=pairs, arm=0.012 * arm
... )
>>> v0 = np.zeros((24, 3))
>>> v0[rows.place[:, 1] == 0, 1] = 0.3  # m/s, the first row along y
>>> run = march_to_error(packing, None, v0, duration=3e-4, error=1e-4)
>>> f"{run.velocity[-1, -1, 1]:.3f} m/s"
'0.296 m/s'
"""

from beadwave.dem.space.lattices import (
    CLOSE,
    Lattice,
    lattice,
    neighbours,
    touching,
    unit_cell,
    y_chain,
)
from beadwave.dem.space.march import (
    SpaceErrors,
    SpaceTrajectory,
    march,
    march_to_error,
    memory,
)
from beadwave.dem.space.packing import (
    AT_REST,
    MOVING,
    Packing,
    Plane,
    drive,
    line_guides,
    packing_of,
    plane_guides,
    validate,
)
from beadwave.dem.space.rows import (
    AcrossRun,
    Row,
    RowRun,
    Rows,
    before_striker,
    row_runs,
    rows_of,
    struck,
)
from beadwave.dem.space.statics import at_rest, resultants
from beadwave.dem.space.structure import Structure, structure_of_wall

__all__ = [
    "AT_REST",
    "CLOSE",
    "MOVING",
    "AcrossRun",
    "Lattice",
    "Packing",
    "Plane",
    "Row",
    "RowRun",
    "Rows",
    "SpaceErrors",
    "SpaceTrajectory",
    "Structure",
    "at_rest",
    "before_striker",
    "drive",
    "lattice",
    "line_guides",
    "march",
    "march_to_error",
    "memory",
    "neighbours",
    "packing_of",
    "plane_guides",
    "resultants",
    "row_runs",
    "rows_of",
    "struck",
    "structure_of_wall",
    "touching",
    "unit_cell",
    "validate",
    "y_chain",
]
