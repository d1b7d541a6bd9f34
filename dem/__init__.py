from dem.batch import Batch, Chains, march_batch
from dem.chain import (
    RIGID,
    Chain,
    Flat,
    State,
    Wall,
    dashpot_wall,
    one_dof_wall,
    plate_wall,
    rigid_wall,
    row_of_spheres,
)
from dem.checks import InvalidChain
from dem.schemes import SCHEMES, Scheme
from dem.stability import UnstableStep, stability_limit
from dem.statics import Equilibrium, NoEquilibrium, equilibrium
from dem.step_control import Controlled, Search, StepReport, march_to_error, with_step_error
from dem.trajectory import Trajectory, march, require_march
from dem.validity import Strain, outside, strain

__all__ = [
    "RIGID",
    "SCHEMES",
    "Batch",
    "Chain",
    "Chains",
    "Controlled",
    "Equilibrium",
    "Flat",
    "InvalidChain",
    "NoEquilibrium",
    "Scheme",
    "Search",
    "State",
    "StepReport",
    "Strain",
    "Trajectory",
    "UnstableStep",
    "Wall",
    "dashpot_wall",
    "equilibrium",
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
]
