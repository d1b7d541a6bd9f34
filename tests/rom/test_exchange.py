"""Reduced models written, read back, and read from elsewhere."""

import json

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.io import loadmat, savemat

from beadwave.rom import (
    Columns,
    Contact,
    MassProperties,
    ReducedModel,
    ReductionError,
    Surface,
    load_h5,
    load_mat,
    load_mtx,
    load_npz,
    save_full,
    save_h5,
    save_mat,
    save_npz,
    static_compliance,
    substructure,
)

FORMATS = {"npz": (save_npz, load_npz), "mat": (save_mat, load_mat), "h5": (save_h5, load_h5)}


def small_model(C=None, T=None):
    K = np.array([[3.0e8, -1e8], [-1e8, 2e8]])
    M = np.array([[2.0, 0.5], [0.5, 1.0]])
    w = np.array([0.25, 0.75])
    notes = {"patch": "1.6 mm", "weights": "hertz"}
    return ReducedModel(K, M, C, w, T, "craig-bampton", 1, notes, 1, 3e-5)


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("C", [None, np.diag([3.0, 4.0])])
@pytest.mark.parametrize("T", [None, np.arange(6.0).reshape(3, 2)])
def test_a_model_comes_back_as_it_was_written(tmp_path, ending, C, T):
    if ending == "h5":
        pytest.importorskip("h5py")
    save, load = FORMATS[ending]
    written = small_model(C, T)
    save(tmp_path / f"rom.{ending}", written)
    np.testing.assert_equal(load(tmp_path / f"rom.{ending}"), written)


KNOWN = small_model()._replace(
    contact=Contact(1 / 3 * 1e-9, np.array([0.1, -0.2]), 7e10, 0.34, (51.3, 907 / 7)),
    mass=MassProperties(0.1 + 0.2, (0.0, -0.1, 1 / 7), 3e-14, 0.93),
)
OLD = {"half_space_compliance_m_per_N": "1e-10", "reading_weights": "0.75", "mass_kg": "2.5",
       "hammer_modes_hz": "51 269.5", "centre_m": "0 0 -0.1", "patch": "1.6 mm"}  # fmt: skip


@pytest.mark.parametrize("ending", FORMATS)
def test_what_is_known_of_contact_and_mass_comes_back_to_the_last_digit(tmp_path, ending):
    if ending == "h5":
        pytest.importorskip("h5py")
    save, load = FORMATS[ending]
    save(tmp_path / f"rom.{ending}", KNOWN)
    np.testing.assert_equal(load(tmp_path / f"rom.{ending}"), KNOWN)


FUNCTIONALS = small_model()._replace(
    columns=Columns(
        np.array([[0.5, 0.0], [1 / 3, -1.0]]),
        1e-9 * np.array([[1.0, 0.0, 1e-3], [0.0, 1.2, 0.0], [1e-3, 0.0, 1.2]]),
        np.eye(3)[[2, 0, 1]],
        np.array([[0.1], [0.9]]),
        ("shaker",),
        np.array([[1.0, 0.0, 2.0], [0.0, 1.0, 1 / 7]]),
        ("left", "right end", "normal"),
    )
)


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize(
    "columns",
    [
        FUNCTIONALS.columns,
        Columns(FUNCTIONALS.columns.across),
        Columns(sense=np.ones((2, 1)), sense_names=("b",)),
    ],
)
def test_the_functionals_beside_w_come_back_as_they_were_written(tmp_path, ending, columns):
    if ending == "h5":
        pytest.importorskip("h5py")
    save, load = FORMATS[ending]
    written = FUNCTIONALS._replace(columns=columns)
    save(tmp_path / f"rom.{ending}", written)
    np.testing.assert_equal(load(tmp_path / f"rom.{ending}"), written)


@pytest.mark.parametrize("ending", FORMATS)
def test_bodies_of_the_surface_come_back_by_their_names(tmp_path, ending):
    if ending == "h5":
        pytest.importorskip("h5py")
    save, load = FORMATS[ending]
    faces, T = np.array([[0, 1, 2]]), np.zeros((9, 2), np.float32)
    surface = Surface(np.eye(3), faces, T, np.array([0, 1, 1]), ("block", "long plate"))
    save(tmp_path / f"rom.{ending}", small_model()._replace(surface=surface))
    read = load(tmp_path / f"rom.{ending}").surface
    assert read.bodies == surface.bodies
    np.testing.assert_array_equal(read.body, surface.body)


def test_w_of_three_columns_is_that_along_the_normal_and_across(tmp_path):
    W = np.array([[0.2, 1.0, 0.0], [0.8, 0.0, 0.5]])
    for name, given in {"columns": W, "rows": W.T, "sparse": sp.csc_array(W)}.items():
        savemat(tmp_path / f"{name}.mat", {"K": KNOWN.K, "M": KNOWN.M, "w": given})
        read = load_mat(tmp_path / f"{name}.mat")
        np.testing.assert_array_equal(read.w, W[:, 0])
        np.testing.assert_array_equal(read.columns.across, W[:, 1:])


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"w": np.ones((2, 2))}, r"w has shape \(2, 2\), allowed for 2 coordinates are \(2,\)"),
        ({"w": np.array([[1, np.nan, 0], [0, 1, 0]])}, "w holds what is no finite real number"),
        ({"w": np.ones((2, 3)) + 1j}, "w is complex"),
        ({"half_space_matrix_m_per_N": -np.eye(3)}, "no compliance"),
        ({"half_space_matrix_m_per_N": np.eye(2)}, r"shape \(2, 2\), allowed is \(3, 3\)"),
        ({"contact_axes": np.array([["a"]])}, "contact_axes holds what is no finite real number"),
        ({"w_load": np.ones((3, 1))}, r"w_load has shape \(3, 1\), allowed is \(2, m\)"),
        ({"w_sense": np.ones((2, 3)), "sense_names": ["a"]}, "1 names for the 3 columns"),
    ],
)
def test_functionals_that_cannot_be_any_are_refused(tmp_path, wrong, sentence):
    fields = {"K": KNOWN.K, "M": KNOWN.M, "w": FUNCTIONALS.w[:, None] + np.zeros((2, 3))}
    np.savez(tmp_path / "rom.npz", **(fields | wrong))
    with pytest.raises(ReductionError, match=sentence):
        load_npz(tmp_path / "rom.npz")


def test_names_of_functionals_that_a_file_leaves_out_are_numbers(tmp_path):
    np.savez(tmp_path / "rom.npz", K=KNOWN.K, M=KNOWN.M, w=KNOWN.w, w_sense=np.ones(2))
    assert load_npz(tmp_path / "rom.npz").columns.sense_names == ("sensor 1",)


def test_what_a_file_of_others_does_not_say_is_none(tmp_path):
    save_npz(tmp_path / "rom.npz", small_model())
    read = load_npz(tmp_path / "rom.npz")
    assert read.contact == (None,) * len(Contact._fields) and read.mass == (None,) * 4


def test_numbers_that_older_files_hold_as_text_are_read(tmp_path):
    """Weights that read the boundary stood alone there; the others are zero."""
    model = small_model()
    notes = json.dumps(OLD)
    np.savez(tmp_path / "old.npz", K=model.K, M=model.M, w=model.w, provenance=notes)
    read = load_npz(tmp_path / "old.npz")
    contact = Contact(half_space=1e-10, weights_read=np.array([0.75, 0.0]), modes_hz=(51.0, 269.5))
    np.testing.assert_equal(read.contact, contact)
    assert read.mass == MassProperties(mass=2.5, centre=(0.0, 0.0, -0.1))


@pytest.mark.parametrize("ending", FORMATS)
def test_names_and_the_way_back_to_the_surface_come_with_the_model(tmp_path, ending):
    if ending == "h5":
        pytest.importorskip("h5py")
    save, load = FORMATS[ending]
    T = np.arange(24, dtype=np.float32).reshape(12, 2)
    surface = Surface(np.arange(12.0).reshape(4, 3), np.array([[0, 1, 2, 3]]), T)
    names = ("u_x at x = 1", "amplitude of shape 1")
    save(
        tmp_path / f"rom.{ending}",
        small_model()._replace(surface=surface, coordinates=names),
    )
    read = load(tmp_path / f"rom.{ending}")
    assert read.coordinates == names
    for before, after in zip(surface, read.surface, strict=True):
        np.testing.assert_array_equal(before, after)


def test_damping_stands_beside_the_matrices_for_others_to_read(tmp_path):
    C = np.array([[2.0, 1.0], [1.0, 3.0]])
    save_mat(tmp_path / "rom.mat", small_model(), C_damping=C)
    content = loadmat(tmp_path / "rom.mat", spmatrix=False)
    np.testing.assert_array_equal(content["C_damping"], C)
    assert "K [N/m]" in content["about"][0]
    assert load_mat(tmp_path / "rom.mat").C is None


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_a_model_without_dashpots_is_written_with_zero_damping_and_read_without(tmp_path, ending):
    path = tmp_path / f"rom.{ending}"
    write, read = {"npz": (save_npz, load_npz), "mat": (save_mat, load_mat)}[ending]
    write(path, small_model())
    stored = loadmat(path, spmatrix=False) if ending == "mat" else np.load(path)
    assert stored["C"].shape == stored["K"].shape and not stored["C"].any()
    assert read(path).C is None


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_matrices_of_the_whole_come_back_sparse(tmp_path, ending):
    K, w = sp.random_array((50, 50), density=0.1, rng=1, format="csc"), np.arange(50.0)
    path = tmp_path / f"full.{ending}"
    save_full(path, {"K": K, "w": w})
    content = loadmat(path, spmatrix=False) if ending == "mat" else np.load(path)
    if ending == "npz":
        parts = [content[f"K_{part}"] for part in ("data", "indices", "indptr")]
        content = {"K": sp.csc_array(tuple(parts), shape=content["K_shape"]), "w": content["w"]}
    assert abs(content["K"] - K).max() == 0
    np.testing.assert_array_equal(np.ravel(content["w"]), w)


def test_matlab_finds_matrices_and_a_column_of_weights(tmp_path):
    save_mat(tmp_path / "rom.mat", small_model())
    content = loadmat(tmp_path / "rom.mat", spmatrix=False)
    assert {"K", "M", "w"} < set(content)
    assert content["w"].shape == (2, 1)
    assert content["kind"][0] == "craig-bampton"


def test_matrices_made_elsewhere_read_as_an_imported_model(tmp_path):
    model = small_model()
    savemat(tmp_path / "foreign.mat", {"K": model.K, "M": model.M})
    read = load_mat(tmp_path / "foreign.mat", w=[0.5, 0.5])
    assert read.kind == "imported"
    assert read.C is None
    np.testing.assert_array_equal(read.w, [0.5, 0.5])


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ({"K": np.eye(2)}, "no matrix named M"),
        ({"K": np.eye(2), "M": np.eye(2)}, "holds no w"),
        ({"K": np.eye(2), "M": np.eye(3), "w": np.ones(2)}, "M is 3 x 3"),
        ({"K": np.triu(np.ones((2, 2))), "M": np.eye(2), "w": np.ones(2)}, "not symmetric"),
        ({"K": np.eye(2), "M": np.eye(2), "w": np.ones(3)}, "w has shape"),
        ({"K": "stiff", "M": np.eye(2), "w": np.ones(2)}, "not a real matrix"),
    ],
)
def test_a_file_that_is_no_reduced_model_is_refused(tmp_path, content, sentence):
    savemat(tmp_path / "bad.mat", content)
    with pytest.raises(ReductionError, match=sentence):
        load_mat(tmp_path / "bad.mat")


@pytest.mark.parametrize("ending", FORMATS)
def test_a_broken_or_missing_file_is_refused(tmp_path, ending):
    if ending == "h5":
        pytest.importorskip("h5py")
    load = FORMATS[ending][1]
    broken = tmp_path / f"broken.{ending}"
    broken.write_bytes(b"\x00\x01 this is no model")
    with pytest.raises(ReductionError, match="cannot be read"):
        load(broken)
    with pytest.raises(FileNotFoundError):
        load(tmp_path / f"absent.{ending}")


@pytest.mark.parametrize(
    "change",
    [
        {"K": np.array([[{}]], dtype=object)},
        {"K": np.zeros((0, 0))},
        {"w": np.array(["a", "b"])},
        {"provenance": "{"},
        {"n_boundary": "many"},
        {"n_residual": np.zeros(0)},
    ],
)
def test_odd_content_is_refused_with_the_file_named(tmp_path, change):
    save_npz(tmp_path / "good.npz", small_model())
    np.savez(tmp_path / "odd.npz", **{**np.load(tmp_path / "good.npz"), **change})
    with pytest.raises(ReductionError, match=r"odd\.npz"):
        load_npz(tmp_path / "odd.npz")


def test_a_single_array_is_no_archive(tmp_path):
    np.save(tmp_path / "one.npy", np.eye(2))
    with pytest.raises(ReductionError, match="no whole zip archive"):
        load_npz(tmp_path / "one.npy")


MTX = """**
** GENERATION OF SUBSTRUCTURE
*USER ELEMENT, NODES=       3, LINEAR
** ELEMENT NODES
**      101,      102,
**      900
       1,       3
       3,       1
*MATRIX,TYPE=STIFFNESS
 2.0000000000000E+08 ,
-1.0000000000000E+08 , 3.0D+08
 0., 0., 1.5E+08
 0., 0., -1e8, 2.E8
 0., 0., 0.,
 0., 4.0e6
*MATRIX,TYPE=MASS
 1.0,
 0., 1.0
 0., 0., 1.0
 0., 0., 0., 1.0
 0., 0., 0., 0.25, 1.0
"""


def test_an_abaqus_substructure_is_read_with_its_coordinates(tmp_path):
    (tmp_path / "sub.mtx").write_text(MTX)
    made = substructure(tmp_path / "sub.mtx")
    assert made.coordinates == ((101, 1), (101, 3), (102, 1), (102, 3), (900, 1))
    assert made.K[0, 1] == made.K[1, 0] == -1e8
    assert made.M[4, 3] == 0.25
    read = load_mtx(tmp_path / "sub.mtx", {(101, 1): 0.25, (102, 1): 0.75})
    np.testing.assert_array_equal(read.w, [0.25, 0, 0.75, 0, 0])
    direct = read.w @ np.linalg.solve(made.K, read.w)
    assert static_compliance(read) / direct == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (MTX.split("*MATRIX,TYPE=MASS")[0], "no .MATRIX,TYPE=MASS"),
        (MTX.replace("0.25, 1.0", "0.25"), "fill no lower triangle"),
        ("nothing", "no .MATRIX,TYPE=STIFFNESS"),
    ],
)
def test_a_substructure_that_is_incomplete_is_refused(tmp_path, text, sentence):
    (tmp_path / "sub.mtx").write_text(text)
    with pytest.raises(ReductionError, match=sentence):
        load_mtx(tmp_path / "sub.mtx", np.ones(5))


def test_a_node_number_without_end_is_no_coordinate(tmp_path):
    (tmp_path / "sub.mtx").write_text(MTX.replace("101", "1e999"))
    assert "1e999" in (tmp_path / "sub.mtx").read_text()
    assert substructure(tmp_path / "sub.mtx").coordinates == ()


def test_a_weight_on_a_coordinate_that_is_not_there_is_refused(tmp_path):
    (tmp_path / "sub.mtx").write_text(MTX)
    with pytest.raises(ReductionError, match=r"no coordinate .* \(101, 2\)"):
        load_mtx(tmp_path / "sub.mtx", {(101, 2): 1.0})
