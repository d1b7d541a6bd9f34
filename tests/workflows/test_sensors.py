"""Sensors of a scene: keys, units, refusals, and what a run writes of them."""

import json

import numpy as np
import pytest

from beadwave.coupling.sensors import QUANTITIES
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.summary import SensorWaves, SphereWaves
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.tables import sensors
from beadwave.workflows.scene.units import GAINS, unit_of

from command_line import beadwave

FORCE = {"sphere": 9, "gain": "2 mV/N", "low_pass": "100 kHz"}

pytestmark = pytest.mark.usefixtures("own_folder")


def with_sensors(*sensors, **instrument):
    told = {"output.sensors": list(sensors)}
    return scene("rig-half-space", told | ({"output.instrument": instrument} if instrument else {}))


def test_a_gain_has_the_unit_of_its_quantity():
    found = with_sensors(FORCE, {"sphere": 9, "quantity": "velocity", "gain": "coil A"})
    known, unknown = found.output.sensors
    assert known.gain == 2e-3 and known.unit == "V" and known.label == "force 9"
    assert unknown.gain == "coil A" and unknown.unit == "V"
    assert with_sensors({"sphere": 2, "range": "300 mN"}).output.sensors[0].range == 0.3


def test_every_quantity_of_a_sphere_has_its_units():
    assert sensors.OF_SPHERES.keys() == QUANTITIES.keys()
    assert sensors.KINDS.keys() == GAINS.keys()
    for quantity, kind in sensors.KINDS.items():  # V per unit, times the unit, is V
        powers = np.add(unit_of(GAINS[quantity].unit).powers, unit_of(kind.unit).powers)
        assert tuple(powers) == unit_of("V").powers


REFUSED = {
    "quantity = \\[1\\] must be": {"sphere": 3, "quantity": [1]},
    "gain of a displacement, a gain of a force is needed": {"sphere": 9, "gain": "2 mV/m"},
    "'a.b' is no number with a unit": {"sphere": 9, "gain": "a.b"},
    "a voltage, a force is needed": {"sphere": 9, "range": "3 V"},
    "allowed are 1 to chain.count = 17": {"sphere": 18},
    "quantity = 'x' must be 'force', ": {"sphere": 3, "quantity": "x"},
    "gain = 0 shows nothing": {"sphere": 3, "gain": 0.0},
    "must be below its low_pass": {"sphere": 3, "low_pass": 1e3, "high_pass": 2e3},
    "nearest known is 'order'": {"sphere": 3, "ordr": 2},
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_a_sensor_that_cannot_be_is_refused(sentence):
    with pytest.raises(InvalidScene, match=sentence.replace("(", r"\(")):
        with_sensors(REFUSED[sentence])


def test_a_sensor_is_changed_by_its_number():
    found = scene("sensed-beam", ("output.sensors.1.sphere=5", "output.sensors.1.noise=0.02"))
    assert [(s.sphere, s.noise, s.gain) for s in found.output.sensors] == [(5, 0.02, "bead")]
    for number in ("2", "0", "bead"):
        with pytest.raises(InvalidScene, match=r"sensors is a list of 1; write sensors\.1"):
            scene("sensed-beam", (f"output.sensors.{number}.sphere=5",))
    with pytest.raises(InvalidScene, match=r"spheres = .* is a value and has no keys below it"):
        scene("sensed-beam", ("output.spheres.1.sphere=5",))


def test_two_sensors_of_the_same_are_refused():
    with pytest.raises(InvalidScene, match="second sensor of force 9"):
        with_sensors(FORCE, {"sphere": 9})


def test_a_gain_is_of_one_quantity():
    with pytest.raises(InvalidScene, match="gain = 'amp' is another quantity's"):
        with_sensors(
            {"sphere": 9, "gain": "amp"}, {"sphere": 9, "gain": "amp", "quantity": "velocity"}
        )


def test_an_instrument_without_sensors_or_samples_is_refused():
    with pytest.raises(InvalidScene, match="records nothing"):
        scene("rig-half-space", {"output.instrument": {"bits": 8}})
    with pytest.raises(InvalidScene, match=r"takes 3e\+06 samples"):
        with_sensors(FORCE, sampling="1 GHz")


def test_a_run_writes_signals_and_tells_their_waves(tmp_path, capsys):
    sensors = '--set=output.sensors=[{sphere=9, gain="2 mV/N"}, {sphere=4, quantity="velocity"}]'
    instrument = "--set=output.instrument={sampling=2e6, bits=12}"
    assert beadwave("impact", "rig-half-space", sensors, instrument, "--out=o", "--json") == 0
    told = json.loads(capsys.readouterr().out)["sensors"]
    head, names, *rows = (tmp_path / "o" / "signals.csv").read_text().splitlines()
    assert "SYNTHETIC" in head
    assert names == "time [s], sphere 9 force [V], sphere 4 velocity [m/s]"
    table = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    assert table.shape == (6001, 3)
    kept = np.load(tmp_path / "o" / "trajectory.npz")
    force = 0.5 * (kept["contact_force"][:, 7] + kept["contact_force"][:, 8])
    step = 2e-3 * force.max() / (2**11 - 1)
    assert np.abs(table[::2, 1] - 2e-3 * force).max() <= 0.5 * step * (1 + 1e-3)
    assert told["force 9"]["unit"] == "V"
    assert told["force 9"]["echo_delay_s"] == pytest.approx(
        told["velocity 4"]["echo_delay_s"], rel=0.5
    )
    assert told["force 9"]["largest"] == pytest.approx(2e-3 * force.max(), rel=1e-3)


def test_a_sensor_costs_no_other_march(tmp_path, capsys):
    quick = ("--set=chain.count=4", "--set=time.duration=0.3e-3", "--set=output.spheres=[1]")
    beadwave("impact", "rig-half-space", *quick, "--json")
    capsys.readouterr()
    beadwave("impact", "rig-half-space", *quick, "--set=output.sensors=[{sphere=2}]", "--json")
    stages = {
        stage["name"]: stage["cached"] for stage in json.loads(capsys.readouterr().out)["stages"]
    }
    assert stages["impact"]


@pytest.mark.parametrize("change", ["output.samples=2", "chain.count=3"])
def test_a_sensor_without_a_wave_has_no_arrivals(change, capsys):
    sensors = "--set=output.sensors=[{sphere=2}]"
    changes = (f"--set={change}", "--set=output.spheres=[1]", sensors)
    assert beadwave("impact", "free-chain", *changes, "--json") == 0
    told = json.loads(capsys.readouterr().out)["sensors"]["force 2"]
    assert told["echo_delay_s"] is None and told["echo_ratio"] is None


@pytest.mark.parametrize("kind", [SphereWaves, SensorWaves])
def test_the_echo_of_a_summary_has_former_names(kind):
    of_sensor = {"unit": "V", "largest": 1.0} if kind is SensorWaves else {}
    former = kind.model_validate({"arrivals": (), "tof_s": 1e-3, "arr": 0.9} | of_sensor)
    today = kind(arrivals=(), echo_delay_s=1e-3, echo_ratio=0.9, **of_sensor)
    assert former == today
    assert {"echo_delay_s", "echo_ratio"} < today.model_dump().keys()
