"""What sensors show of several impacts on one structure, and its derivatives by any numbers.

    y_s(t) = g signal(t - trigger_s; shared, own_s),   s = 1..S records

Each record is a run of its own: the numbers of the structure are shared, a striker's velocity and
the trigger are a record's own. The run is marched by steps of one length, so that differences of
two runs are smooth in the numbers; chains of one evaluation are dealt to the threads.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.errors import CouplingError
from coupling.sensors import Sensor, measured, signals
from dem import Chain, Trajectory, Wall, march
from workflows.fit.core.calibration.parameters import Parameter, ends, scales
from workflows.fit.core.inspection.information import UNIFORM

SHARED, OWN = "shared", "own"  # kinds of numbers: of all records, of each
DIFFERENCE = 1e-5  # step of a difference quotient, in scales
FEW_STEPS = 10_000  # of all runs together: below, threads would cost more than they save


class System(NamedTuple):
    """What is marched: chain, wall, velocities (n,) [m/s] before the impact."""

    chain: Chain
    wall: Wall | None
    v0: NDArray[np.float64]


class Shot(NamedTuple):
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

    def only(self, shots: Sequence[int]) -> "Unknowns":
        """The same of these records alone; the numbers of others stay among the parameters."""
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

    system: Callable[[NDArray[np.float64]], System]
    sensors: tuple[Sensor, ...]
    dt: float  # [s]
    within: Callable[[NDArray[np.float64], NDArray[np.float64]], Callable] | None = None

    def narrowed(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> "StructureForward":
        """The same with a system made for shared numbers between these ends, and no others."""
        return self.with_system(self.within(low, high))

    def with_system(self, system: Callable[[NDArray[np.float64]], System]) -> "StructureForward":
        """The same of another structure."""
        return self._replace(system=system)

    def with_steps(self, factor: float) -> "StructureForward":
        """The same with steps so many times as long."""
        return self._replace(dt=factor * self.dt)

    def signals_of_run(
        self, values: NDArray[np.float64], t: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(k, m) of one run with values (q,) at the times t (k,) [s] since its first touch."""
        return self._sensed([self._run(self.system(values), t[-1])], t)[..., 0]

    def signals(
        self, unknowns: Unknowns, theta: NDArray[np.float64], shots: Sequence[Shot]
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
        self, unknowns: Unknowns, theta: NDArray[np.float64], shots: Sequence[Shot]
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
        step = DIFFERENCE * unknowns.scale
        return np.where(theta + step > high, -step, step)

    def _runs(self, values, lengths) -> list[Trajectory]:
        systems = [self.system(v) for v in values]
        if sum(lengths) < FEW_STEPS * self.dt:
            return list(map(self._run, systems, lengths))
        with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
            return list(pool.map(self._run, systems, lengths))

    def _run(self, system: System, duration: float) -> Trajectory:
        n = int(np.ceil(duration / self.dt))
        return march(*system, duration=n * self.dt, dt=self.dt, n_save=n)

    def _sensed(
        self, runs: Sequence[Trajectory], at: NDArray[np.float64], order: int = 0
    ) -> NDArray[np.float64]:
        """(k, m, len(runs)) signals of runs as long as one another at the times `at` (k,) [s], or
        their time derivatives; outside of the runs signals stand still."""
        t = runs[0].t
        quantities = [measured(self.sensors, t, run.x, run.v, run.contact_force) for run in runs]
        inside = np.clip(at, 0.0, t[-1])
        y = signals(self.sensors, t, np.stack(quantities, axis=-1), inside, order)
        if order:
            y[inside != at] = 0.0
        return y


def durations(unknowns: Unknowns, shots: Sequence[Shot]) -> NDArray[np.float64]:
    """(S,) [s] that a run must last, whatever its trigger is found to be."""
    earliest = np.array([unknowns.parameters[i].low for i in unknowns.trigger])
    lengths = np.array([shot.t[-1] for shot in shots]) - earliest
    if (lengths <= 0.0).any():
        raise CouplingError("a record ends before the first touch; check its trigger.")
    return lengths
