"""No NaN and no inf leaves a public function of dem: a sentence names the quantity instead."""

import numpy as np
import pytest

import dem

SPHERES = {"radius": 0.0127, "density": 7800.0, "young": 210e9, "poisson": 0.3, "count": 3}
BAD = (np.nan, np.inf, -np.inf)
WALL = dem.one_dof_wall(900.0, 2.0)
V0 = np.array([0.3, 0.0, 0.0])
TIMES = {"duration": 1e-4, "dt": 1e-6}


def row(**parts):
    return dem.row_of_spheres(**{**SPHERES, **parts})


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("name", ["radius", "density", "young", "poisson", "preload"])
def test_spheres_of_no_number_are_refused(name, bad):
    with pytest.raises(dem.InvalidChain, match=name):
        row(**{name: bad})


@pytest.mark.parametrize("bad", (*BAD, 0.0))
@pytest.mark.parametrize(
    ("wall", "named"),
    [
        (lambda bad: dem.one_dof_wall(900.0, bad), "wall mass"),
        (lambda bad: dem.one_dof_wall(bad or -1.0, 2.0), "wall frequency"),
        (lambda bad: dem.one_dof_wall(900.0, 2.0, bad or -1.0), "damping_ratio"),
        (lambda bad: dem.dashpot_wall(bad), "dashpot coefficient"),
        (lambda bad: dem.plate_wall(bad, 0.3, 7800.0, 0.01), "plate young"),
        (lambda bad: dem.plate_wall(210e9, 0.3, bad, 0.01), "plate density"),
        (lambda bad: dem.plate_wall(210e9, 0.3, 7800.0, bad), "plate thickness"),
    ],
)
def test_walls_of_no_number_are_refused(wall, named, bad):
    with pytest.raises(dem.InvalidChain, match=named):
        wall(bad)


RUNS = {
    "equilibrium": lambda chain, wall, v0: dem.equilibrium(chain, wall),
    "march": lambda chain, wall, v0: dem.march(chain, wall, v0, **TIMES),
    "march_batch": lambda chain, wall, v0: dem.march_batch(chain, wall, v0, **TIMES),
    "march_to_error": lambda chain, wall, v0: dem.march_to_error(
        chain, wall, v0, duration=1e-4, error=1e-3
    ),
    "stability_limit": dem.stability_limit,
}


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("run", RUNS)
def test_runs_refuse_what_is_no_number(run, bad):
    chain = row()
    spoilt = np.array([1.0, bad, 1.0])
    for name in ("mass", "A"):
        with pytest.raises(dem.InvalidChain, match=name):
            RUNS[run](chain._replace(**{name: getattr(chain, name) * spoilt}), WALL, V0)
    for name in ("omega", "phi", "residual_compliance", "mobility"):
        value = np.array([bad]) if name in ("omega", "phi") else bad
        with pytest.raises(dem.InvalidChain, match=name):
            RUNS[run](chain, WALL._replace(**{name: value}), V0)
    if run != "equilibrium":
        with pytest.raises(dem.InvalidChain, match=r"v0|velocity"):
            RUNS[run](chain, WALL, np.where(spoilt == 1.0, V0, spoilt))


@pytest.mark.parametrize("bad", BAD)
def test_strain_refuses_what_is_no_number(bad):
    force, v = np.zeros((2, 3)), np.zeros((2, 3))
    for arguments in ((bad, force, v), (210e9, force + bad, v), (210e9, force, v + bad)):
        with pytest.raises(dem.InvalidChain, match="not finite"):
            dem.strain(row(), *arguments)


def test_results_hold_finite_numbers_alone():
    run = dem.march(row(preload=5.0), WALL, V0, **TIMES)
    assert all(np.isfinite(part).all() for part in run[:15])
    batch = dem.march_batch(row(), WALL, V0, **TIMES)
    assert all(np.isfinite(part).all() for part in batch[:4])
