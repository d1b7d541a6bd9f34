"""A sphere on a wall of random modes in three directions."""

import numpy as np

from beadwave import dem
from beadwave.coupling.spatial_wall import spatial_wall_of_modes
from beadwave.dem.friction import tangential_law
from beadwave.dem.lateral import LastSphere

R, E, NU, RHO, MU = 0.0127, 210e9, 0.3, 7800.0, 0.2
STEEL = dem.Flat(E, NU)


def row(count=1, **fields):
    return dem.row_of_spheres(R, RHO, E, NU, count=count, flat=STEEL, **fields)


def last(chain, velocity=(0.0, 0.0), **arm):
    law = tangential_law(MU, R, E, NU, np.inf, E, NU)
    mass = 4 / 3 * np.pi * R**3 * RHO
    return LastSphere(law, 0.4 * mass * R**2, np.array(velocity, float), **arm)


def random_wall(seed, n_modes=4, **columns):
    """Modes of 200 Hz to 6 kHz whose shapes point anywhere, of 0.3 to 3 kg at the contact."""
    rng = np.random.default_rng(seed)
    omega = 2 * np.pi * np.exp(rng.uniform(np.log(200), np.log(6000), n_modes))
    phi = rng.normal(size=(n_modes, 3)) / np.sqrt(rng.uniform(1, 10, n_modes))[:, None]
    return spatial_wall_of_modes(omega, rng.uniform(0.0, 0.05, n_modes), phi, **columns)
