"""Velocities read back as they were written, in any format and unit; bad files refused."""

import numpy as np
import pytest
from scipy.io import savemat

from beadwave.workflows.files.record import SYNTHETIC, Channel, Record, csv_text
from beadwave.workflows.fit.measured_record import measured, recorded
from beadwave.workflows.scene import InvalidScene

pytestmark = pytest.mark.usefixtures("files_read_here")
T = np.arange(80) * 1e-6
V = np.random.default_rng(0).normal(size=(2, 80, 3))
KNOWN = Record(T, V, (1, 4, 14), SYNTHETIC)


def same(result, *, atol=1e-9):
    np.testing.assert_allclose(result.t, T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(result.v, V, rtol=0, atol=atol)
    assert result.spheres == (1, 4, 14)


def test_csv_gives_back_repeats_and_title(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(KNOWN))
    result = measured(tmp_path / "a.csv")
    same(result, atol=1e-8)
    assert result.title == SYNTHETIC


def test_csv_units_and_the_order_of_columns_do_not_matter(tmp_path):
    head = "time [ms],sphere 14 [mm/s],sphere 1 [m/s],sphere 4 [um/s]"
    pairs = zip(T, V[0], strict=True)
    rows = [f"{1e3 * t},{1e3 * v[2]},{v[0]},{1e6 * v[1]}" for t, v in pairs]
    (tmp_path / "a.csv").write_text("\n".join([head, *rows]))
    result = measured(tmp_path / "a.csv")
    np.testing.assert_allclose(result.v[0], V[0], rtol=1e-12)


def test_mat_gives_back_repeats(tmp_path):
    fixed = {"t": 1e6 * T, "v": 1e3 * V.transpose(1, 2, 0), "spheres": [1, 4, 14]}
    savemat(tmp_path / "a.mat", fixed | {"time_unit": "us", "velocity_unit": "mm/s"})
    same(measured(tmp_path / "a.mat"))


def uff(path, signals, label="NONE", unit="m/s"):
    """Signals (node, v) as UFF58."""
    pyuff = pytest.importorskip("pyuff", reason="UFF58 is optional (the extra `identify`)")
    file = pyuff.UFF(str(path))
    for i, (node, v) in enumerate(signals):
        item = pyuff.prepare_58(
            binary=0, func_type=1, rsp_node=node, rsp_dir=1, data=v, x=T, id1=SYNTHETIC,
            abscissa_spacing=1, abscissa_spec_data_type=17, ordinate_spec_data_type=11,
            ordinate_axis_units_lab=unit, abscissa_axis_units_lab="s", ref_node=0, ref_dir=0,
            orddenom_spec_data_type=0,
        )  # fmt: skip
        file.write_sets(item | {"ordinate_axis_lab": label}, mode="add" if i else "overwrite")


def test_uff_gives_back_repeats(tmp_path):
    spheres = tuple(enumerate((1, 4, 14)))
    uff(tmp_path / "a.uff", [(n, V[r, :, i]) for r in range(2) for i, n in spheres])
    same(measured(tmp_path / "a.uff"), atol=1e-5 * np.abs(V).max())


@pytest.mark.parametrize(
    ("label", "unit", "quantity", "in_volts", "scale"),
    [("Force", "mN", "force", False, 1e-3), ("NONE", "N", "force", False, 1.0),
     ("force-rate", "mV", "force-rate", True, 1e-3), ("NONE", "mV", "velocity", True, 1e-3)],
)  # fmt: skip
def test_a_universal_file_of_any_sensor_says_what_it_measures(
    label, unit, quantity, in_volts, scale, tmp_path
):
    path = tmp_path / "a.uff"
    uff(path, [(9, V[r, :, 0]) for r in range(2)], label, unit)
    result = measured(path)
    assert result.channels == (Channel(9, quantity, in_volts),)
    np.testing.assert_allclose(result.v[:, :, 0], scale * V[:, :, 0], rtol=1e-4, atol=1e-5 * scale)
    assert recorded(path).channels == result.channels and recorded(path).repeats == 2


def test_a_universal_file_of_velocities_is_no_signals_and_one_without_a_unit_is_refused(tmp_path):
    path = tmp_path / "a.uff"
    uff(path, [(1, V[0, :, 0])])
    assert measured(path).channels is None and measured(path).spheres == (1,)
    uff(path, [(1, V[0, :, 0])], unit="NONE")
    with pytest.raises(InvalidScene, match=r"'sphere 1 \[\]', allowed is .* with its unit"):
        measured(path)


def csv(rows=80, head="time [s],sphere 1 [m/s],sphere 4 [m/s]", change=None):
    lines = [f"{i * 1e-6:.7g},{0.1 * i},{0.2 * i}" for i in range(rows)]
    if change:
        change(lines)
    return "\n".join([head, *lines])


def put(i, line):
    def change(lines):
        lines[i] = line

    return change


def drop(lines):
    del lines[30:40]


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.txt", "", "must end in"),
        ("none.csv", None, "does not exist"),
        ("empty.csv", "", "no samples"),
        (
            "unit.csv",
            csv(head="time [s],sphere 1 [km/h],sphere 4 [m/s]"),
            "the unit of sphere 1's velocity is 'km/h', allowed are m/s, mm/s, V, mV",
        ),
        ("nounit.csv", csv(head="time,sphere 1 [m/s],sphere 4 [m/s]"), "the first column"),
        ("column.csv", csv(head="time [s],laser [m/s],sphere 4 [m/s]"), "a column is 'laser"),
        ("twice.csv", csv(head="time [s],sphere 1 [m/s],sphere 1 [m/s]"), None),
        ("short.csv", csv(rows=20), "20 samples are too few"),
        (
            "nan.csv",
            csv(change=put(7, "7e-6,nan,1")),
            "line 9 has no number in the column .sphere 1",
        ),
        (
            "hole.csv",
            csv(change=put(7, "7e-6,1,")),
            "line 9 has no number in the column .sphere 4",
        ),
        (
            "word.csv",
            csv(change=put(7, "7e-6,1,x")),
            "line 9 is not numbers with decimal points: .7e-6,1,x",
        ),
        ("cells.csv", csv(change=put(7, "7e-6,1")), "line 9 has 2 cells"),
        ("gap.csv", csv(change=drop), "a gap of 11 steps follows sample 30"),
        ("back.csv", csv(change=put(7, "3e-6,1,1")), "time does not grow at sample 8"),
        ("uneven.csv", csv(change=put(7, "7.4e-6,1,1")), "times are not evenly spaced"),
        ("bad.uff", "    -1\n    58\n    -1\n", "no UFF file"),
        ("bad.mat", "no matlab", "no .mat file"),
    ],
)
def test_files_that_cannot_be_used_are_refused_in_a_sentence(tmp_path, name, text, sentence):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    if sentence is None:
        assert measured(path).v.shape == (2, 80, 1)
        return
    with pytest.raises(InvalidScene, match=sentence) as refused:
        measured(path)
    assert "\n" not in str(refused.value)


def test_text_in_another_encoding_is_refused_in_a_sentence(tmp_path):
    path = tmp_path / "latin.csv"
    path.write_bytes(("# Stoß\n" + csv()).encode("latin-1"))
    with pytest.raises(InvalidScene, match="no text in UTF-8"):
        measured(path)


def test_a_mat_file_that_does_not_state_its_units_is_refused(tmp_path):
    savemat(tmp_path / "a.mat", {"t": T, "v": V[0], "spheres": [1, 4, 14]})
    with pytest.raises(InvalidScene, match="no variable time_unit"):
        measured(tmp_path / "a.mat")


@pytest.mark.parametrize("mark", [";", "\t"])
def test_columns_may_be_separated_otherwise(tmp_path, mark):
    (tmp_path / "a.csv").write_text(csv_text(KNOWN).replace(",", mark))
    same(measured(tmp_path / "a.csv"), atol=1e-8)


def test_decimal_commas_are_refused(tmp_path):
    (tmp_path / "a.csv").write_text(csv_text(KNOWN).replace(",", ";").replace(".", ","))
    with pytest.raises(InvalidScene, match="line 3 is not numbers with decimal points"):
        measured(tmp_path / "a.csv")


HELD = {"t": T, "v": V[0], "spheres": [1, 4, 14], "time_unit": "s", "velocity_unit": "m/s"}


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"v": V[0] * (1 + 1j)}, "v is no array of real numbers"),
        ({"v": {"laser": V[0]}}, "v is no array of real numbers"),
        ({"v": np.array([V[0], "x"], object)}, "v is no array of real numbers"),
        ({"v": V[0].T}, "v is .3, 80., 80 times of 3 spheres"),
        ({"v": np.zeros((80, 3, 2, 2))}, "v is .80, 3, 2, 2."),
        ({"spheres": [1.5, 4, 14]}, "whole numbers are needed"),
        ({"spheres": ["a", "b", "c"]}, "spheres is no array of real"),
        ({"time_unit": ""}, "the unit of t is ''"),
    ],
)
def test_a_mat_file_of_other_things_is_refused(tmp_path, changed, sentence):
    savemat(tmp_path / "a.mat", HELD | changed)
    with pytest.raises(InvalidScene, match=sentence) as refused:
        measured(tmp_path / "a.mat")
    assert "\n" not in str(refused.value)


def test_a_mat_file_of_version_7_3_is_refused_with_what_to_do(tmp_path):
    """Its first 128 bytes are MATLAB's, version 0x0200."""
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    (tmp_path / "a.mat").write_bytes(head + b"\x89HDF\r\n\x1a\n" + bytes(400))
    with pytest.raises(InvalidScene, match="save it with -v7"):
        measured(tmp_path / "a.mat")


def test_a_mat_file_of_one_sphere_may_hold_a_row(tmp_path):
    units = {"time_unit": np.array(["s"], object)}
    savemat(tmp_path / "a.mat", HELD | units | {"v": V[0, :, 1], "spheres": [4]})
    np.testing.assert_array_equal(measured(tmp_path / "a.mat").v[0, :, 0], V[0, :, 1])


def test_a_uff_file_cut_off_or_complex_is_refused(tmp_path):
    path = tmp_path / "a.uff"
    uff(path, [(1, V[0, :, 0] * 1j)])
    with pytest.raises(InvalidScene, match="node 1 is complex"):
        measured(path)
    path.write_text(path.read_text()[:-200])
    with pytest.raises(InvalidScene, match="the file is cut off"):
        measured(path)


def test_spheres_with_different_numbers_of_repeats_are_refused(tmp_path):
    text = csv(head="time [s],sphere 1 [m/s],sphere 4 [m/s]").splitlines()
    text = [text[0] + ",sphere 1 [m/s]", *(line + ",0" for line in text[1:])]
    (tmp_path / "a.csv").write_text("\n".join(text))
    with pytest.raises(InvalidScene, match="differ in repeats"):
        measured(tmp_path / "a.csv")
