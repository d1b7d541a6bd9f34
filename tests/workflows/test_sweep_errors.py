"""Every row of a sweep states the error that it has, and is refused where its run alone is."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

import beadwave
from beadwave import Cases, dem
from beadwave.workflows.stages.chain.chain import start
from beadwave.workflows.stages.chain.walls import simple_wall
from beadwave.workflows.sweep.cases import base_of

WHERE = spec_from_file_location(
    "sweep_errors", Path(__file__).parents[2] / "examples" / "sweep_errors.py"
)
TRIAL = module_from_spec(WHERE)
WHERE.loader.exec_module(TRIAL)


def true_error(scene, case, v, dt, spheres):
    """Beside a march of an eighth of the step that ends at the samples."""
    one = base_of(scene, ()).with_values(case)
    begun = start(one)
    fine = dem.march(
        begun.chain, simple_wall(one), begun.velocity,
        duration=one.time.duration, dt=dt / 8, n_save=len(v) - 1,
    )  # fmt: skip
    return np.abs(fine.v[:, spheres] - v).max() / one.striker.velocity


def test_an_outlier_of_a_table_states_its_own_error(tmp_path):
    lines = [f"{11.0 + 1e-3 * i:.4f} mm" for i in range(30)]
    lines[16] = "2.2 mm"  # not one of 16 rows spread over 30
    path = tmp_path / "cases.csv"
    path.write_text("chain.radius\n" + "\n".join(lines) + "\n")
    result = beadwave.sweep(
        "rig-rigid", cases=Cases(table=path), out=tmp_path / "out", signals=True
    )
    assert set(result.counts()) == {"done"}
    stated, v = result.columns["error_time"], result.signals()["v"].values
    assert (stated <= 1e-4).all() and len(np.unique(stated)) > 25
    for i in (0, 16, 29):
        case, dt = result.design.case(i), result.columns["dt_s"][i]
        assert true_error("rig-rigid", case, v[i], dt, [0, 3, 13]) <= stated[i]
    assert result.columns["dt_s"][16] < 0.4 * result.columns["dt_s"][17]


@pytest.mark.slow
def test_a_case_whose_run_is_refused_is_refused_in_a_sweep(tmp_path):
    over = {"striker.velocity": "0.25,9", "chain.radius": "1.9mm,13mm"}
    result = beadwave.sweep("rig-1dof", cases=over, out=tmp_path / "out")
    status, message = result.columns["status"].tolist(), result.columns["message"].tolist()
    each = [result.design.case(i) for i in range(result.design.n_cases)]
    chaotic = [
        case["striker.velocity"] == 9.0 and str(case["chain.radius"]) in ("1.9mm", "0.0019")
        for case in each
    ]
    assert sum(chaotic) == 1
    for bad, state, says in zip(chaotic, status, message, strict=True):
        assert (state != "done") == bad
        assert ("error 0.0001 is not reached" in says) == bad


@pytest.mark.slow
@pytest.mark.parametrize("i", [2, 4, 7])
def test_random_rows_state_at_least_half_of_their_error(i):
    """Of the trial's populations: an outlier, a sample and walls."""
    trial = TRIAL.population_trial(TRIAL.POPULATIONS[i], 16, np.random.default_rng([5, i]))
    assert len(trial.ratios) + trial.refused == 16 and trial.in_vain == 0
    assert trial.ratios.min() >= 0.5
