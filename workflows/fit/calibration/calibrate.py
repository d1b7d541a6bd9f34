"""Measured velocities in, a calibrated scene with its uncertainty out.

Data that cannot be what it says (units, sign, order of the columns, time base, sampling) is refused
before anything is fitted; what is doubtful is fitted and told in a sentence.
"""

from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import coupling
import dem
from workflows.files.record import Record
from workflows.fit.calibration import parameters as free_parameters
from workflows.fit.calibration.channels import scaled
from workflows.fit.calibration.report import CalibrationReport, report_of
from workflows.fit.core.calibration.calibration import CalibrationResult, calibrate
from workflows.fit.core.calibration.forward import ChainForward
from workflows.fit.core.calibration.judgement import on_held_out
from workflows.fit.core.calibration.plausibility import (
    cut_off,
    filters_of,
    first_touch,
    on_repeats,
    plausible,
    require_samples,
    unlike_the_model,
)
from workflows.fit.core.calibration.search import Options
from workflows.fit.core.calibration.signals import (
    Filter,
    Signals,
    aligned,
    lag_of,
    noise_of_mean,
)
from workflows.fit.core.columns import beyond, require_columns
from workflows.fit.records import usable
from workflows.scene import InvalidScene, OneDofWall, Scene
from workflows.stages.chain import initial_velocity

if TYPE_CHECKING:
    from workflows.fit.core.calibration.posterior import Posterior

SCANNED = (50.0, 2000.0, 60)  # [Hz]


class CalibrationRequest(NamedTuple):
    """What the user asked for beyond scene and data."""

    free: str | None = None
    bounds: str | None = None
    trigger: str = "fit"  # "fit", "estimate", or the time of the first touch [s]
    band: float | None = None
    instrument: float | None = None
    hold_out: tuple[int, ...] = ()
    two_stage: bool = False
    starts: int = 12
    seed: int = 0
    scan: tuple[float, float, int] | None = None


class Calibrated(NamedTuple):
    """The scene that came out, its report, the fit behind both and the model that was fitted."""

    scene: Scene
    report: CalibrationReport
    fit: CalibrationResult
    forward: ChainForward
    posterior: "Posterior | None" = None

    @property
    def signals(self) -> Signals:
        return self.forward.signals


@usable()
def calibrated(
    scene: Scene, wall: dem.Wall | None, measured: Record, source: str, request: CalibrationRequest
) -> Calibrated:
    """The scene fitted to the record; raises InvalidScene for data or requests that cannot be."""
    began = perf_counter()
    names, limits = _names(scene, request), free_parameters.bounds(request.bounds)
    free_parameters.parameters(scene, names, 0.0, {})  # unknown names before any march
    time_scale = _contact_time_scale(scene, wall)
    require_samples(measured.t, time_scale)
    start = scaled(scene, free_parameters.rig(scene, wall, 0.0), measured)
    measured, doubts = start.record, start.remarks
    if start.channels is None:
        doubts = plausible(measured, initial_velocity(scene))
    elif request.instrument is not None:
        raise InvalidScene("--instrument is of lasers; say output.sensors' low_pass instead.")
    remarks = [*doubts, *cut_off(measured, time_scale)]
    used, held = _split(measured, request.hold_out)
    raw = aligned(measured.t, measured.v, tuple(n - 1 for n in measured.spheres))
    raw = raw._replace(signals=raw.signals._replace(channels=start.channels))
    remarks += on_repeats(raw)
    filters = filters_of(request.band, request.instrument, measured.t, time_scale)
    try:
        trigger, more = _trigger(scene, wall, raw.signals, filters, request)
    except coupling.CouplingError as error:
        raise InvalidScene(f"{source}: {str(error).rstrip('.')}.") from None
    rig = free_parameters.rig(scene, wall, trigger)
    parameters = (*free_parameters.parameters(scene, names, trigger, limits), *start.gains)
    signals = raw.signals.only(used)
    noise = noise_of_mean(signals, filters, time_scale)
    options = _options(request, parameters, _scan(scene, names, request), noise)
    fit = _fitted(rig, parameters, signals, filters, options, source)
    forward = ChainForward(rig, fit.parameters, signals, filters)
    others = ChainForward(rig, fit.parameters, raw.signals.only(held), filters) if held else None
    left_out = others.misfits(fit.value) if others else {}
    report = report_of(scene, source, measured, fit, signals, noise, left_out)
    report.seconds = perf_counter() - began
    report.remarks[:0] = [*remarks, *more, *on_held_out(left_out, fit)]
    if "trigger" not in names:
        report.remarks.append(f"The first touch was held at {1e6 * trigger:.5g} us of the record.")
    name = f"{scene.name}-calibrated"
    result = free_parameters.calibrated_scene(scene, fit.parameters, fit.value, name)
    return Calibrated(result, report, fit, forward)


def _options(request: CalibrationRequest, parameters: tuple, scan, noise: float | None) -> Options:
    return Options(
        staged=any(not p.of_wall for p in parameters),
        joint=not request.two_stage,
        starts=request.starts,
        seed=request.seed,
        scan=scan,
        noise=noise,
    )


def _fitted(rig, parameters, signals, filters, options: Options, source: str) -> CalibrationResult:
    """The fit; raises InvalidScene where there is none."""
    try:
        return calibrate(rig, parameters, signals, filters, options)
    except (dem.InvalidChain, dem.NoEquilibrium, coupling.CouplingError) as error:
        raise InvalidScene(f"{source}: {str(error).rstrip('.')}.") from None


def _contact_time_scale(scene: Scene, wall: dem.Wall | None) -> float:
    """Time [s] within which the stiffest contact moves."""
    rig = free_parameters.rig(scene, wall, 0.0)
    step = dem.sensitivities.usual_step(rig.chain, rig.wall, rig.v0)
    return dem.sensitivities.STEPS_PER_TIME_SCALE * step


def _names(scene: Scene, request: CalibrationRequest) -> tuple[str, ...]:
    free = free_parameters.usual(scene) if request.free is None else request.free
    names = tuple(n.strip() for n in free.split(","))
    return tuple(n for n in names if n != "trigger" or request.trigger == "fit")


def _split(measured: Record, hold_out: tuple[int, ...]) -> tuple[list[int], list[int]]:
    for n in hold_out:
        if n not in measured.spheres:
            raise InvalidScene(
                f"--hold-out {n} is not in the data, it has spheres {list(measured.spheres)}; "
                "name one of them."
            )
    held = [i for i, n in enumerate(measured.spheres) if n in hold_out]
    used = [i for i, n in enumerate(measured.spheres) if n not in hold_out]
    if not used:
        raise InvalidScene("--hold-out leaves no sphere to fit to; hold out fewer.")
    return used, held


def _trigger(
    scene: Scene, wall, signals: Signals, filters: Filter, request: CalibrationRequest
) -> tuple[float, list[str]]:
    """Time of the first touch on the data's clock, and what is doubtful about it."""
    t0 = float(signals.t[0])
    forward = ChainForward(free_parameters.rig(scene, wall, t0), (), signals, filters)
    dt = signals.t[1] - signals.t[0]
    longer = ChainForward(forward.rig, (), signals._replace(t=beyond(signals.t)), filters)
    m, channels = len(signals.names), signals.channels
    require_columns(
        signals.names if channels else [f"sphere {name}" for name in signals.names],
        signals.t, signals.v, longer.velocities(np.zeros(0)), forward.time_scale,
        signed=np.array([g is None for g in channels.groups] if channels else [True] * m),
        forces=np.array([s.quantity == "force" for s in channels.sensors] if channels
                        else [False] * m),
    )  # fmt: skip
    model = forward.velocities(np.zeros(0))
    data = filters.of_data(signals.v, dt)
    lag = lag_of(signals.t, data, model)
    found = first_touch(request.trigger, t0 + lag, signals.t)
    return found, list(unlike_the_model(signals, data, model, found - t0, dt, forward.time_scale))


def _scan(scene: Scene, names: tuple[str, ...], request: CalibrationRequest):
    if not isinstance(scene.wall, OneDofWall) or "wall.frequency" not in names:
        if request.scan:
            raise InvalidScene("--scan needs a 1dof wall with wall.frequency free; free it.")
        return None
    low, high, points = request.scan or SCANNED
    if not (0 < low < high < np.inf and 3 <= points <= 1000):
        raise InvalidScene(f"--scan {low:g}:{high:g}:{points} must grow and have 3 to 1000 points.")
    return low, high, points
