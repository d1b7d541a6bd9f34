"""Random scenes beside scipy's DOP853: every contact law, dissipation, wall and leaf spring."""

from itertools import product

import numpy as np
import pytest

from beadwave import dem
from beadwave.dem.spheres import time_scale
from beadwave.workflows.evidence.harness import Comparison, compared

from formulas import motion
from random_scenes import DAMPED, LAWS, WALLS, scene

SOURCE = "the equations of motion in numpy by DOP853 of scipy"


def comparison(law: str, dissipation: str, wall_kind: str, *, springs: bool) -> Comparison:
    """Velocities of the random scene of this law, dissipation and wall."""
    seed = (LAWS.index(law) * len(DAMPED) + [*DAMPED].index(dissipation)) * len(WALLS)
    rng = np.random.default_rng(seed + WALLS.index(wall_kind))
    chain, wall, v0 = scene(rng, law, dissipation, wall_kind, springs=springs)
    speed = float(np.abs(v0).max())
    duration = 3.0 * v0.size * float(time_scale(chain.mass.max(), chain.A.min(), speed))
    run = dem.march_to_error(chain, wall, v0, duration=duration, error=1e-7, n_save=50)
    theirs = motion(chain, wall, v0, run.trajectory.t)
    leaf_springs = ", leaf springs" if springs else ""
    name = f"{law}, {dissipation} damping{leaf_springs}, {wall_kind} wall: velocities [V]"
    return compared(name, run.trajectory.v, theirs.v, allowed=1e-6, of=speed, source=SOURCE)


@pytest.mark.parametrize("law", [pytest.param("thornton", marks=pytest.mark.slow), "hertz"])
@pytest.mark.parametrize("dissipation", DAMPED)
def test_marches_follow_the_formulas_by_another_integrator(law, dissipation):
    """Each law with each damping, walls in turn, some with springs."""
    turn = (LAWS.index(law) + 2 * [*DAMPED].index(dissipation)) % 5
    row = comparison(law, dissipation, WALLS[turn], springs=turn % 2 == 0)
    assert row.difference <= row.allowed, row


@pytest.mark.slow
def test_velocities_that_still_converge_are_not_taken_for_amplified_rounding():
    """Linear dampers let forces jump: the ledger closes to rounding long before velocities do."""
    row = comparison("thornton", "linear", "free", springs=False)
    assert row.difference <= row.allowed, row


@pytest.mark.minutes
@pytest.mark.parametrize(("law", "dissipation", "springs"), [*product(LAWS, DAMPED, (False, True))])
def test_the_wall_that_differs_most_follows_the_formulas(law, dissipation, springs, check):
    walls = WALLS if law == "hertz" else WALLS[:-1]  # a dashpot takes no plastic contacts
    rows = (comparison(law, dissipation, wall, springs=springs) for wall in walls)
    check(max(rows, key=lambda row: np.nan_to_num(row.difference, nan=np.inf)))
