"""Seconds and memory over the unknowns, stage by stage."""

from os import W_OK, access
from shutil import which
from sys import executable

import numpy as np
import pytest

from beadwave.system import peak_memory, reset_peak_memory

import size as benchmark

STAGES = ["mesh", "assemble", "factorise", "Krylov space", "modes", "reduce"]
MB = 1e6


@pytest.fixture(scope="module")
def printed():
    """Rows of the table by their first cell."""
    rows = benchmark.main("cantilever", "reduction.modes=10", times=(1.4, 2.0, 1.0))
    return {row[0]: row[1:] for row in rows}


@pytest.mark.slow
def test_every_stage_of_every_mesh_is_measured(printed):
    assert list(printed)[:6] == [f"{stage} [s]" for stage in STAGES]
    assert all(len(printed[f"{stage} [s]"]) == 4 for stage in STAGES)
    assert all(seconds > 0 for stage in STAGES for seconds in printed[f"{stage} [s]"][:3])
    assert all(np.isfinite(printed[f"{stage} [s]"][3]) for stage in STAGES)


@pytest.mark.slow
def test_the_error_falls_with_the_elements_and_the_finest_mesh_has_none(printed):
    errors = printed["error"]
    assert errors[0] > errors[1] > 0 and errors[2] is None


@pytest.mark.slow
@pytest.mark.skipif(which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_solves_the_same_decks(printed):
    assert all(seconds > 0 for seconds in printed["CalculiX [s]"][:3])


def test_the_power_of_a_power_law_is_found():
    assert benchmark.power([10, 100, 1000], [2.0, 20.0, 200.0]) == pytest.approx(1.0)
    assert np.isnan(benchmark.power([100, 101], [1.0, 2.0]))
    assert np.isnan(benchmark.power([10, 100], [None, None]))


@pytest.mark.skipif(not access("/proc/self/clear_refs", W_OK), reason="peaks are not forgotten")
def test_memory_is_that_of_the_work_alone():
    """The peak of earlier work is forgotten."""
    peaks = []
    for n in (int(400 * MB / 8), 8):
        reset_peak_memory()
        np.ones(n).sum()
        peaks.append(peak_memory())
    assert peaks[0] - peaks[1] > 300 * MB


def test_another_program_is_measured_without_this_one(tmp_path):
    ballast = np.ones(int(400 * MB / 8))
    program = [executable, "-c", "import time; x = b'x' * 50_000_000; time.sleep(0.3)"]
    seconds, held = benchmark.cost_of_command(program, tmp_path)
    assert ballast.sum() > 0 and seconds > 0.3
    assert held is None or 50 * MB < held < 300 * MB
    assert benchmark.cost_of_command([executable, "-c", "raise SystemExit(1)"], tmp_path) is None
