"""Chains of spheres and what they lean on: contact laws, integrators, energy, waves. SI units.

    row_of_spheres   Chain from radius [m], density [kg/m^3], young [Pa], poisson; `preload` [N],
                     `leaf_stiffness` [N/m], `gamma` and `dissipation` of the contacts
    rigid_wall, one_dof_wall, dashpot_wall, plate_wall    walls;  a Wall is n modes and a spring
    march_to_error   the run to a velocity error;  march: at a step dt [s]
    stability_limit  the longest step [s];  equilibrium: the state of rest under preload
    dem.waves        arrivals, tracks and names of solitary waves

Velocities and forces are positive towards the wall; sphere 1 is the striker. A Wall has omega (n,)
[rad/s], zeta (n,), phi (n,) [kg^-1/2] and residual_compliance [m/N], a massless spring in series
with the contact; `coupling.reduced_wall.wall_of` makes one of a reduced model.

>>> import numpy as np
>>> chain = row_of_spheres(0.0127, 7800.0, 210e9, 0.3, count=5)
>>> v0 = np.array([0.3, 0.0, 0.0, 0.0, 0.0])  # m/s
>>> result = march_to_error(chain, rigid_wall(), v0, duration=5e-4, error=1e-4)
>>> f"{result.trajectory.contact_force.max():.0f} N"
'732 N'
"""

from beadwave.dem.batch import Batch, march_batch
from beadwave.dem.chain import RIGID, Chain, Flat, State, row_of_spheres
from beadwave.dem.chains import Chains
from beadwave.dem.checks import InvalidChain
from beadwave.dem.elastic import ElasticLaw, force_table
from beadwave.dem.schemes import SCHEMES, Scheme
from beadwave.dem.stability import UnstableStep, stability_limit
from beadwave.dem.statics import Equilibrium, NoEquilibrium, equilibrium
from beadwave.dem.step_control import (
    ControlledMarch,
    StepReport,
    StepSearch,
    march_to_error,
    with_step_error,
)
from beadwave.dem.trajectory import ArrayErrors, Trajectory, march, require_march
from beadwave.dem.validity import Strain, outside, strain, yielding
from beadwave.dem.walls import Wall, dashpot_wall, one_dof_wall, plate_wall, rigid_wall

__all__ = [
    "RIGID",
    "SCHEMES",
    "ArrayErrors",
    "Batch",
    "Chain",
    "Chains",
    "ControlledMarch",
    "ElasticLaw",
    "Equilibrium",
    "Flat",
    "InvalidChain",
    "NoEquilibrium",
    "Scheme",
    "State",
    "StepReport",
    "StepSearch",
    "Strain",
    "Trajectory",
    "UnstableStep",
    "Wall",
    "dashpot_wall",
    "equilibrium",
    "force_table",
    "march",
    "march_batch",
    "march_to_error",
    "one_dof_wall",
    "outside",
    "plate_wall",
    "require_march",
    "rigid_wall",
    "row_of_spheres",
    "stability_limit",
    "strain",
    "with_step_error",
    "yielding",
]
