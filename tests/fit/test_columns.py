"""Swapped and turned columns of chains at random, beside a model that is off in all it may be."""

from typing import NamedTuple

import numpy as np
import pytest

from beadwave import dem
from beadwave.coupling.sensors import Sensor, measured, signals
from beadwave.dem.sensitivities import STEPS_PER_TIME_SCALE, usual_step
from beadwave.workflows.files.record import UnusableRecord
from beadwave.workflows.fit.columns import model_times, require_columns


class Case(NamedTuple):
    """A record, what the model shows, whether signs are known, a contact's time scale."""

    t: np.ndarray
    y: np.ndarray
    model: np.ndarray
    time_scale: float
    signed: np.ndarray
    forces: np.ndarray
    late: bool

    def refusal(self, y=None):
        names = [f"column {i}" for i in range(self.y.shape[1])]
        try:
            require_columns(
                names, self.t, self.y if y is None else y, self.model, self.time_scale,
                signed=self.signed, forces=self.forces,
            )  # fmt: skip
        except UnusableRecord as error:
            return str(error)
        return ""


def marched(n, young, speed, preload, wall, *, radius, density, last=None, per_sphere=None):
    row = dem.row_of_spheres(radius, density, young, 0.3, count=n, flat=dem.Flat(70e9, 0.3))
    row, v0 = row._replace(preload=preload), speed * np.eye(1, n)[0]
    dt = 2 * usual_step(row, dem.one_dof_wall(*wall, 0.02), v0)
    scale = STEPS_PER_TIME_SCALE * dt / 2
    last = max(40.0, per_sphere * n) * scale if last is None else last
    steps = int(np.ceil(last / dt))
    run = dem.march(
        row, dem.one_dof_wall(*wall, 0.02), v0, duration=steps * dt, dt=dt, n_save=steps
    )
    return run, scale


def shown(sensors, run, at):
    values = measured(sensors, run.t, run.x, run.v, run.contact_force)
    return signals(sensors, run.t, values, np.clip(at, 0.0, run.t[-1]))


def case(seed):
    """Late triggers, records that begin late, noise of 0.1 to 10 %, gains unknown; the model's
    moduli, velocity, preload and wall are off by up to factors of 1.25, 1.4, 1.3 and 2."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 20))
    spheres = {"radius": rng.uniform(0.005, 0.015), "density": rng.uniform(2500, 8000)}
    young, speed, hz, mass = 10 ** rng.uniform([10.5, -1, 2.3, -1], [11.33, 0, 3.5, 0.7])
    preload = 10 ** rng.uniform(-1, 1.3) * (rng.random() < 0.5)
    run, scale = marched(n, young, speed, preload, (hz, mass), per_sphere=rng.uniform(2.5, 6),
                         **spheres)  # fmt: skip
    quantity = str(rng.choice(["velocity", "force", "force-rate"], p=[0.5, 0.4, 0.1]))
    watched = np.sort(rng.choice(np.arange(1, n), int(rng.integers(1, 4)), replace=False))
    sensors = [Sensor(int(i), quantity) for i in watched]
    t = np.arange(0.0, run.t[-1], rng.uniform(0.02, 0.15) * scale)
    begin = rng.choice([0.0, rng.uniform(0, 10) * scale, -rng.uniform(0, 0.3) * run.t[-1]])
    y = shown(sensors, run, t - begin)
    noise = 10 ** rng.uniform(-3, -1) * np.abs(y).max(axis=0)
    y = y + noise * rng.standard_normal(y.shape)
    is_signed = quantity == "velocity" or rng.random() < 0.5
    if not is_signed:
        y = y * rng.choice([-1, 1], y.shape[1]) * 10 ** rng.uniform(-2, 2, y.shape[1])
    off = 2 ** rng.uniform([-0.3, -0.5, -1, -1, -0.4], [0.3, 0.5, 1, 1, 0.4])
    model_run, time_scale = marched(
        n, off[0] * young, off[1] * speed, off[4] * preload, (off[2] * hz, off[3] * mass),
        last=1.7 * run.t[-1], **spheres,
    )  # fmt: skip
    model = shown(sensors, model_run, model_times(t) - t[0])
    signed, forces = (np.full(y.shape[1], value) for value in (is_signed, quantity == "force"))
    return Case(t, y, model, time_scale, signed, forces, begin < 0)


@pytest.fixture(scope="module")
def cases():
    return [case(seed) for seed in range(60)]


@pytest.mark.slow
def test_correct_records_are_never_refused(cases):
    assert not [item.refusal() for item in cases if item.refusal()]


@pytest.mark.slow
def test_turned_columns_are_found_in_nine_of_ten_records_that_begin_before_the_wave(cases):
    """One column or all; 306 of 315 with other seeds."""
    signed = [item for item in cases if item.signed.all() and not item.late]
    said = [item.refusal(-item.y) for item in signed]
    said += [
        item.refusal(item.y * np.append(-1.0, np.ones(item.y.shape[1] - 1))) for item in signed
    ]
    assert len(said) > 30
    assert np.mean(["wrong sign" in text for text in said]) > 0.8


def test_swapped_columns_are_found_in_nine_of_ten_records_that_begin_before_the_wave(cases):
    said = [
        item.refusal(item.y[:, [item.y.shape[1] - 1, *range(1, item.y.shape[1] - 1), 0]])
        for item in cases
        if item.y.shape[1] > 1 and not item.late
    ]
    assert len(said) > 15
    assert np.mean(["swapped" in text for text in said]) > 0.8
    assert all("\n" not in text for text in said)


def test_noise_alone_and_a_record_without_a_wave_are_not_judged(cases):
    for i, item in enumerate(cases[:10]):
        rng = np.random.default_rng(i)
        assert not item.refusal(rng.standard_normal(item.y.shape))
        assert not item.refusal(0.0 * item.y + 1e-3)
        still = item._replace(t=item.t[:20], y=1e-3 * rng.standard_normal(item.y[:20].shape),
                             model=item.model[:32])  # fmt: skip
        assert not still.refusal()


def test_the_sentence_names_the_columns_and_what_to_do(cases):
    item = next(c for c in cases if c.y.shape[1] == 3 and c.signed.all() and not c.late)
    turned = item.refusal(item.y * [1.0, -1.0, 1.0])
    assert turned.startswith("column 1 has the wrong sign") and "turn the sign" in turned
    swapped = item.refusal(item.y[:, [2, 1, 0]])
    assert "columns column 0 and column 2 are swapped" in swapped
    assert "exchange their headings" in swapped
