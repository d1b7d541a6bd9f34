"""The model of a calibration: velocities of the observed spheres as the instrument shows them."""

from collections.abc import Sequence

import numpy as np

from coupling.errors import CouplingError
from dem.sensitivities import STEPS_PER_TIME_SCALE, march_with_sensitivities, usual_step
from workflows.fit.core.calibration.parameters import Parameter, Rig, directions, rig_at
from workflows.fit.core.calibration.sensed import require_summable, sensed, with_gains
from workflows.fit.core.calibration.signals import Filter, Signals

NO_FILTER = Filter()
SEARCH_SAMPLING = 0.15  # time between samples of a search, over that of the stiffest contact


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

    def with_steps(self, steps: float) -> "ChainForward":
        """The same model with other steps, in usual ones."""
        return ChainForward(self.rig, self.parameters, self.signals, self.filters, steps)

    def with_system(self, system: Rig) -> "ChainForward":
        """The same model of another rig, whose steps are its own usual ones."""
        return ChainForward(system, self.parameters, self.signals, self.filters, self.steps)

    def of_velocities(self) -> "ChainForward":
        """The same model with the velocities of the sensors' spheres."""
        signals = self.signals._replace(channels=None)
        return ChainForward(self.rig, self.parameters, signals, self.filters, self.steps)

    def coarser(self, steps: float) -> "ChainForward":
        """Larger steps, in usual ones, and fewer samples, for a search."""
        dt = self.signals.t[1] - self.signals.t[0]
        stride = max(1, int(SEARCH_SAMPLING * self.time_scale / dt))
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
        """Velocities (k, m) [m/s] and derivatives (k, m, p), p = 0 without sensitivities."""
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
