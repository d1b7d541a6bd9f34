"""Force, rate and voltage files in a calibration: units, gains, signs, impulses, refusals."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import beadwave
from beadwave.workflows.files.record import Record
from beadwave.workflows.fit.measured_record import measured
from beadwave.workflows.scene import InvalidScene

WALL = {"kind": "1dof", "frequency": 900.0, "mass": 0.8, "young": 30e9, "poisson": 0.2}
SENSORS = [
    {"sphere": 5, "gain": "5 mV/N", "low_pass": "200 kHz", "noise": 0.002},
    {"sphere": 8, "quantity": "velocity", "noise": 0.002},
]
SMALL = {"chain.count": 10, "output.spheres": [5], "wall": WALL, "time.duration": 1e-3}

pytestmark = pytest.mark.usefixtures("own_folder")


def made(sensors=SENSORS, **changes):
    """A record of a striker at 0.29 m/s on a wall of 900 Hz."""
    changes = SMALL | {"output.sensors": sensors, "striker.velocity": 0.29} | changes
    changes["output.instrument"] = {"sampling": 1e6, "bits": 12, "seed": 3}
    beadwave.impact("upright", changes, out="made", overwrite=True)
    return measured(Path("made/signals.csv"))


def fitted(sensors, free="striker,trigger,wall.frequency", data="made/signals.csv", **changes):
    settings = SMALL | {"wall": WALL | {"frequency": 850.0}, "striker.velocity": 0.3}
    settings |= {"output.sensors": sensors} if sensors else {"output.sensors": SENSORS[:1]}
    return beadwave.calibrate("upright", data, settings | changes, free=free, starts=1)


def columns(record: Record, *named: tuple[int, str, float]):
    """CSV of columns (index, heading, factor) of a record, with time in us."""
    head = ", ".join(["time [us]", *(name for _, name, _ in named)])
    rows = np.column_stack([1e6 * record.t, *(f * record.v[0][:, i] for i, _, f in named)])
    return "\n".join([head, *(",".join(f"{x:.9g}" for x in row) for row in rows)])


def test_an_unknown_gain_and_the_wall_are_found_from_a_voltage_and_a_velocity():
    made()
    result = fitted([SENSORS[0] | {"gain": "piezo"}])
    rows = {row.name: row for row in result.report.parameters}
    truth = {"striker": 0.29, "wall.frequency": 900.0, "gain piezo": 5e-3}
    for name, value in truth.items():
        assert abs(rows[name].found - value) < rows[name].two_sigma, name
        assert rows[name].two_sigma < 0.01 * value
    assert rows["gain piezo"].unit == "V/N"
    # written with the digits that its bar supports
    found, bar = rows["gain piezo"].found, rows["gain piezo"].two_sigma
    assert result.scene.output.sensors[0].gain == pytest.approx(found, abs=0.005 * bar)
    assert result.report.units["force 5"][0] == "V"
    assert set(result.report.misfit_m_s) == {"force 5", "velocity 8"}
    assert result.data["measured"].sizes == {"time": 1001, "sensor": 2}


def test_a_gain_of_the_wrong_sign_is_found_as_negative(tmp_path):
    record = made()
    (tmp_path / "turned.csv").write_text(columns(record, (0, "sphere 5 force [mV]", -1e3)))
    result = fitted([SENSORS[0] | {"gain": "piezo"}], data="turned.csv")
    assert result.scene.output.sensors[0].gain == pytest.approx(-5e-3, rel=5e-3)


def test_units_of_time_force_and_voltage_are_converted(tmp_path):
    record = made()
    text = columns(record, (0, "sphere 5 force [mN]", 1e3 / 5e-3), (1, "sphere 8 [mm/s]", 1e3))
    (tmp_path / "other.csv").write_text(text)
    second = measured(tmp_path / "other.csv")
    assert np.abs(second.t - record.t).max() < 1e-12
    assert np.abs(second.v[0, :, 0] * 5e-3 - record.v[0, :, 0]).max() < 1e-8
    assert np.abs(second.v[0, :, 1] - record.v[0, :, 1]).max() < 1e-8
    assert [c.quantity for c in second.channels] == ["force", "velocity"]
    bare = columns(record, (0, "sphere 5 [N]", 200.0))
    (tmp_path / "bare.csv").write_text(bare)
    assert measured(tmp_path / "bare.csv").channels[0].quantity == "force"


def test_a_mat_file_holds_forces(tmp_path):
    record = made()
    force = 1e3 / 5e-3 * record.v[0][:, :1]
    fixed = {"t": 1e3 * record.t, "y": force, "spheres": [5.0], "time_unit": "ms"}
    savemat(tmp_path / "f.mat", fixed | {"quantity": "force", "unit": "mN"})
    result = measured(tmp_path / "f.mat")
    assert np.allclose(result.v[0] * 5e-3, record.v[0][:, :1], rtol=1e-12, atol=1e-15)
    assert result.channels[0].name == "sphere 5 force" and not result.channels[0].in_volts


REFUSED = {
    "force is 'kg'": ("sphere 5 force [kg]", 1.0),
    "the quantity is one of": ("sphere 5 pressure [N]", 1.0),
    "correct the unit in the data's header": ("sphere 5 force [mN]", 200.0),
    "has the wrong sign": ("sphere 5 force [N]", -200.0),
    "allowed are 1 to chain.count = 10": ("sphere 11 force [N]", 200.0),
    "is 0 at every sample": ("sphere 5 force [N]", 0.0),
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_cannot_be_a_force_is_refused(sentence, tmp_path):
    heading, factor = REFUSED[sentence]
    (tmp_path / "bad.csv").write_text(columns(made(), (0, heading, factor)))
    with pytest.raises(InvalidScene, match=sentence):
        fitted(None, data="bad.csv")


def test_forces_of_spheres_on_leaf_springs_are_bad_input(tmp_path):
    (tmp_path / "f.csv").write_text(columns(made(), (0, "sphere 5 force [N]", 200.0)))
    with pytest.raises(InvalidScene, match="no forces are fitted of spheres on leaf"):
        fitted(None, data="f.csv", **{"leaf_springs": {"stiffness": 1e3}})


@pytest.mark.slow
def test_an_impulse_beside_the_strikers_momentum_is_told(tmp_path):
    record = made()
    for factor, expected in ((1.0, False), (1.15, True)):
        text = columns(record, (0, "sphere 5 force [N]", factor * 200.0))
        (tmp_path / "force.csv").write_text(text)
        result = fitted(None, data="force.csv", **{"striker.velocity": 0.29})
        said = [remark for remark in result.report.remarks if "carries an impulse" in remark]
        assert bool(said) == expected
    assert "+15 % off" in said[0]


def test_a_lasers_band_is_no_sensors(tmp_path):
    made()
    with pytest.raises(InvalidScene, match="low_pass instead"):
        beadwave.calibrate("upright", "made/signals.csv", SMALL, instrument=1e5)


def test_sensors_of_one_amplifier_share_its_gain():
    gain = {"gain": "5 mV/N", "noise": 0.002}
    made([{"sphere": 4, **gain}, {"sphere": 7, **gain}])
    sensors = [{"sphere": 4, "gain": "amplifier"}, {"sphere": 7, "gain": "amplifier"}]
    rows = {row.name: row for row in fitted(sensors).report.parameters}
    assert [name for name in rows if name.startswith("gain")] == ["gain amplifier"]
    result = rows["gain amplifier"]
    assert abs(result.found - 5e-3) < result.two_sigma < 1e-4 * 5
