"""Models of records: what lasers and sensors show of impacts, and its derivatives.

`ChainForward` is the model of `calibrate`: one impact as a laser or sensors show it. Its many
parameters are of the chain and of simple walls, by which the march has exact derivatives: with 20
of them they cost 4 to 17 runs, difference quotients 1.2 to 4.2 times as much.

`StructureForward` is the model of `inspect` and `design`: several impacts on one structure,

    y_s(t) = g signal(t - trigger_s; shared, own_s),   s = 1..S records

Each record is a run of its own: the numbers of the structure are shared, a striker's velocity and
the trigger are a record's own. The numbers are few and any key of a scene, whose walls have no
derivatives by them: these are difference quotients. Runs are marched by steps of one length, so
that differences of two runs are smooth in the numbers; chains of one evaluation are dealt to the
threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.coupling.errors import CouplingError
from beadwave.coupling.sensors import Sensor, measured_in_runs, signals
from beadwave.dem import Trajectory, march
from beadwave.dem.sensitivities import march_with_sensitivities
from beadwave.workflows.fit.aligned_signals import Filter, Signals
from beadwave.workflows.fit.marched_system import ChainsRig, ChainsRun, Rig
from beadwave.workflows.fit.parameter import UNIFORM, Parameter, directions, ends, rig_at, scales
from beadwave.workflows.fit.sensed import require_summable, sensed, with_gains

if TYPE_CHECKING:
    from beadwave.workflows.fit.friction_fit import (
        RubbingRun,  # of scenes with friction on a structure alone
    )

NO_FILTER = Filter()


class ChainForward:
    """Model velocities at the times of the signals, as a function of theta (p,) in SI units.

    theta are values of the `parameters`, in their order; `steps` is the time step over the usual
    one of the rig. Raises CouplingError where the record ends before the earliest first touch that
    the bounds allow, and for sensors of forces in a chain on leaf springs.
    """

    def __init__(
        self,
        rig: Rig,
        parameters: Sequence[Parameter],
        signals: Signals,
        filters: Filter = NO_FILTER,
        steps: float = 1.0,
    ) -> None:
        self.rig, self.parameters = rig, tuple(parameters)
        self.signals, self.filters, self.steps = signals, filters, steps
        self.start = np.array([p.start for p in parameters])
        first = rig_at(rig, self.parameters, self.start)
        self.time_scale, self.dt = first.time_scale, steps * first.step  # [s]
        earliest = min([p.low for p in parameters if p.kind == "trigger"], default=rig.trigger)
        self.duration = signals.t[-1] - earliest + 2 * self.dt
        if signals.channels:
            require_summable(rig, signals.channels)
        if self.duration <= 4 * self.dt:
            raise CouplingError("the record ends before the first touch; check the trigger.")

    def velocities(self, theta: np.ndarray, first: int | None = None) -> np.ndarray:
        """(k, m) [m/s] at theta (p,), or only the `first` samples of them."""
        return self._march(theta, False, first)[0]

    def velocities_and_sensitivities(
        self, theta: np.ndarray, first: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """(k, m) [m/s] and their derivatives by theta (k, m, p)."""
        return self._march(theta, True, first)

    @property
    def touch(self) -> float:
        """Time [s] of the first touch that the parameters start from."""
        triggers = [p.start for p in self.parameters if p.kind == "trigger"]
        return triggers[0] if triggers else self.rig.trigger

    def needed(self, windows: np.ndarray) -> int:
        """Samples that a model must have for windows (k, m) of it: a filter without phase looks
        ahead."""
        k = len(windows)
        return k if self.filters.band else k - int(windows.any(axis=1)[::-1].argmax())

    def with_steps(self, steps: float) -> ChainForward:
        """The model with other steps, in usual ones."""
        return ChainForward(self.rig, self.parameters, self.signals, self.filters, steps)

    def with_system(self, system: Rig) -> ChainForward:
        """The model of another rig, whose steps are its own usual ones."""
        return ChainForward(system, self.parameters, self.signals, self.filters, self.steps)

    def of_velocities(self) -> ChainForward:
        """The model with the velocities of the sensors' spheres."""
        signals = self.signals._replace(channels=None)
        return ChainForward(self.rig, self.parameters, signals, self.filters, self.steps)

    def coarser(self, steps: float) -> ChainForward:
        """Larger steps, in usual ones, and fewer samples, for a search."""
        dt = self.signals.t[1] - self.signals.t[0]
        # a search has samples every 0.15 of the stiffest contact's time
        stride = max(1, int(0.15 * self.time_scale / dt))
        thinned = self.signals._replace(t=self.signals.t[::stride], v=self.signals.v[::stride])
        return ChainForward(self.rig, self.parameters, thinned, self.filters, steps)

    def misfits(self, theta: np.ndarray) -> dict[str, float]:
        """rms misfit [m/s] to the signals at theta (p,), by their names."""
        dt = self.signals.t[1] - self.signals.t[0]
        residual = self.velocities(theta) - self.filters.of_data(self.signals.v, dt)
        rms = np.sqrt(np.mean(residual**2, axis=0))
        return dict(zip(self.signals.names, map(float, rms), strict=True))

    def _march(
        self, theta: np.ndarray, sensitivities: bool, first: int | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Velocities (k, m) [m/s] and derivatives (k, m, p), p = 0 without sensitivities.

        The run's clock starts at the first touch, the record's earlier by the trigger: what is
        shown at t is the run at t - trigger, and its state at rest before that.
        """
        t, rig = self.signals.t[:first], rig_at(self.rig, self.parameters, theta)
        channels = self.signals.channels

        # no longer than the samples need, by the one time step of all evaluations
        duration = max(self.duration - (self.signals.t[-1] - t[-1]), 4 * self.dt)
        run = march_with_sensitivities(
            rig.chain,
            rig.wall,
            rig.v0,
            directions(self.rig, self.parameters, theta) if sensitivities else None,
            duration=duration,
            dt=self.dt,
            observed=channels.observed if channels else self.signals.spheres,
        )
        dt = t[1] - t[0]

        # sensors: their signals, scaled to velocities
        if channels:
            free = self.parameters if sensitivities else ()
            at = np.clip(t - rig.trigger, 0.0, duration)
            v, _, dv = sensed(run, rig, channels, free, at)
            v, dv = with_gains(v, dv, channels, self.parameters, theta)
            return self.filters.of_data(v, dt), self.filters.of_data(dv, dt)

        # velocities behind an instrument: finer times for its filter, later by its lag
        lag = rig.trigger + self.filters.lag(dt)
        at = refined(t, self.filters.refinement(dt)) - lag
        v, a, dv = run.at(np.clip(at, 0.0, duration))
        for j, p in enumerate(self.parameters if sensitivities else ()):
            if p.kind == "trigger":  # dv/dt by a later start is -a, nothing before it
                dv[:, :, j] = -np.where((at > 0)[:, None], a, 0.0)
        v = self.filters.of_model(v, dt)
        return v, self.filters.of_model(dv, dt) if sensitivities else dv


def refined(t: np.ndarray, factor: int) -> np.ndarray:
    """Equal times t (k,) [s] and factor - 1 more between any two of them."""
    return t if factor == 1 else np.linspace(t[0], t[-1], factor * (len(t) - 1) + 1)


SHARED, OWN = "shared", "own"  # kinds of numbers: of all records, of each


class MeasuredRecord(NamedTuple):
    """One record: signals y (k, m) of m sensors over equal times t (k,) [s], their noise (m,)."""

    t: NDArray[np.float64]
    y: NDArray[np.float64]
    noise: NDArray[np.float64]  # rms, in the sensors' units
    rounding: NDArray[np.float64] | float = 0.0  # (m,) rms of an instrument's steps, a part of it


class Unknowns(NamedTuple):
    """The numbers sought, and which of them a record takes."""

    parameters: tuple[Parameter, ...]  # (p,)
    of_system: NDArray[np.int64]  # (S, q) of each record, in the order that the system takes them
    trigger: NDArray[np.int64]  # (S,)

    @property
    def scale(self) -> NDArray[np.float64]:
        """(p,) scale of each number: a change that counts as large."""
        return scales(self.parameters)

    def ends(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper bounds (p,)."""
        return ends(self.parameters)

    @property
    def centre(self) -> NDArray[np.float64]:
        """(p,) where numbers are that no record determines: shared ones midway between bounds,
        others where they start."""
        return np.array(
            [0.5 * (p.low + p.high) if p.kind == SHARED else p.start for p in self.parameters]
        )

    @property
    def pull(self) -> NDArray[np.float64]:
        """(p,) one over the standard deviation of a number anywhere between its bounds; 0 of
        triggers."""
        bounded = np.array([p.kind in (SHARED, OWN) for p in self.parameters])
        low, high = self.ends()
        return bounded * np.sqrt(UNIFORM) / (high - low)

    def only(self, shots: Sequence[int]) -> Unknowns:
        """Unknowns of these records alone; the numbers of others stay among the parameters."""
        return self._replace(of_system=self.of_system[shots], trigger=self.trigger[shots])


def unknowns(
    shared: Sequence[Parameter],
    per_record: Sequence[Sequence[Parameter]],
    triggers: Sequence[Parameter],
) -> Unknowns:
    """Of S records: numbers that all share, then those of each record and its trigger."""
    n, q = len(shared), len(per_record[0]) + 1  # q numbers of a record, the trigger last
    parameters = list(shared)
    for of_record, trigger in zip(per_record, triggers, strict=True):
        parameters += [*of_record, trigger]
    first = n + q * np.arange(len(triggers))  # place of each record's first number
    places = first[:, None] + np.arange(q - 1)
    shared_places = np.tile(np.arange(n), (len(first), 1))
    return Unknowns(tuple(parameters), np.hstack([shared_places, places]), first + q - 1)


class StructureForward(NamedTuple):
    """The model of an inspection; `system` takes the values (q,) that a record has."""

    system: Callable[[NDArray[np.float64]], Rig | ChainsRig]
    sensors: tuple[Sensor, ...]
    dt: float  # [s]
    within: Callable[[NDArray[np.float64], NDArray[np.float64]], Callable] | None = None
    difference: float = 1e-5  # step of a difference quotient, in scales

    def narrowed(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> StructureForward:
        """The model with a system made for shared numbers between these ends (n_shared,) alone."""
        return self.with_system(self.within(low, high))

    def with_system(
        self, system: Callable[[NDArray[np.float64]], Rig | ChainsRig]
    ) -> StructureForward:
        """The model of another structure, `system` of the values (q,) of a record."""
        return self._replace(system=system)

    def with_steps(self, factor: float) -> StructureForward:
        """The model with steps so many times as long."""
        return self._replace(dt=factor * self.dt)

    def signals_of_run(
        self, values: NDArray[np.float64], t: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(k, m) of one run with values (q,) at the times t (k,) [s] since its first touch."""
        return self._sensed([self._run(self.system(values), t[-1])], t)[..., 0]

    def signals(
        self, unknowns: Unknowns, theta: NDArray[np.float64], shots: Sequence[MeasuredRecord]
    ) -> NDArray[np.float64]:
        """(S, k, m) at theta (p,), at the samples of the records."""
        runs = self._runs([theta[row] for row in unknowns.of_system], durations(unknowns, shots))
        triggers = theta[unknowns.trigger]
        return np.array(
            [
                self._sensed([run], shot.t - trigger)[..., 0]
                for run, shot, trigger in zip(runs, shots, triggers, strict=True)
            ]
        )

    def jacobian(
        self, unknowns: Unknowns, theta: NDArray[np.float64], shots: Sequence[MeasuredRecord]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Signals (S, k, m) and their derivatives (S, k, m, p) by theta in scales.

        Difference quotients of runs by the same steps of time; the trigger's follow from the time
        derivative of the signals.
        """
        n_shots, q = unknowns.of_system.shape
        step = self.difference_steps(unknowns, theta)

        # q + 1 runs a record: as it is, and with each of its numbers a step further
        values = []
        for numbers in unknowns.of_system:
            moved = np.tile(theta[numbers], (q + 1, 1))
            moved[np.arange(1, q + 1), np.arange(q)] += step[numbers]
            values += list(moved)
        runs = self._runs(values, np.repeat(durations(unknowns, shots), q + 1))

        slopes = np.zeros((n_shots, *shots[0].y.shape, len(theta)))
        signals_at_theta = np.zeros(slopes.shape[:-1])
        for s, shot in enumerate(shots):
            at = shot.t - theta[unknowns.trigger[s]]
            of_shot = runs[s * (q + 1) : (s + 1) * (q + 1)]
            y, numbers = self._sensed(of_shot, at), unknowns.of_system[s]
            signals_at_theta[s] = y[..., 0]
            slopes[s][..., numbers] = (y[..., 1:] - y[..., :1]) / step[numbers]
            slopes[s, ..., unknowns.trigger[s]] = -self._sensed(of_shot[:1], at, order=1)[..., 0]
        return signals_at_theta, slopes * unknowns.scale

    def difference_steps(
        self, unknowns: Unknowns, theta: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(p,) steps of the difference quotients, towards the inside of the bounds."""
        _, high = unknowns.ends()
        step = self.difference * unknowns.scale
        return np.where(theta + step > high, -step, step)

    def _runs(self, values, lengths) -> list[Trajectory | RubbingRun | ChainsRun]:
        """A run with each of the values (q,), as long as its length [s]."""
        systems = [self.system(v) for v in values]
        # below 10 000 steps of all runs together threads would cost more than they save
        if sum(lengths) < 10_000 * self.dt:
            return list(map(self._run, systems, lengths))
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            return list(pool.map(self._run, systems, lengths))

    def _run(self, system: Rig | ChainsRig, duration: float) -> Trajectory | RubbingRun | ChainsRun:
        """A run of whole steps of dt, the last of which may end after the duration [s]."""
        if isinstance(system, ChainsRig):
            return system.march(duration, self.dt)
        if system.across is not None:
            from beadwave.workflows.fit.friction_fit import march_rubbing

            return march_rubbing(system, duration, self.dt)
        n = int(np.ceil(duration / self.dt))
        return march(
            system.chain, system.wall, system.v0, duration=n * self.dt, dt=self.dt, n_save=n
        )

    def _sensed(
        self,
        runs: Sequence[Trajectory | RubbingRun | ChainsRun],
        at: NDArray[np.float64],
        order: int = 0,
    ) -> NDArray[np.float64]:
        """(k, m, len(runs)) signals of runs as long as one another at the times `at` (k,) [s], or
        their time derivatives; outside of the runs signals stand still."""
        t = runs[0].t
        quantities = [
            measured_in_runs(
                self.sensors, getattr(run, "rows", (run,)), getattr(run, "structure", None)
            )
            for run in runs
        ]
        inside = np.clip(at, 0.0, t[-1])
        y = signals(self.sensors, t, np.stack(quantities, axis=-1), inside, order)
        if order:
            y[inside != at] = 0.0
        return y


def durations(unknowns: Unknowns, shots: Sequence[MeasuredRecord]) -> NDArray[np.float64]:
    """(S,) [s] that a run must last, whatever its trigger is found to be: from the earliest one
    that its bounds allow. Raises CouplingError where a record ends before that."""
    earliest = np.array([unknowns.parameters[i].low for i in unknowns.trigger])
    lengths = np.array([shot.t[-1] for shot in shots]) - earliest
    if (lengths <= 0.0).any():
        raise CouplingError("a record ends before the first touch; check its trigger.")
    return lengths
