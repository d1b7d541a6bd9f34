"""Signals of sensors in a calibration: the run's own, their derivatives, unknown gains."""

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling.band import Band
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.sensors import Sensor, measured, signals
from beadwave.workflows.files.record import Record
from beadwave.workflows.fit.aligned_signals import Signals
from beadwave.workflows.fit.chain_fit import calibrate
from beadwave.workflows.fit.forward import ChainForward
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.parameter import Parameter
from beadwave.workflows.fit.scaling import incident_impulse, scaled
from beadwave.workflows.fit.sensed import Channels
from beadwave.workflows.fit.windows import Options

N, SPEED, TRIGGER = 8, 0.3, 30e-6
V0 = SPEED * (np.arange(N) == 0)
CHAIN = dem.row_of_spheres(
    0.0095, 7800.0, 193e9, 0.3, count=N, gravity=9.80665, n_falling=1, preload=2.0
)
WALL = dem.one_dof_wall(700.0, 0.5, 0.02)
SENSORS = (
    Sensor(3, "force", 2e-3, Band(80e3)),
    Sensor(5, "force-rate", 1e-6, Band(None, 2e3, 2)),
    Sensor(6, "velocity"),
    Sensor(7, "displacement", 1e4),
)
CHANNELS = Channels(
    SENSORS, np.ones(4), tuple(s.quantity for s in SENSORS), ("V", "V", "m/s", "V"),
    ("piezo", None, None, "coil"),
)  # fmt: skip
T = np.arange(900) * 1e-6
PARAMETERS = (
    Parameter("contact 4", "contact", 1.0, 0.3, 3.0, 0.1, "", 3),
    Parameter("striker", "striker", SPEED, 0.1, 1.0, 0.05),
    Parameter("preload", "preload", 2.0, 0.5, 8.0, 0.5),
    Parameter("trigger", "trigger", TRIGGER, 0.0, 1e-4, 5e-6),
    Parameter("wall.frequency", "frequency", 700.0, 100.0, 3000.0, 100.0),
    Parameter("gain piezo", "gain", 5.0, 0.5, 50.0, 0.5),
)


def forward(parameters=PARAMETERS, channels=CHANNELS):
    observed = Signals(T, np.zeros((T.size, 4)), (3, 5, 6, 7), np.full(4, np.nan), 1, channels)
    return ChainForward(Rig(CHAIN, WALL, V0, trigger=TRIGGER), parameters, observed)


def test_signals_are_those_of_the_usual_march():
    run = dem.march_to_error(CHAIN, WALL, V0, duration=1e-3, error=1e-7, n_save=2000).trajectory
    usual = signals(
        SENSORS, run.t, measured(SENSORS, run.t, run.x, run.v, run.contact_force),
        np.clip(T - TRIGGER, 0.0, None),
    )  # fmt: skip
    result = forward().velocities(np.array([p.start for p in PARAMETERS]))
    off = np.abs(result - usual).max(axis=0) / np.abs(usual).max(axis=0)
    # steps of a fortieth of a contact's time; a rate is the slope of a spline
    assert (off < [2e-6, 5e-5, 1e-6, 4e-6]).all()


def test_their_derivatives_are_those_of_differences():
    model, start = forward(), np.array([p.start for p in PARAMETERS])
    start[-1] = 6.5  # a gain that is not what it starts from
    _, slopes = model.velocities_and_sensitivities(start)
    for j, p in enumerate(PARAMETERS):
        step = 1e-4 * p.scale * (np.arange(len(start)) == j)
        by_difference = (model.velocities(start + step) - model.velocities(start - step)) / (
            2e-4 * p.scale
        )
        size = np.abs(by_difference).max(axis=0)
        off = np.abs(slopes[:, :, j] - by_difference).max(axis=0)
        assert size.max() > 0.0
        # contacts open and close at other samples: Hertz' force has no second derivative there
        assert (off <= 2e-3 * np.maximum(size, 1e-3 * size.max())).all(), p.name


def test_an_unknown_gain_is_found_beside_the_chain():
    truth = np.array([1.2, 0.28, 2.0, TRIGGER, 750.0, 6.5])
    data = forward().velocities(truth)
    observed = forward().signals._replace(v=data + 1e-5 * np.random.default_rng(0).standard_normal(
        data.shape))  # fmt: skip
    free = tuple(p for p in PARAMETERS if p.name != "preload")
    rig = Rig(CHAIN, WALL, V0, trigger=TRIGGER)
    result = calibrate(rig, free, observed, options=Options(starts=2, noise=1e-5))
    exact = np.delete(truth, 2)
    assert np.abs(result.value / exact - 1.0).max() < 2e-3
    off = np.abs(result.value - exact) / result.uncertainty.two_sigma
    assert (off < 2.0).all()


def test_a_record_is_scaled_to_the_velocities_of_its_spheres_and_unknown_gains_to_its_size():
    """Signals of the scene itself, the first -2 times and the last -3 times as large."""
    run = dem.march_to_error(CHAIN, WALL, V0, duration=T[-1], error=1e-5, n_save=1500).trajectory
    shown = signals(SENSORS, run.t, measured(SENSORS, run.t, run.x, run.v, run.contact_force), T)
    record = Record(T, (shown * [-2.0, 1.0, 1.0, -3.0])[None], (4, 6, 7, 8), "")
    units = {"force": "V/N", "displacement": "V/m"}
    result = scaled(Rig(CHAIN, WALL, V0), record, CHANNELS, units, CHAIN.mass[0] * SPEED)
    assert [(p.name, p.unit, p.index) for p in result.gains] == [
        ("gain piezo", "V/N", -1), ("gain coil", "V/m", -1)]  # fmt: skip
    assert [p.start for p in result.gains] == pytest.approx([2.0, 3.0], rel=1e-3)
    fastest = np.abs(run.v[:, [3, 5, 6, 7]]).max(axis=0)
    largest = np.abs(result.record.v[0]).max(axis=0)
    np.testing.assert_allclose(largest, fastest, rtol=2e-3)


def test_forces_on_leaf_springs_are_refused():
    sprung = CHAIN._replace(leaf_stiffness=np.full(N, 10.0), n_falling=0)
    with pytest.raises(CouplingError, match="no forces are fitted"):
        ChainForward(Rig(sprung, WALL, V0), (), forward().signals)


def test_an_unknown_quantity_is_refused_by_its_name():
    channels = CHANNELS._replace(sensors=(Sensor(3, "force_rate"), *SENSORS[1:]))
    with pytest.raises(CouplingError, match="a sensor of 'force_rate' is unknown; take one of"):
        forward(channels=channels).velocities(np.array([p.start for p in PARAMETERS]))


def test_the_impulse_of_the_first_wave_is_momentum_and_none_where_waves_overlap():
    run = dem.march_to_error(CHAIN, WALL, V0, duration=1e-3, error=1e-7, n_save=2000).trajectory
    force = measured([Sensor(3, "force")], run.t, run.x, run.v, run.contact_force)[:, 0]
    result = incident_impulse(run.t, force)
    gone = int(np.searchsorted(run.t, result.end))
    momentum = CHAIN.mass[0] * (0.5 * run.v[gone, 3] + run.v[gone, 4:].sum())
    assert result.impulse == pytest.approx(momentum, rel=0.02)
    overlapping = sum(np.exp(-(((T - at) / 50e-6) ** 2)) for at in (300e-6, 410e-6))
    assert incident_impulse(T, overlapping) is None
    assert incident_impulse(T, 0.0 * T) is None
