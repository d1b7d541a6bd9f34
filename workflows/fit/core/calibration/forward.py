"""The model of a calibration: velocities of the observed spheres as the instrument shows them."""

from collections.abc import Sequence

import numpy as np

from coupling.errors import CouplingError
from dem.sensitivities import STEPS_PER_TIME_SCALE, march_with_sensitivities, usual_step
from workflows.fit.core.calibration.parameters import Parameter, Rig, directions, rig_at
from workflows.fit.core.calibration.sensed import require_summable, sensed, with_gains
from workflows.fit.core.calibration.signals import Filter, Signals

NO_FILTER = Filter()
SEARCHED = 0.15  # time between the samples of a search, in time scales of the stiffest contact


class ChainForward:
    """Model velocities at the times of the signals, as a function of theta (p,)."""

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
        usual = usual_step(first.chain, first.wall, first.v0)
        self.time_scale = STEPS_PER_TIME_SCALE * usual  # [s]
        self.dt = steps * usual
        earliest = min([p.low for p in parameters if p.kind == "trigger"], default=rig.trigger)
        self.duration = signals.t[-1] - earliest + 2 * self.dt
        if signals.channels:
            require_summable(rig, signals.channels)
        if self.duration <= 4 * self.dt:
            raise CouplingError("the record ends before the first touch; check the trigger.")

    def velocities(self, theta: np.ndarray, first: int | None = None) -> np.ndarray:
        """(k, m) [m/s], or only the first samples of them."""
        return self._seen(theta, False, first)[0]

    def velocities_and_sensitivities(
        self, theta: np.ndarray, first: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """(k, m) and their derivatives (k, m, p)."""
        return self._seen(theta, True, first)

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

    def with_steps(self, steps: float) -> "ChainForward":
        """The same model with other steps, in usual ones."""
        return ChainForward(self.rig, self.parameters, self.signals, self.filters, steps)

    def of_velocities(self) -> "ChainForward":
        """The same model with the velocities of the sensors' spheres."""
        signals = self.signals._replace(channels=None)
        return ChainForward(self.rig, self.parameters, signals, self.filters, self.steps)

    def coarser(self, steps: float) -> "ChainForward":
        """Larger steps, in usual ones, and fewer samples, for a search."""
        signals, every = self.signals, self._every()
        thinned = signals._replace(t=signals.t[::every], v=signals.v[::every])
        return ChainForward(self.rig, self.parameters, thinned, self.filters, steps)

    def _every(self) -> int:
        dt = self.signals.t[1] - self.signals.t[0]
        return max(1, int(SEARCHED * self.time_scale / dt))

    def _seen(
        self, theta: np.ndarray, sensitivities: bool, first: int | None
    ) -> tuple[np.ndarray, np.ndarray]:
        t, rig = self.signals.t[:first], rig_at(self.rig, self.parameters, theta)
        channels = self.signals.channels
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
        if channels:
            free = self.parameters if sensitivities else ()
            at = np.clip(t - rig.trigger, 0.0, duration)
            v, _, dv = sensed(run, rig, channels, free, at)
            v, dv = with_gains(v, dv, channels, self.parameters, theta)
            return self.filters.of_data(v, dt), self.filters.of_data(dv, dt)
        late = rig.trigger + self.filters.lag(dt)
        when = _refined(t, self.filters.refinement(dt)) - late
        v, a, dv = run.at(np.clip(when, 0.0, duration))
        for j, p in enumerate(self.parameters if sensitivities else ()):
            if p.kind == "trigger":
                dv[:, :, j] = -np.where((when > 0)[:, None], a, 0.0)
        seen = self.filters.of_model(v, dt)
        return seen, self.filters.of_model(dv, dt) if sensitivities else dv

    def misfits(self, theta: np.ndarray) -> dict[str, float]:
        """rms misfit [m/s] to the signals at theta (p,), by their names."""
        dt = self.signals.t[1] - self.signals.t[0]
        off = self.velocities(theta) - self.filters.of_data(self.signals.v, dt)
        rms = np.sqrt(np.mean(off**2, axis=0))
        return dict(zip(self.signals.names, map(float, rms), strict=True))


def _refined(t: np.ndarray, fine: int) -> np.ndarray:
    return t if fine == 1 else np.linspace(t[0], t[-1], fine * (len(t) - 1) + 1)
