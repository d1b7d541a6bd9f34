"""Rate at which the bars of `beadwave inspect` hold the truth, over records with noise of their
own.

You will see, after every twenty repeats, for thickness, modulus and axial force of the beam of
docs/inspect.md: how often the two-sigma bar has held the truth, mean and standard deviation of
(found - true) / sigma, the largest errors, and how often the records were explained.

    striker - o o o o o o o o o ..  beam        sphere 9: force in V, gain unknown,
              five impacts, 0.3 to 0.5 m/s      2 MHz, 8 bits, 1 % of noise

Each repeat begins at the truth: this is a test of the bars. With --beams the search is tested, on
beams drawn all over wide bounds; you will see how far the answer is off in its standard deviations,
whether the records were called explained, and the seconds of one core.

Run it: python examples/inspect_repeats.py 200          four minutes on one core
        python examples/inspect_repeats.py --beams 40   five minutes
"""

import sys
from time import process_time

import numpy as np

from beadwave import dem
from beadwave.coupling.sensors import Sensor, measured, recorded, signals
from beadwave.dem.sensitivities import usual_step
from beadwave.workflows.files.record import Channel, MeanRecord
from beadwave.workflows.fit.inspect import InspectionRequest, inspected, problem
from beadwave.workflows.fit.inversion import Inversion, inverted, profiled
from beadwave.workflows.fit.parametric_wall import Bounds
from beadwave.workflows.fit.scene_parameters import per_record, shared
from beadwave.workflows.fit.varied_scene import computed, structure
from beadwave.workflows.stages.chain.chain import chain
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.sweep.cases import Base, base_of

TRUTH = {"beam.thickness": 12.4e-3, "beam.young": 72e9, "beam.axial_force": -20e3}
BOUNDS = "beam.thickness=12.3mm:12.5mm,beam.young=70GPa:74GPa,beam.axial_force=-22kN:-18kN"
SPEEDS = np.array([0.30, 0.35, 0.40, 0.45, 0.50])  # as `--each` has them, 3 % off
SENSOR = Sensor(8, "force", gain=0.7, noise=0.01)
SAMPLES, RATE, BITS = 8001, 2e6, 8  # instants, samples a second, bits of the instrument
SHOWN_EVERY = 20
WIDE_BOUNDS = "beam.thickness=9mm:15mm,beam.young=49GPa:98GPa,beam.axial_force=-35kN:5kN"
EACH = "striker.velocity=" + ",".join(map(str, SPEEDS))
MOST_LOAD = 0.97  # of the buckling load


def main(repeats: int) -> None:
    """Bars of one beam."""
    truth = np.array(list(TRUTH.values()))
    base = base_of("sensed-beam", TRUTH)
    parameters = shared(base, ",".join(TRUTH), BOUNDS)
    of_each_record = per_record(base, EACH, len(SPEEDS))
    box = Bounds(*(np.array([getattr(p, end) for p in parameters]) for end in ("low", "high")))
    model = structure(base, (*TRUTH, "striker.velocity"), box, len(parameters), quiet)
    begin, clean = impacts(base, truth)
    start, answers = process_time(), []
    for i in range(repeats):
        records = tuple(with_noise(y, (99, i, k)) for k, y in enumerate(clean))
        fit, gains, _ = problem(model, records, parameters, of_each_record)
        answer = inverted(fit, begin=begin, n_shared=len(parameters), gains=gains)
        answers.append(profiled(fit, answer, len(parameters)))
        if (i + 1) % SHOWN_EVERY == 0 or i + 1 == repeats:
            print_bars(answers, truth, (process_time() - start) / (i + 1))


def impacts(base: Base, truth: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """True values of all parameters, and the five signals (SAMPLES, 1) before the instrument."""
    rng = np.random.default_rng(5)
    late = rng.uniform(0, 2e-5, len(SPEEDS))
    speeds = SPEEDS * (1 + 0.03 * rng.uniform(-1, 1, len(SPEEDS)))
    clean = signals_of(base, SENSOR, speeds, late)
    return np.concatenate([truth, np.ravel(np.column_stack([speeds, late]))]), clean


def signals_of(base: Base, sensor: Sensor, speeds, late) -> list[np.ndarray]:
    """(SAMPLES, 1) [V] of each impact before the instrument, by short steps."""
    scene, t, records = base.with_values({}), np.arange(SAMPLES) / RATE, []
    row, wall = chain(scene), computed(scene).wall
    for speed, begin in zip(speeds, late, strict=True):
        v0 = np.append(speed, np.zeros(len(row.mass) - 1))
        dt = usual_step(row, wall, v0)
        n = int(np.ceil(t[-1] / dt))
        run = dem.march(row, wall, v0, duration=n * dt, dt=dt, n_save=n)
        force = measured([sensor], run.t, run.x, run.v, run.contact_force)
        records.append(signals([sensor], run.t, force, np.clip(t - begin, 0, None)))
    return records


def with_noise(y: np.ndarray, seed: tuple[int, ...]) -> MeanRecord:
    """Record of a signal by the instrument: noise, and its bits."""
    t, rows = np.arange(SAMPLES) / RATE, recorded([SENSOR], y, BITS, seed)
    channel = Channel(SENSOR.sphere + 1, SENSOR.quantity, True)
    return MeanRecord(t, rows, (channel,), np.full(1, np.nan), 1, f"record {seed[-1] + 1}", True)


def print_bars(answers: list[Inversion], truth: np.ndarray, seconds: float) -> None:
    """A line for each parameter: how often its bar holds the truth."""
    value = np.array([answer.value[:3] for answer in answers])
    z = (value - truth) / np.array([answer.uncertainty.two_sigma[:3] / 2 for answer in answers])
    explained = np.mean([answer.explained for answer in answers])
    print(f"{len(answers)} repeats, {100 * explained:.3g} % explained, {seconds:.2f} s each")
    for i, name in enumerate(TRUTH):
        error = 100 * np.abs(value[:, i] / truth[i] - 1).max()
        covered = 100 * np.mean(np.abs(z[:, i]) <= 2)
        print(
            f"  {name:18} held {covered:5.1f} %   mean {z[:, i].mean():+.2f}  deviation "
            f"{z[:, i].std():.3f} sigma   largest error {error:.2g} %",
            flush=True,
        )


def beams(count: int) -> None:
    """The search on beams all over wide bounds."""
    rng, base = np.random.default_rng(0), base_of("sensed-beam", ())
    limits = shared(base, ",".join(TRUTH), WIDE_BOUNDS)
    low, high = (np.array([getattr(p, end) for p in limits]) for end in ("low", "high"))
    for i in range(count):
        truth = random_beam(rng, low, high)
        true_base = base_of("sensed-beam", dict(zip(TRUTH, map(float, truth), strict=True)))
        records, start = random_records(true_base, i), process_time()
        answer = inspected(
            base, records, InspectionRequest(",".join(TRUTH), WIDE_BOUNDS, EACH), quiet
        ).answer.inversion
        seconds = process_time() - start
        deviations = (answer.value[:3] - truth) / (answer.uncertainty.two_sigma[:3] / 2)
        verdict = "explained" if answer.explained else "NOT EXPLAINED"
        print(
            f"beam {i}: {verdict}, off by {deviations.round(2)} sigma, {seconds:.1f} s", flush=True
        )


def random_beam(rng, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Thickness, modulus and axial force of a beam that does not buckle, 0.3 m by 0.04 m."""
    while True:
        h, E, N = beam = low + (high - low) * rng.random(3)
        if -N < MOST_LOAD * E * 0.04 * h**3 / 12 * np.pi**2 / 0.3**2:
            return beam


def random_records(base: Base, i: int) -> tuple[MeanRecord, ...]:
    """Five impacts; gain, velocities and triggers are drawn."""
    rng = np.random.default_rng([7, i])
    gain, impacts = rng.uniform(0.2, 2.0), []
    for speed in SPEEDS:
        impacts.append((speed * (1 + 0.03 * rng.uniform(-1, 1)), rng.uniform(0, 2e-5)))
    clean = signals_of(base, SENSOR._replace(gain=gain), *zip(*impacts, strict=True))
    return tuple(with_noise(y, (i, k)) for k, y in enumerate(clean))


if __name__ == "__main__":
    run = beams if "--beams" in sys.argv else main
    run(int(sys.argv[-1]) if sys.argv[-1].isdigit() else 40)
