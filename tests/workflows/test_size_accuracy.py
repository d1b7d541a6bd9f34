"""Seconds and memory over the unknowns, stage by stage."""

from os import W_OK, access
from shutil import which
from sys import executable

import numpy as np
import pytest

from beadwave.workflows.evidence.accuracy import size as study
from beadwave.workflows.evidence.accuracy.cost import cost_of_command, costed
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report import finding
from beadwave.workflows.stages.progress import quiet

STAGES = ["mesh", "assemble", "factorise", "Krylov space", "modes", "reduce"]
MB = 1e6


@pytest.fixture(scope="module")
def sizes():
    coarse = scene("cantilever", ("reduction.modes=10",))
    return study.size(coarse, quiet, times=(1.4, 2.0, 1.0))


@pytest.mark.slow
def test_every_stage_of_every_mesh_is_measured(sizes):
    ours = [row for row in sizes.tables[0].rows if row.method != study.CALCULIX]
    dofs = sorted({row.parameter for row in ours})
    assert [row.method for row in ours] == 3 * STAGES and len(dofs) == 3
    assert all(row.seconds > 0 for row in ours)
    assert [row.parameter for row in ours] == [n for n in dofs for _ in STAGES]


@pytest.mark.slow
def test_the_error_falls_with_the_elements_and_the_finest_mesh_has_none(sizes):
    errors = sizes.tables[1].column("error")
    assert errors[0] > errors[1] > 0 and errors[2] is None


@pytest.mark.slow
def test_exponents_are_told_and_drawn(sizes):
    exponents = {row.stage: row for row in sizes.tables[2].rows}
    assert set(STAGES) <= set(exponents)
    dofs, seconds = (np.log(sizes.tables[1].column(c)) for c in ("dofs", "modes [s]"))
    slope = np.polyfit(dofs, seconds, 1)[0]
    assert abs(exponents["modes"].seconds / slope - 1) < 1e-6
    assert sizes.pictures[0].png and "growing with the power" in sizes.sentences[0]


@pytest.mark.slow
@pytest.mark.skipif(which("ccx") is None, reason="CalculiX is not installed")
def test_calculix_solves_the_same_deck(sizes):
    assert "CalculiX [s]" in sizes.tables[1].columns
    (words,) = (sentence for sentence in sizes.sentences if sentence.startswith("CalculiX takes"))
    finest = sizes.tables[1].rows[-1]
    seconds = dict(zip(sizes.tables[1].columns, finest, strict=True))
    ours = seconds["factorise [s]"] + seconds["modes [s]"]
    stated = float(words.partition("30 modes ")[2].split()[0])
    assert abs(stated / ours - 1) < 6e-3  # three digits


@pytest.mark.slow
def test_a_person_sees_a_column_for_each_mesh(sizes):
    heading, *rows = sizes.tables[1].printed
    assert heading == ("unknowns", *sizes.tables[1].column("dofs"), "power")
    assert max(map(len, finding.text(sizes).splitlines())) <= 100
    printed = {row[0]: row[1:] for row in rows}
    for column in sizes.tables[1].columns[3:]:
        assert printed[column][:-1] == sizes.tables[1].column(column)
    powers = {row.stage: row for row in sizes.tables[2].rows}
    assert printed["modes [GB]"][-1] == powers["modes"].bytes
    assert printed["error"][:-1] == sizes.tables[1].column("error")


@pytest.mark.skipif(not access("/proc/self/clear_refs", W_OK), reason="peaks are not forgotten")
def test_memory_is_that_of_the_work_alone():
    """The peak of what came before is forgotten."""
    _, much = costed(lambda: np.ones(int(400 * MB / 8)).sum())
    _, little = costed(lambda: np.ones(8).sum())
    assert much.bytes - little.bytes > 300 * MB


def test_another_program_is_measured_without_this_one(tmp_path):
    ballast = np.ones(int(400 * MB / 8))
    program = [executable, "-c", "import time; x = b'x' * 50_000_000; time.sleep(0.3)"]
    cost = cost_of_command(program, tmp_path)
    assert ballast.sum() > 0 and cost.seconds > 0.3
    assert cost.bytes is None or 50 * MB < cost.bytes < 300 * MB
    assert cost_of_command([executable, "-c", "raise SystemExit(1)"], tmp_path) is None
