"""Studies of beams and plates that one table of a scene describes."""

from contextlib import nullcontext

import numpy as np
import pytest

from beadwave.workflows.evidence import catalogue
from beadwave.workflows.evidence.thesis.axial_force import AxialForceOptions
from beadwave.workflows.evidence.thesis.bent import StructuresOptions
from beadwave.workflows.evidence.thesis.solid_beam import SolidBeamOptions
from beadwave.workflows.evidence.thesis.solid_plate import SolidPlateOptions
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene

pytestmark = pytest.mark.usefixtures("shared_cache")


TWO_LOADS = AxialForceOptions(shares=(0.0, -0.9))
THREE_SIZES = StructuresOptions(factors=np.array([0.5, 1.0, 2.0]))


def run_study(name, usual, *changes, options=None):
    """The study of a name on a built-in scene, with its usual options where none are given."""
    entry = catalogue.catalogue("thesis")[name]
    given = () if options is None else (options,)
    return entry(scene(usual, changes), lambda stage: nullcontext(), *given)


def column(finding, name):
    return np.array(finding.tables[0].column(name), float)


def test_the_first_reflected_wave_does_not_feel_the_axial_force_later_ones_do():
    study = run_study("axial-force", "slender-beam", options=TWO_LOADS)
    first, later = column(study, "first_wave"), column(study, "later")
    assert 0 < first[1] < 0.01 < 0.1 < later[1]
    assert abs(np.diff(column(study, "arr"))[0]) < 0.01 * column(study, "arr")[0]
    hz = column(study, "first_mode_hz")
    assert hz[1] / hz[0] == pytest.approx(np.sqrt(0.1), rel=1e-3)  # hinged: 1 - N / N_cr
    assert "does not feel the axial force" in study.sentences[-1]


def test_a_record_too_short_for_later_waves_is_said_to_tell_nothing():
    study = run_study("axial-force", "slender-beam", "time.duration=1e-3", options=TWO_LOADS)
    assert "the record is too short" in study.sentences[-1]


def test_thicker_beams_send_more_back_and_sooner():
    """As often as a first mode of k^2 h / sqrt(12) sqrt(E / rho) fits, thin ones exactly."""
    study = run_study("beam-thickness", "beam", "time.duration=1.2e-3", options=THREE_SIZES)
    assert np.all(np.diff(column(study, "arr")) > 0.05) and np.all(
        np.diff(column(study, "tof_us")) < 0
    )
    hz = column(study, "first_mode_hz")
    assert hz / hz[0] == pytest.approx([1, 2, 4], rel=5e-3)
    assert "amplitude ratio known to 1 % tells the thickness to" in " ".join(study.sentences)


def test_the_first_wave_does_not_feel_how_long_a_beam_is():
    study = run_study("beam-length", "beam", "time.duration=1.2e-3", options=THREE_SIZES)
    assert np.ptp(column(study, "arr")) < 0.01 * column(study, "arr")[0]
    assert "does not feel the length" in study.sentences[-1]


@pytest.mark.slow
def test_thicker_plates_send_more_back():
    study = run_study("plate-thickness", "plate", "time.duration=1e-3", options=THREE_SIZES)
    assert np.all(np.diff(column(study, "arr")) > 0.05)


@pytest.mark.slow
def test_the_solid_beam_lies_at_timoshenkos_theory():
    """A beam as wide as high: amplitude ratio, time of flight and fifth frequency."""
    changes = ("beam.width=0.01", "time.duration=1.2e-3")
    study = run_study("solid-beam", "beam", *changes, options=SolidBeamOptions(factors=(2.0,)))
    for name, share in (("arr", 0.5), ("tof_us", 0.5), ("fifth_hz", 0.1)):
        timoshenko, euler, solid = column(study, name)
        assert abs(timoshenko - solid) < share * abs(euler - solid), name
    off = column(study, "off_solid")
    assert off[0] < 0.4 * off[1] and off[0] < 0.01


@pytest.mark.slow
def test_the_solid_plate_lies_at_mindlins_theory():
    """The first reflected wave and the compliance; coarse elements leave a percent in the modes."""
    study = run_study("solid-plate", "plate", options=SolidPlateOptions(scale=1.5))
    theory, solid = column(study, "arr")
    assert theory == pytest.approx(solid, rel=5e-3)
    assert abs(np.diff(column(study, "tof_us"))[0]) < 0.5
    theory, solid = column(study, "compliance_m_N")
    assert theory == pytest.approx(solid, rel=0.05)


@pytest.mark.parametrize(
    ("name", "usual", "changes", "message"),
    [
        ("axial-force", "rig-rigid", (), "has no \\[beam\\]"),
        ("plate-thickness", "beam", (), "has no \\[plate\\]"),
        ("axial-force", "beam", ("beam.left=free", "beam.right=free"), "hold an end"),
        ("beam-thickness", "beam", ("beam.diameter=0.02",), "without beam.thickness"),
        ("solid-beam", "beam", ("beam.axial_force=10",), "axial_force = 0"),
    ],
)
def test_a_scene_without_what_a_study_varies_is_refused(name, usual, changes, message):
    with pytest.raises(InvalidScene, match=message):
        run_study(name, usual, *changes)
