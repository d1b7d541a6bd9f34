"""A hammer-test file in, frequencies and damping out, a tuned scene at the end; data synthetic."""

import numpy as np
import pytest

from fem.hammer_files import SYNTHETIC, Responses
from workflows.files.hammer import responses, write_synthetic
from workflows.files.output_file import OutputFile
from workflows.files.scene import scene
from workflows.scene import InvalidScene
from workflows.structure.hammer import applied, hammer_test

RIG = {1: 51.0, 2: 269.0, 3: 907.0, 4: 8425.0}
LINES = np.arange(10.0, 1200.0, 0.2)


def computed(modes=((51.0, 0.01), (269.0, 0.008), (905.0, 0.006)), noise=1e-3):
    omega = 2 * np.pi * LINES
    H = np.zeros((2, len(LINES)), dtype=complex)
    for f, zeta in modes:
        w = 2 * np.pi * f
        H += np.array([[1.0], [0.7]]) * -(omega**2) / (w**2 - omega**2 + 2j * zeta * w * omega)
    rng = np.random.default_rng(0)
    H += noise * np.abs(H).mean() * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape))
    return Responses(LINES, H, SYNTHETIC)


@pytest.fixture
def csv(tmp_path):
    test, path = computed(), tmp_path / "test.csv"
    columns = [test.frequency_hz, *(part for h in test.H for part in (h.real, h.imag))]
    np.savetxt(path, np.column_stack(columns), delimiter=",", header="f,re,im,re,im")
    return path


def test_a_csv_gives_frequencies_and_damping_of_the_rig_s_modes(csv):
    report = hammer_test(csv, RIG).report
    assert list(report.targets) == [1, 2, 3]
    np.testing.assert_allclose(list(report.targets.values()), [51, 269, 905], rtol=2e-3)
    np.testing.assert_allclose(list(report.damping.values()), [0.01, 0.008, 0.006], rtol=0.1)


def test_without_targets_resonances_stand_alone_and_the_report_says_so(csv):
    report = hammer_test(csv, {}).report
    assert len(report.rows) >= 3 and not report.targets
    assert "No targets" in report.text()
    assert "No targets" not in hammer_test(csv, RIG).report.text()


def test_uff_keeps_the_responses_and_says_that_they_are_synthetic(tmp_path):
    pytest.importorskip("pyuff", reason="UFF58 is optional (the extra `identify`)")
    path, test = tmp_path / "test.uff", computed()
    write_synthetic(OutputFile(path), test)
    read = responses(path)
    np.testing.assert_allclose(read.frequency_hz, test.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(read.H, test.H, rtol=1e-5, atol=1e-6 * np.abs(test.H).max())
    assert read.title == SYNTHETIC and "SYNTHETIC" in path.read_text()


def test_measured_damping_reaches_the_scene_only_when_all_four_are_known(csv):
    report = hammer_test(csv, RIG).report
    changed, wanted = applied(scene("rig-rom"), report, "1,3")
    assert changed.damping == scene("rig-rom").damping
    assert wanted[3] == report.targets[3]
    with pytest.raises(InvalidScene, match=r"no resonance near modes \[4\]"):
        applied(scene("rig-rom"), report, "1,4")


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [
        ("a.txt", "", "must end in"),
        ("none.csv", None, "does not exist"),
        ("empty.csv", "", "no lines below the header"),
        ("words.csv", "f,re,im\na,b,c\n", "no frequency responses"),
        ("excel.csv", "f;re;im\n1,5;2,5;3\n", "semicolons between its values, commas and decimal"),
        ("two.csv", "f,re\n1,2\n2,3\n", "2 columns"),
        ("short.csv", "f,re,im\n" + "".join(f"{i},1,0\n" for i in range(9)), "at least 40"),
        ("nan.csv", "f,re,im\n" + "".join(f"{i},nan,0\n" for i in range(60)), "NaN"),
        ("flat.csv", "f,re,im\n" + "".join(f"{i},1,0\n" for i in range(60)), "no peaks"),
        ("bad.uff", "    -1\n    58\n", "no frequency responses"),
        ("bare.uff", "    -1\n    15\n    -1\n", "shapes alone .* are targets of modes and tune"),
    ],
)
def test_files_without_a_test_are_refused_in_a_sentence(tmp_path, name, text, sentence):
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(InvalidScene, match=sentence):
        hammer_test(path, RIG)
