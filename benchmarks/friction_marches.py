"""The two marches of a last sphere with friction on a structure, beside each other.

`coupling.spatial_march` is of one chain: in one direction across it the row of springs is exact,
and periodic states under shakers are found by harmonic balance. `dem.space` is of several chains:
the springs are in cells in two directions, the line of two spheres turns with the last one, and
periodic states are fixed points of the period map. Both march the same scenes to the same error.

You will see, for each scene, the seconds of both (of the processor, after a march that compiles),
their largest difference in velocity over the largest speed, and what both state; under a shaker
with the search for the periodic state.

Run it: python benchmarks/friction_marches.py        two minutes
"""

from collections.abc import Callable
from time import process_time

import numpy as np

from beadwave import dem
from beadwave.coupling.shaken_march import march_shaken
from beadwave.coupling.shaken_packing import march_shaken_rows, shaken_state
from beadwave.coupling.spatial_march import SpatialRun, body_of, march_space
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem import space
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere
from beadwave.dem.shakers import ShakerForces
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


SHAKEN = {  # force [N] and frequency [Hz] of a shaker, spheres
    "shaken, all slips": (300.0, 1000.0, 1),
    "shaken, part slips": (100.0, 500.0, 1),
}
LOAD = np.array([[0.8], [0.5], [-0.6], [0.2]])


def compared(phi: np.ndarray, across: tuple[float, float], n: int) -> tuple[float, ...]:
    """Seconds of both marches, their difference in velocity, and the errors that they state."""
    chain = dem.row_of_spheres(R, RHO, E, NU, count=n, flat=dem.Flat(E, NU))
    law = tangential_law(MU, R, E, NU, np.inf, E, NU)
    last = LastSphere(law, 0.4 * float(chain.mass[-1]) * R**2, np.array(across))
    velocity, run = SPEED * np.eye(n)[0], {"duration": DURATION, "n_save": SAVES, "error": ERROR}
    wall = spatial_wall_of_modes(OMEGA, ZETA, phi.T)
    behind = space.Structure(OMEGA, ZETA, phi, np.zeros(3, np.int64), AXES, np.zeros((1, 2)))
    rows = space.rows_of([space.Row(chain, velocity, np.zeros(3), AXES[0], last=last)], behind)
    return timed(
        lambda: march_space(chain, wall, velocity, last, **run),
        lambda: space.march_to_error(rows.packing, behind, rows.velocity, **run),
        rows, behind, SPEED,
    )  # fmt: skip


def shaken(force: float, frequency: float, n: int) -> tuple[float, ...]:
    """Both marches of a pressed chain on a wall that a shaker moves, from the periodic state on, as
    `compared`. Where spheres meet others that move across, the two differ by up to 2e-3: lines of
    centres turn in one of them."""
    sprung = {"leaf_stiffness": np.full(n, 1e5)} if n > 1 else {}
    chain = dem.row_of_spheres(
        R, RHO, E, NU, count=n, flat=dem.Flat(E, NU), preload=20.0, **sprung
    )  # fmt: skip
    law, arm = tangential_law(0.3, R, E, NU, np.inf, E, NU), np.array([2e6, 3e6])
    last = LastSphere(law, 0.4 * float(chain.mass[-1]) * R**2, np.zeros(2), arm, 300.0)
    still, run = np.zeros(n), {"duration": DURATION, "n_save": SAVES, "error": 10 * ERROR}
    shaker = ShakerForces(np.array([force]), np.array([frequency]), np.zeros(1))
    zeta = np.maximum(ZETA, 0.02)
    wall = spatial_wall_of_modes(OMEGA, zeta, PHI.T, load=LOAD)
    body = body_of(chain, wall, still, last, shaker)
    behind = space.Structure(
        OMEGA, zeta, PHI, np.zeros(3, np.int64), AXES, np.zeros((1, 2)), load=LOAD, shakers=shaker
    )  # fmt: skip
    rows = space.rows_of([space.Row(chain, still, np.zeros(3), AXES[0], last=last)], behind)
    packing = space.before_striker(rows, [False])
    speed = shaken_state(packing, behind, error=10 * ERROR).fastest

    def in_space() -> space.SpaceTrajectory:
        before = shaken_state(packing, behind, error=10 * ERROR)
        return march_shaken_rows(rows, behind, before, **run)

    return timed(lambda: march_shaken(body, still, **run).run, in_space, rows, behind, speed)


def timed(
    of_one: Callable[[], SpatialRun], in_space: Callable[[], space.SpaceTrajectory],
    rows: space.Rows, behind: space.Structure, speed: float,
) -> tuple[float, ...]:  # fmt: skip
    """Seconds of both marches, their difference in velocity over `speed` [m/s], and the errors that
    they state."""
    seconds, runs = [], []
    for march in (of_one, in_space):
        march()  # compiles
        start = process_time()
        runs.append(march())
        seconds.append(process_time() - start)
    one, other = runs
    (row,) = space.row_runs(rows, behind, other)
    differences = row.v - one.trajectory.v, row.across.sphere_t_v - one.lateral.sphere_t_v
    largest = max(float(np.abs(change).max()) for change in differences)
    return *seconds, largest / speed, one.lateral.error_estimate, other.error_estimate


def main() -> None:
    """Print the table."""
    columns = ("scene", "one chain [s]", "in space [s]", "difference", "stated", "stated in space")
    rows = []
    scenes = [(name, compared, scene) for name, scene in SCENES.items()]
    scenes += [(name, shaken, scene) for name, scene in SHAKEN.items()]
    for name, of_both, scene in scenes:
        first, second, *errors = of_both(*scene)
        rows.append((name, f"{first:.3f}", f"{second:.3f}", *(f"{x:.1e}" for x in errors)))
    print(aligned_text(columns, rows))


if __name__ == "__main__":
    main()
