"""Benchmarks of chains, run small."""

import numpy as np
import pytest

from beadwave.workflows.evidence.accuracy.problems import problem
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.progress import quiet

import batch
import cost_of_error
import parts

SHORT = ("chain.count=6", "output.spheres=[1,4]", "time.duration=0.8e-3")


@pytest.mark.slow
def test_the_step_of_a_population_leaves_the_median_error_asked_for():
    case = problem(scene("rig-rigid", SHORT), quiet)._replace(n_save=20)
    A = case.chain.A * np.random.default_rng(5).lognormal(0.0, 0.05, (64, case.chain.A.size))
    dt, error = batch.step_of_median(case, A, 1e-4)
    assert 1e-6 < error <= 1e-4
    assert 1e-6 < dt < 3e-5


@pytest.mark.slow
def test_the_table_of_populations_says_runs_a_second(capsys):
    rows = batch.main(count=16, changes=SHORT, budget=0.05)
    assert rows[0][0] == 1 and all(row[1] * row[2] == pytest.approx(1e6) for row in rows)
    printed = capsys.readouterr().out
    assert "runs a second" in printed and "ns on one thread" in printed


@pytest.mark.slow
def test_every_part_costs_and_leaves_a_small_error(capsys):
    rows = parts.main(schemes=("suzuki4",), changes=SHORT)
    assert len(rows) == 10 and rows[0][1] == "bare" and rows[0][3] == 1.0
    assert all(milliseconds > 0 and error < 1e-4 for _, _, milliseconds, _, error in rows)
    assert "dashpot wall" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("chain, error", [("rig-rigid", 1e-5), ("light modes", 1e-4)])
def test_a_run_to_an_error_costs_little_more_than_the_longest_steps_that_keep_it(chain, error):
    case = dict(cost_of_error.problems())[chain]
    ideal = cost_of_error.ideal_evaluations(case, error)
    for samples in (101, 3001):
        true, energy, ratio, _ = cost_of_error.cost(case, error, samples, ideal)
        assert true <= error and energy <= 0.01 * error and 0.5 < ratio < 2.0
