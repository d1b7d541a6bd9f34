"""A crystal whose last row leans on a structure, from its scene to its files."""

import numpy as np
import pytest

import beadwave
from beadwave import InvalidScene

BLOCK = {
    "assembly": {"held": ["block:-z"], "material": "steel"},
    "bodies": {"block": {"box": [0.1, 0.06, 0.03], "seed": 0.02}},
    "damping": {"kind": "modal", "ratio": 0.005},
    "time": {"duration": 1.5e-4},
    "output": {"samples": 151},
}
PACKING = {
    "lattice": "hexagonal", "size": [3, 3], "radius": 6e-3, "material": "bearing-steel",
    "on": "block:+z", "striker": {"at": [1, 0], "velocity": 0.3},
}  # fmt: skip
SCENE = BLOCK | {"crystal": PACKING}


@pytest.fixture(scope="module")
def struck():
    return beadwave.impact(SCENE)


def test_the_last_row_presses_points_of_its_own(struck):
    a, summary = struck.arrays, struck.summary
    leaning = a["pairs"][:, 1] < 0
    assert a["pairs"][leaning].tolist() == [[6, -2], [7, -3], [8, -4]]
    assert a["wall_x"].shape == (151, 3) and a["wall_q"].shape[1] == summary.n_wall_modes
    np.testing.assert_allclose(a["wall_force"], a["pair_force"][:, leaning], atol=1e-12)
    # the state of the contacts and the structure at rest, then pushed into the face
    assert a["wall_force"][0].tolist() == [0.0, 0.0, 0.0] and a["wall_force"].max() > 20.0
    assert a["wall_x"].max() > 1e-9
    assert summary.crystal.peak_structure_force_N == pytest.approx(
        a["wall_force"].sum(axis=1).max()
    )
    assert summary.energy_error < 1e-6
    errors = summary.error_estimate
    assert errors.time <= 1e-4 and 0.0 < errors.reduction < 1e-3
    assert struck.data.wall_force.dims == ("time", "direction")


def test_a_single_column_is_a_chain_on_the_same_structure():
    """Meshed with and without fine elements at the contact, and reduced for one and for two
    contacts: forces within the error of the coarser mesh, some percent of the compliance."""
    column = PACKING | {"lattice": "square", "size": [1, 5], "striker": {"row": 0, "velocity": 0.3}}
    mine = beadwave.impact(BLOCK | {"crystal": column})
    spheres = {"radius": 6e-3, "material": "bearing-steel", "count": 5}
    chain = {"name": "one", "on": "block:+z", "striker": {"velocity": 0.3}, **spheres}
    theirs = beadwave.impact(BLOCK | {"chains": [chain]})
    v = mine.arrays["velocity"][:, :, 1]
    assert np.abs(v - theirs.arrays["v"]).max() < 0.01 * 0.3
    peak = theirs.arrays["contact_force"][:, -1].max()
    assert mine.summary.peak_wall_force_N == pytest.approx(peak, rel=0.01)


def test_friction_reaches_the_structure_across(struck):
    rubbing = beadwave.impact(SCENE, {"friction.coefficient": 0.3})
    a = rubbing.arrays
    assert a["wall_force"].shape == (151, 9)
    normal, across = a["wall_force"].reshape(151, 3, 3)[:, :, :2].transpose(2, 0, 1)
    assert 0.1 < np.abs(across).max() and np.all(np.abs(across) <= 0.3 * normal + 1e-9)
    assert rubbing.summary.energy_error < 1e-6
    assert a["dissipated_friction"][-1] > 0.0


def test_the_row_may_be_moved_on_its_face():
    """Mirrored places of a symmetric block: the row's two ends change roles, up to its mesh."""
    rows = BLOCK | {
        "crystal": PACKING | {
            "lattice": "square", "size": [3, 2], "striker": {"row": 0, "velocity": 0.3}
        }
    }  # fmt: skip
    left, right = (
        beadwave.impact(rows, {"crystal.at": [x, 0.0]}).arrays["wall_force"] for x in (-0.03, 0.03)
    )
    assert left[:, 0] == pytest.approx(right[:, 2], abs=0.02 * left.max())
    # at the edge the block gives way more than in its middle
    assert left[:, 0].max() < 0.999 * left[:, 2].max()


@pytest.mark.slow
def test_a_run_leaves_the_page_and_the_reduced_model(tmp_path, own_folder):
    run = beadwave.run(SCENE, out=tmp_path / "run")
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"report.html", "rom.npz", "arrivals.csv", "trajectory.npz"} <= names
    again = beadwave.scene(tmp_path / "run" / "scene.toml")
    assert again.crystal == run.scene.crystal and again.strike == run.scene.strike


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"crystal": PACKING | {"size": [10, 3]}}, "leaves it; take fewer columns"),
        ({"crystal": PACKING | {"sides": "periodic"}}, "has no end on a face"),
        ({"crystal": PACKING | {"force": 1.0}}, "starts without a load"),
        ({"crystal": PACKING | {"patch_radius": 0.01}}, "patches overlap"),
        ({"crystal": PACKING | {"on": None}}, "say where by crystal.on"),
        ({"crystal": PACKING | {"size": [400, 2]}}, "allowed on a structure are 300"),
        ({"wall": {"kind": "rigid"}}, r"\[wall\] and crystal.on"),
        ({"contact": {"law": "thornton", "yield_pressure": 1e9}}, "not marched before a structure"),
        ({"reduction": {"modes": 20}}, "reduced to one error together"),
        ({"strike": {"on": "block:+z"}}, r"\[crystal\] has `on` and `at`"),
        ({"assembly": None, "bodies": None, "damping": None}, "is a face of bodies"),
        ({"assembly": {"parts": ["block"]}, "bodies": None}, "thesis' rig"),
    ],
)  # fmt: skip
def test_what_leans_on_no_structure_is_refused_in_a_sentence(changes, words):
    tables = {name: table for name, table in (SCENE | changes).items() if table is not None}
    crystal = {key: value for key, value in tables["crystal"].items() if value is not None}
    with pytest.raises(InvalidScene, match=words):
        beadwave.impact(tables | {"crystal": crystal})
