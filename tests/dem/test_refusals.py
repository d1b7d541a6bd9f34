"""No NaN and no inf leaves a public function of dem: a sentence names the quantity instead."""

import numpy as np
import pytest

from beadwave import dem

SPHERES = {"radius": 0.0127, "density": 7800.0, "young": 210e9, "poisson": 0.3, "count": 3}
BAD = (np.nan, np.inf, -np.inf)
WALL = dem.one_dof_wall(900.0, 2.0)
V0 = np.array([0.3, 0.0, 0.0])
TIMES = {"duration": 1e-4, "dt": 1e-6}


def row(**fields):
    return dem.row_of_spheres(**{**SPHERES, **fields})


def batch(chain, wall, v0, **how):
    return dem.march_batch(dem.Chains(chain, wall, v0), **how)


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
    "march_batch": lambda *chains: batch(*chains, **TIMES),
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
    assert all(np.isfinite(values).all() for values in run[:15])
    batch_result = batch(row(), WALL, V0, **TIMES)
    assert all(np.isfinite(values).all() for values in batch_result[:4])


MARCH = {"n_save": 5, **TIMES}
NOT_NUMBERS = (np.nan, np.inf, 0, -1, "x", None, [1.0, 2.0])


@pytest.mark.parametrize("bad", NOT_NUMBERS)
@pytest.mark.parametrize("name", ["duration", "dt", "error", "n_save"])
def test_times_and_counts_of_no_number_are_refused(name, bad):
    """None is a choice for n_save of march and for dt and error of a batch."""
    to_error = {"duration": 1e-4, "error": 1e-3, "n_save": 5}
    for run, options in (
        (dem.march, MARCH), (dem.march_to_error, to_error), (batch, MARCH),
    ):  # fmt: skip
        if name in options and not (bad is None and name in ("n_save", "dt")):
            with pytest.raises(dem.InvalidChain, match=name):
                run(row(), WALL, V0, **{**options, name: bad})


@pytest.mark.parametrize("observed", [[3], [-4], [], [1.5], "a", 2])
def test_spheres_that_are_not_there_cannot_be_observed(observed):
    with pytest.raises(dem.InvalidChain, match="from 0 to 2"):
        dem.march_to_error(row(), WALL, V0, duration=1e-4, error=1e-3, observed=observed)
    with pytest.raises(dem.InvalidChain, match="from 0 to 2"):
        batch(row(), WALL, V0, observed=observed, **TIMES)


def test_more_saves_than_memory_holds_are_refused():
    with pytest.raises(dem.InvalidChain, match="memory"):
        dem.march(row(), WALL, V0, **{**TIMES, "n_save": 10**12})


def test_lists_words_and_states_of_unlike_chains_are_refused():
    for chain, wall in (
        ("chain", WALL), (row(), "wall"), (row()._replace(A=[1.0] * 3), WALL),
        (row(), WALL._replace(omega=[1.0])),
    ):  # fmt: skip
        with pytest.raises(dem.InvalidChain, match="give a"):
            dem.march(chain, wall, V0, **TIMES)
    two = dem.march(row(count=2), WALL, V0[:2], **TIMES).final
    with pytest.raises(dem.InvalidChain, match=r"has shape \(2,\); give 3 numbers"):
        dem.march(row(), WALL, V0, state=two, **TIMES)
    spoilt = two._replace(x=np.array([np.nan, 0.0]))
    with pytest.raises(dem.InvalidChain, match="x of the state"):
        dem.march(row(count=2), WALL, V0[:2], state=spoilt, **TIMES)


@pytest.mark.parametrize(
    "fields", [{"stiffness_factor": "x"}, {"gamma": [1.0, 2.0]}, {"foo": 1}, {"count": 0.5}]
)
def test_parts_of_a_row_are_named_in_the_refusal(fields):
    with pytest.raises(dem.InvalidChain, match=next(iter(fields))):
        row(**fields)
