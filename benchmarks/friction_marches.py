"""The two marches of a last sphere with friction on a structure, beside each other.

`coupling.spatial_march` is of one chain: in one direction across it the row of springs is exact,
and shakers and periodic states are its own. `dem.space` is of several chains: the springs are in
cells in two directions, and the line of two spheres turns with the last one. Both march the same
scenes to the same error.

You will see, for each scene, the seconds of both (of the processor, after a march that compiles),
their largest difference in velocity over the largest speed, and what both state.

Run it: python benchmarks/friction_marches.py        a minute
"""

from time import process_time

import numpy as np

from beadwave import dem
from beadwave.coupling.spatial_march import march_space
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem import space
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere
from beadwave.workflows.report.tables import aligned_text

R, RHO, E, NU, MU = 6e-3, 7800.0, 210e9, 0.3, 0.2
SPEED, ERROR, DURATION, SAVES = 0.3, 1e-5, 3e-4, 150
OMEGA = 2 * np.pi * np.array([900.0, 2600.0, 7100.0, 19e3])
ZETA = np.array([0.01, 0.02, 0.0, 0.3])
PHI = np.array([[1.3, -0.7, 2.0, 5.0], [0.9, 1.5, -1.1, 3.0], [0.4, -0.6, 0.8, -2.0]])
AXES = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
SCENES = {  # participations, velocity across, spheres
    "one direction, oblique": (PHI * [[1.0], [1.0], [0.0]], (0.1, 0.0), 1),
    "one direction": (PHI * [[1.0], [1.0], [0.0]], (0.0, 0.0), 6),
    "two directions, oblique": (PHI, (0.1, 0.05), 1),
    "two directions": (PHI, (0.0, 0.0), 6),
}


def compared(phi: np.ndarray, across: tuple[float, float], n: int) -> tuple[float, ...]:
    """Seconds of both marches, their difference in velocity, and the errors that they state."""
    chain = dem.row_of_spheres(R, RHO, E, NU, count=n, flat=dem.Flat(E, NU))
    law = tangential_law(MU, R, E, NU, np.inf, E, NU)
    last = LastSphere(law, 0.4 * float(chain.mass[-1]) * R**2, np.array(across))
    velocity, run = SPEED * np.eye(n)[0], {"duration": DURATION, "n_save": SAVES, "error": ERROR}
    wall = spatial_wall_of_modes(OMEGA, ZETA, phi.T)
    behind = space.Structure(OMEGA, ZETA, phi, np.zeros(3, np.int64), AXES, np.zeros((1, 2)))
    rows = space.rows_of([space.Row(chain, velocity, np.zeros(3), AXES[0], last=last)], behind)

    seconds, runs = [], []
    for march in (
        lambda: march_space(chain, wall, velocity, last, **run),
        lambda: space.march_to_error(rows.packing, behind, rows.velocity, **run),
    ):
        march()  # compiles
        start = process_time()
        runs.append(march())
        seconds.append(process_time() - start)
    one, in_space = runs
    (row,) = space.row_runs(rows, behind, in_space)
    differences = row.v - one.trajectory.v, row.across.sphere_t_v - one.lateral.sphere_t_v
    largest = max(float(np.abs(change).max()) for change in differences)
    return *seconds, largest / SPEED, one.lateral.error_estimate, in_space.error_estimate


def main() -> None:
    """Print the table."""
    columns = ("scene", "one chain [s]", "in space [s]", "difference", "stated", "stated in space")
    rows = []
    for name, scene in SCENES.items():
        first, second, *errors = compared(*scene)
        rows.append((name, f"{first:.3f}", f"{second:.3f}", *(f"{x:.1e}" for x in errors)))
    print(aligned_text(columns, rows))


if __name__ == "__main__":
    main()
