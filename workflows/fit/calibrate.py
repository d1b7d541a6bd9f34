"""Measured velocities in, a calibrated scene with its uncertainty out.

Data that cannot be what it says (units, sign, order of the columns, time base, sampling) is refused
before anything is fitted; what is doubtful is fitted and told in a sentence.
"""

from collections.abc import Mapping, Sequence
from time import perf_counter
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from beadwave import dem
from beadwave.dem import spheres
from beadwave.workflows.files.record import Record
from beadwave.workflows.fit import scene_parameters
from beadwave.workflows.fit.aligned_signals import Filter, Signals, aligned, lag_of, noise_of_mean
from beadwave.workflows.fit.chain_fit import CalibrationResult, calibrate, widened
from beadwave.workflows.fit.columns import model_times, require_columns
from beadwave.workflows.fit.forward import ChainForward
from beadwave.workflows.fit.marched_system import Rig
from beadwave.workflows.fit.measured_record import marched, sensor_of, usable
from beadwave.workflows.fit.model_errors import BetterModel, with_systems
from beadwave.workflows.fit.plausibility import (
    cut_off,
    filters_of,
    first_touch,
    on_repeats,
    plausible,
    require_samples,
    unlike_the_model,
)
from beadwave.workflows.fit.posterior import Posterior, posterior
from beadwave.workflows.fit.reliability import SHARES, on_held_out, on_posterior
from beadwave.workflows.fit.report import CalibrationReport, PosteriorSummary, calibration_report
from beadwave.workflows.fit.scaling import ScaledRecord, scaled
from beadwave.workflows.fit.sensed import Channels
from beadwave.workflows.fit.windows import Options
from beadwave.workflows.report.number_format import supported
from beadwave.workflows.scene import InvalidScene, OneDofWall, Scene
from beadwave.workflows.scene.units import GAINS
from beadwave.workflows.stages.chain.chain import initial_velocity

SCANNED = (50.0, 2000.0, 60)  # frequencies of a wall of one mass [Hz]: lowest, highest, points


class CalibrationRequest(NamedTuple):
    """Options of a calibration beyond scene and data."""

    free: str | None = None  # parameters, as in "contacts,striker"
    bounds: str | None = None  # as in "contacts=0.5:2"
    trigger: str = "fit"  # "fit", "estimate", or the time of the first touch [s]
    band: float | None = None  # [Hz] low-pass on data and model
    instrument: float | None = None  # [Hz] low-pass that the data has passed
    hold_out: tuple[int, ...] = ()  # spheres that are predicted, not fitted
    two_stage: bool = False  # the chain stays as the first waves determine it
    starts: int = 12
    seed: int = 0
    scan: tuple[float, float, int] | None = None  # of the wall's frequency [Hz]


class CalibrationOutcome(NamedTuple):
    """The scene that came out, its report, the fit behind both and the model that was fitted."""

    scene: Scene
    report: CalibrationReport
    fit: CalibrationResult
    forward: ChainForward
    posterior: Posterior | None = None

    @property
    def signals(self) -> Signals:
        """The signals that were fitted."""
        return self.forward.signals


@usable()
def calibrated(
    scene: Scene,
    wall: dem.Wall | None,
    measured: Record,
    source: str,
    request: CalibrationRequest,
    better: Mapping[str, Sequence[BetterModel]] = MappingProxyType({}),
) -> CalibrationOutcome:
    """The scene fitted to the record, with bars that hold noise, the step of time, and what walls
    that are `better` change; raises InvalidScene for data or requests that cannot be."""
    began = perf_counter()

    # what is free: unknown names are refused before anything is marched
    free = scene_parameters.usual(scene) if request.free is None else request.free
    names = tuple(name.strip() for name in free.split(","))
    names = tuple(n for n in names if n != "trigger" or request.trigger == "fit")
    limits = scene_parameters.limits_of(request.bounds, scene_parameters.plain_number)
    scene_parameters.parameters(scene, names, 0.0, {})

    # the record: samples against the time [s] within which the stiffest contact moves, then sizes
    rig = scene_parameters.rig(scene, wall, 0.0)
    time_scale = rig.time_scale
    require_samples(measured.t, time_scale)
    in_velocities = _in_velocities(scene, rig, measured)
    measured, remarks = in_velocities.record, list(in_velocities.remarks)
    channels = in_velocities.channels
    if channels is None:
        remarks += plausible(measured, initial_velocity(scene))
    elif request.instrument is not None:
        raise InvalidScene("--instrument is of lasers; say output.sensors' low_pass instead.")
    remarks += cut_off(measured, time_scale)

    # spheres that are fitted and spheres that are held out
    for n in request.hold_out:
        if n not in measured.spheres:
            raise InvalidScene(
                f"--hold-out {n} is not in the data, it has spheres {list(measured.spheres)}; "
                "name one of them."
            )
    held_out = [i for i, n in enumerate(measured.spheres) if n in request.hold_out]
    fitted = [i for i, n in enumerate(measured.spheres) if n not in request.hold_out]
    if not fitted:
        raise InvalidScene("--hold-out leaves no sphere to fit to; hold out fewer.")

    # the mean of the repeats, and the first touch on its clock
    repeats = aligned(measured.t, measured.v, tuple(n - 1 for n in measured.spheres))
    remarks += on_repeats(repeats)
    all_signals = repeats.signals._replace(channels=channels)
    filters = filters_of(request.band, request.instrument, measured.t, time_scale)
    with marched(source):
        trigger, doubts = _first_touch(scene, wall, all_signals, filters, request)
    remarks += doubts

    # the fit
    rig = scene_parameters.rig(scene, wall, trigger)
    gains = in_velocities.gains
    parameters = (*scene_parameters.parameters(scene, names, trigger, limits), *gains)
    signals = all_signals.only(fitted)
    noise = noise_of_mean(signals, filters, time_scale)
    options = Options(
        staged=any(not p.of_wall for p in parameters),
        joint=not request.two_stage,
        starts=request.starts,
        seed=request.seed,
        scan=_scanned_frequencies(scene, names, request),
        noise=noise,
    )
    with marched(source):
        fit = calibrate(rig, parameters, signals, filters, options)

    # bars hold what is known of the model's errors as well as the noise
    forward = ChainForward(rig, fit.parameters, signals, filters)

    models = with_systems(better, lambda wall: scene_parameters.rig(scene, wall, trigger))
    fit = widened(fit, forward, models)

    # the spheres held out are predicted, and all is reported
    left_out = {}
    if held_out:
        others = ChainForward(rig, fit.parameters, all_signals.only(held_out), filters)
        left_out = others.misfits(fit.value)
    report = calibration_report(scene, source, measured, fit, signals, noise, left_out)
    report.seconds = perf_counter() - began
    report.remarks[:0] = [*remarks, *on_held_out(left_out, fit)]
    if "trigger" not in names:
        report.remarks.append(f"The first touch was held at {1e6 * trigger:.5g} us of the record.")
    name = f"{scene.name}-calibrated"
    bars = fit.uncertainty.two_sigma
    written = np.array([supported(x, bar) for x, bar in zip(fit.value, bars, strict=True)])
    result = scene_parameters.calibrated_scene(scene, fit.parameters, written, name)
    return CalibrationOutcome(result, report, fit, forward)


def with_posterior(result: CalibrationOutcome, seed: int) -> CalibrationOutcome:
    """A calibration with samples of its posterior, and their quantiles in its report's rows."""
    began = perf_counter()
    samples, report = posterior(result.forward, result.fit, seed=seed), result.report
    report.posterior = PosteriorSummary(
        effective_samples=samples.effective,
        peaks=list(samples.masses),
        model_runs=samples.model_runs,
        seed=seed,
        believable=samples.believable,
        seconds=perf_counter() - began,
    )
    if samples.believable:
        for row, of_row in zip(report.parameters, samples.quantiles(SHARES).T, strict=True):
            row.quantiles = tuple(map(float, of_row))
    seconds = report.posterior.seconds
    report.remarks.append(on_posterior(samples, result.fit, seed=seed, seconds=seconds))
    return result._replace(posterior=samples)


def _in_velocities(scene: Scene, rig: Rig, record: Record) -> ScaledRecord:
    """The record of any sensors in velocities; raises UnusableRecord where a signal cannot be
    one, InvalidScene where the scene does not have its sphere."""
    if record.channels is None:
        return ScaledRecord(record, None, (), ())
    sensors, gains = zip(*(sensor_of(scene, c) for c in record.channels), strict=True)
    channels = Channels(
        sensors,
        np.ones(len(sensors)),
        tuple(f"{c.quantity} {c.sphere}" for c in record.channels),
        tuple(c.unit for c in record.channels),
        tuple(name and name.removeprefix("sphere ") for name in gains),
    )
    masses = spheres.mass(scene.chain.radius, scene.chain.density)
    momentum = float(np.sum(masses * initial_velocity(scene)))
    gain_units = {quantity: kind.unit for quantity, kind in GAINS.items()}
    return scaled(rig, record, channels, gain_units, momentum)


def _first_touch(
    scene: Scene,
    wall: dem.Wall | None,
    signals: Signals,
    filters: Filter,
    request: CalibrationRequest,
) -> tuple[float, list[str]]:
    """Time [s] of the first touch on the data's clock, and what is doubtful about it; raises
    UnusableRecord for columns that are swapped or turned."""
    t0, dt = float(signals.t[0]), signals.t[1] - signals.t[0]
    no_parameters = np.zeros(0)
    forward = ChainForward(scene_parameters.rig(scene, wall, t0), (), signals, filters)

    # the columns against a longer model: a record may begin late
    longer = ChainForward(forward.rig, (), signals._replace(t=model_times(signals.t)), filters)
    m, channels = len(signals.names), signals.channels
    if channels:
        names = list(signals.names)
        signed = np.array([group is None for group in channels.groups])
        forces = np.array([sensor.quantity == "force" for sensor in channels.sensors])
    else:
        names = [f"sphere {name}" for name in signals.names]
        signed, forces = np.ones(m, bool), np.zeros(m, bool)
    require_columns(
        names, signals.t, signals.v, longer.velocities(no_parameters), forward.time_scale,
        signed=signed, forces=forces,
    )  # fmt: skip

    model, data = forward.velocities(no_parameters), filters.of_data(signals.v, dt)
    lag = lag_of(signals.t, data, model)
    touch = first_touch(request.trigger, t0 + lag, signals.t)
    doubts = unlike_the_model(signals, data, model, touch - t0, dt, forward.time_scale)
    return touch, list(doubts)


def _scanned_frequencies(
    scene: Scene, names: tuple[str, ...], request: CalibrationRequest
) -> tuple[float, float, int] | None:
    """Lowest, highest [Hz] and number of frequencies to scan; None without a wall of one mass whose
    frequency is free."""
    if not isinstance(scene.wall, OneDofWall) or "wall.frequency" not in names:
        if request.scan:
            raise InvalidScene("--scan needs a 1dof wall with wall.frequency free; free it.")
        return None
    low, high, points = request.scan or SCANNED
    if not (0 < low < high < np.inf and 3 <= points <= 1000):
        raise InvalidScene(f"--scan {low:g}:{high:g}:{points} must grow and have 3 to 1000 points.")
    return low, high, points
