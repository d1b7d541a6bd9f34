"""The example of stated over true errors measures what it says."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np

import dem

WHERE = spec_from_file_location(
    "step_errors", Path(__file__).parents[1] / "examples" / "step_errors.py"
)
EXAMPLE = module_from_spec(WHERE)
WHERE.loader.exec_module(EXAMPLE)


def test_random_runs_state_at_least_their_true_error():
    trials = [EXAMPLE.trial(EXAMPLE.row(np.random.default_rng([3, i]))) for i in range(4)]
    assert all(trial.ratio >= 1.0 and 1.0 < trial.cost < 4.0 for trial in trials)


def test_an_error_stated_a_hundred_times_too_small_is_noticed(monkeypatch):
    run, march_to_error = EXAMPLE.row(np.random.default_rng([3, 0])), dem.march_to_error
    honest = EXAMPLE.trial(run)

    def boasting(*scene, **options):
        result, report = march_to_error(*scene, **options)
        return result._replace(error_estimate=1e-2 * result.error_estimate), report

    monkeypatch.setattr(dem, "march_to_error", boasting)
    assert EXAMPLE.trial(run).ratio < 0.02 * honest.ratio
