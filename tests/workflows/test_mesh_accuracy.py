"""Frequencies against the element size: the limit and the order where three meshes tell them."""

import re

import numpy as np
import pytest

from beadwave.workflows.evidence.accuracy import mesh as study
from beadwave.workflows.evidence.accuracy.mesh import extrapolated
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.progress import quiet

H = 8e-3 / np.sqrt(2) ** np.arange(5)


@pytest.mark.parametrize("order", [1.2, 2.0, 3.9])
@pytest.mark.parametrize("h", [H, H[::2]], ids=["five meshes", "three of twice the size"])
def test_the_limit_and_the_order_of_a_power_law_are_found(h, order):
    """Rounding of 50 Hz over the last difference, 1e-5 of it: 1e-9 in the order."""
    f0, c = np.array([50.0, 900.0]), np.array([2e3, 5e4])
    limit, p = extrapolated(h, f0 + c * h[:, None] ** order)
    np.testing.assert_allclose(limit, f0, rtol=1e-9)
    np.testing.assert_allclose(p, order, rtol=1e-6)


@pytest.mark.parametrize("order", [0.3, 6.0])
def test_an_order_that_no_mode_has_tells_no_limit(order):
    f = 50.0 + 2e3 * H[:, None] ** order
    limit, p = extrapolated(H, f)
    assert np.isnan(p).all() and limit == f[-1]


def test_neither_do_values_that_turn_or_stand_still():
    f = np.array([[51.0, 50.0], [0.0, 50.0], [50.0, 50.0], [0.0, 50.0], [50.5, 50.0]])
    limit, p = extrapolated(H, f)
    assert np.isnan(p).all() and np.array_equal(limit, [50.5, 50.0])


def test_a_mesh_that_stands_for_the_limit_has_no_error_of_its_own():
    limit = np.array([50.0, 100.0])
    np.testing.assert_allclose(study.off(np.array([50.5, 100.0]), limit), [0.01, np.nan])
    solution = study.MeshSolution("box", 1.0, 30, limit[::-1] * 2, (1.0, 1.0, 1.0), 0.5)
    assert study.row_of(solution, limit).error == pytest.approx(3.0)
    assert study.row_of(solution._replace(hz=limit), limit).error is None


@pytest.mark.slow
def test_finer_meshes_are_softer_and_the_study_says_by_how_much(monkeypatch):
    """A finer mesh contains the coarser's motions but for the layout of its elements: 0.3 %, since
    rows along the clamp lines come in whole numbers."""
    monkeypatch.setattr(study, "N_MODES", {"full-tie": 18})
    monkeypatch.setattr(study, "BLOCK", 60e-3)
    seeds = (24e-3, 17e-3, 12e-3, 8.5e-3, 6e-3)
    finding = study.of_rig(scene("rig-rom", ()), quiet, seeds, ("full-tie",))
    # nan of a finest mesh that stands for the limit
    errors = np.array([row.error for row in finding.tables[0].rows], dtype=float)
    assert [row.parameter for row in finding.tables[0].rows] == list(seeds)
    assert not np.any(np.diff(errors) > 3e-3) and errors[0] > 2 * errors[-2]
    assert (
        finding.sentences[0].startswith("full-tie: the four frequencies converge to 5")
        and finding.pictures[0].png
    )
    assert any(
        "the block's elements stay at 60 mm and leave modes" in words for words in finding.sentences
    )


@pytest.mark.slow
def test_what_the_block_leaves_is_no_less_than_halving_its_elements_shows():
    """Of an error c h^p with p above 1, halving shows 1 - 2^-p of it, and more is stated."""
    rig = scene("rig-full-tie", ())
    coarse, usual, fine = (
        study.rig_solution(rig, "full-tie", 24e-3, block, quiet).hz
        for block in (40e-3, 20e-3, 10e-3)
    )
    stated = study.error_of_the_block(usual, coarse)
    assert (stated >= (usual / fine - 1)[1:]).all()


@pytest.mark.slow
def test_bodies_of_a_scene_are_meshed_finer_and_finer_and_fall_towards_their_limit():
    """A cantilever's first four modes over mesh.scale; each coarser mesh is stiffer."""
    cantilever = scene("cantilever", ("mesh.scale=2",))
    finding = study.mesh(cantilever, quiet)
    _, table = finding.tables
    scale, dofs, hz = (np.array([row[i] for row in table.rows]) for i in (1, 2, slice(3, 7)))
    np.testing.assert_allclose(scale, [8, 5.66, 4, 2.82, 2])
    assert np.all(np.diff(dofs) > 0)
    assert np.all(np.diff(hz, axis=0) < 0)
    assert "cantilever: the frequencies converge to" in finding.sentences[0]


def test_meshes_that_hardly_differ_leave_the_error_to_the_energy_that_the_finest_misses(
    monkeypatch,
):
    monkeypatch.setattr(study, "SCALES", (1.01, 1.007, 1.005, 1.003, 1.0))
    finding = study.mesh(scene("cantilever", ("mesh.scale=4",)), quiet)
    assert finding.sentences[0].startswith("cantilever: these meshes do not determine")
    assert "By the strain energy that the finest mesh misses" in finding.sentences[1]
    assert "-" not in finding.sentences[1].rpartition("by up to")[2]


def test_the_energy_missed_is_that_of_the_modes_compared_of_a_body_that_floats():
    """A floating box of few elements, whose lowest six modes are rigid: no error is of these."""
    box = {
        "name": "box", "bodies": {"box": {"box": [0.1, 0.02, 0.06]}}, "mesh": {"scale": 3.0},
        "assembly": {"held": [], "material": "steel"},
        "materials": {"steel": {"young": 210e9, "poisson": 0.3, "density": 7850.0}},
        "strike": {"on": "box:+y", "radius": 2e-3}, "wall": {"kind": "rom"},
        "chain": {"count": 3, "radius": 5e-3, "density": 7800.0, "young": 210e9, "poisson": 0.3},
        "striker": {"velocity": 0.2}, "damping": {"kind": "none"}, "time": {"duration": 1e-4},
    }  # fmt: skip
    finding = study.mesh(scene(box), quiet)
    stated = finding.sentences[1].rpartition("by up to ")[2]
    percent = [float(x) for x in re.findall(r"\d+\.\d+", stated)]
    assert len(percent) == 4 and 0.1 < min(percent) and max(percent) < 10
