"""Modes of a wall whose frequency and damping follow their amplitude, linear at one of them.

Friction between faces under bolts softens a mode and takes energy from it, the more the larger its
amplitude. A march takes each mode linear, with the frequency and the loss factor that its backbone
has at the largest modal amplitude of the run,

    a_j = max over t of sqrt(q_j^2 + (q_j' / omega_j)^2),    zeta_j = zeta_j0 + eta_j(a_j) / 2,

marched again until these amplitudes stay. M. Krack, M. Salles, F. Thouverez, Arch. Comput. Methods
Eng. 24 (2017) 589, for vibration with one amplitude.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from beadwave.coupling.coupled_wall import CoupledWall
from beadwave.dem import Trajectory, Wall

SAME_MODE = 0.01  # of a frequency, within which a wall's mode is that of a backbone
SETTLED = 0.01  # change of a modal amplitude over itself, from which on no march is needed
MAX_MARCHES = 8  # which took 2 to 4
# instants of the driven modes between two of a run, 1 us apart: 4 and 8 differ by 7e-6 of an
# acceleration by modes of 300 Hz to 17 kHz
FINER = 4
CRITICAL = 1e-7  # distance from critical damping, where the two roots are one


class Backbone(NamedTuple):
    """Frequency and loss factor of a mode at k amplitudes that rise."""

    number: int  # of the mode, from 1 on
    linear_hz: float
    largest: float  # [kg^-1/2] displacement of the point that moves most, mass-normalised
    displacement: NDArray[np.float64]  # (k,) [m] of that point
    frequency_hz: NDArray[np.float64]  # (k,)
    loss_factor: NDArray[np.float64]  # (k,)

    def at(self, displacement: float) -> "ModeAtAmplitude":
        """The mode at an amplitude [m]. Below the first one its loss factor falls with it, and
        nothing changes without any; beyond the last one the last one's are taken."""
        x = np.append(0.0, self.displacement)
        factor = np.append(1.0, self.frequency_hz / self.linear_hz)
        loss = np.append(0.0, self.loss_factor)
        return ModeAtAmplitude(
            self.number,
            self.linear_hz,
            displacement,
            float(np.interp(displacement, x, factor)),
            float(np.interp(displacement, x, loss)) / 2,
            bool(displacement > x[-1]),
        )


class ModeAtAmplitude(NamedTuple):
    """Frequency and damping of a mode at an amplitude."""

    number: int
    linear_hz: float
    displacement: float  # [m] of the point that moves most
    factor: float  # of the frequency
    ratio: float  # damping ratio of friction
    beyond: bool  # more than the backbone's last amplitude


def of_wall(omega: NDArray[np.float64], mode: ModeAtAmplitude | Backbone) -> int | None:
    """Number of a mode among those of a wall omega (n,) [rad/s]; None where it is not there."""
    if not len(omega):
        return None
    nearest = int(np.argmin(np.abs(omega / (2 * np.pi * mode.linear_hz) - 1)))
    off = abs(omega[nearest] / (2 * np.pi * mode.linear_hz) - 1)
    return nearest if off < SAME_MODE else None


def moved(wall: Wall | CoupledWall, modes: Sequence[ModeAtAmplitude]) -> Wall | CoupledWall:
    """A wall whose modes have frequency and damping of their amplitudes."""
    omega = wall.omega.copy()
    added = np.zeros(len(omega))
    for mode in modes:
        if (j := of_wall(wall.omega, mode)) is not None:
            omega[j], added[j] = omega[j] * mode.factor, mode.ratio
    if isinstance(wall, CoupledWall):
        return wall._replace(omega=omega, D=wall.D + np.diag(2 * added * omega))
    return wall._replace(omega=omega, zeta=wall.zeta + added)


def amplitudes(wall: Wall | CoupledWall, run: Trajectory) -> tuple[NDArray, NDArray]:
    """Modal amplitudes (n,) [kg^1/2 m] of a wall in a run: the largest, and those at its end; the
    contact force drives them from the state at the start."""
    if isinstance(wall, CoupledWall):  # its modes damp each other, of which each has its own here
        zeta = np.diag(wall.D) / (2 * np.where(wall.omega > 0, wall.omega, np.inf))
        wall = Wall(wall.omega, zeta, wall.force, 0.0, 0.0)
    alone = wall._replace(phi=wall.phi[:, None])
    q, p = driven_modes(alone, run.t, run.contact_force[:, -1:])
    envelope = np.hypot(q, p / np.where(wall.omega > 0, wall.omega, np.inf))
    return envelope.max(axis=0), envelope[-1]


class SettledRun(NamedTuple):
    """The modes at the amplitudes of a run."""

    largest: tuple[ModeAtAmplitude, ...]  # at the largest amplitude, which the run has been given
    at_end: tuple[ModeAtAmplitude, ...]
    n_marches: int
    change: float  # of the largest amplitudes in the last march, relative, the largest one


def settled(
    backbones: Sequence[Backbone],
    wall: Wall | CoupledWall,
    march: Callable[[Wall | CoupledWall], Trajectory],
) -> SettledRun:
    """The amplitudes of a wall's modes in a march before it, with frequency and damping of these
    amplitudes; modes that the wall has not are left out."""
    known = [(b, j) for b in backbones if (j := of_wall(wall.omega, b)) is not None]
    largest, change = [b.at(0.0) for b, _ in known], np.inf
    for n_marches in range(1, MAX_MARCHES + 1):  # noqa: B007  their number is a result
        now = moved(wall, largest)
        most, end = amplitudes(now, march(now))
        before = np.array([mode.displacement for mode in largest])
        x = np.array([b.largest * most[j] for b, j in known])
        largest = [b.at(one) for (b, _), one in zip(known, x.tolist(), strict=True)]
        change = float(np.max(np.abs(x - before) / np.maximum(x, 1e-300), initial=0.0))
        if change < SETTLED:
            break
    at_end = [b.at(float(b.largest * end[j])) for b, j in known]
    return SettledRun(tuple(largest), tuple(at_end), n_marches, change)


def driven_modes(
    wall: Wall, t: NDArray[np.float64], force: NDArray[np.float64], *, finer: int = FINER
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """q [kg^1/2 m] and q' (k, n) of the modes of a wall from rest under forces (k, p) [N] at equal
    times t (k,) [s], less those at t[0]; phi of the wall is (n, p) here.

    The push on a mode is taken linear between `finer` instants from one time to the next, and each
    mode is advanced exactly (Nigam and Jennings, Bull. Seismol. Soc. Am. 59 (1969) 909):

        q = (z_1 - z_2) / (lambda_1 - lambda_2),   z_i' = lambda_i z_i + phi F,
        lambda_i = -zeta omega +- i omega sqrt(1 - zeta^2).
    """
    from scipy.signal import lfilter

    n = finer * (len(t) - 1)
    h = (t[-1] - t[0]) / n
    pushes = CubicSpline(t, force - force[0])(t[0] + h * np.arange(n + 1)) @ wall.phi.T

    # over a step the push F on a mode is linear: z(h) = E z(0) + F_0 (E - 1) / lambda + the slope's
    # part
    q, p = np.zeros((2, n // finer + 1, len(wall.omega)))
    for j, (w, ratio, F) in enumerate(zip(wall.omega, wall.zeta, pushes.T, strict=True)):
        if w == 0.0:
            p_fine = np.append(0.0, np.cumsum(h / 2 * (F[1:] + F[:-1])))
            q_fine = np.cumsum(h * p_fine[:-1] + h**2 * (F[:-1] / 3 + F[1:] / 6))
            q[:, j], p[:, j] = np.append(0.0, q_fine)[::finer], p_fine[::finer]
            continue
        ratio = ratio if abs(ratio - 1.0) > CRITICAL else 1.0 - CRITICAL
        swing = 1j * w * np.sqrt(1.0 - ratio**2 + 0j)
        lambdas = -ratio * w + swing, -ratio * w - swing
        z = []
        for rate in lambdas:
            whole = np.expm1(rate * h) / rate
            rise = (whole / h - 1.0) / rate
            driven = np.append(0.0, whole * F[:-1] + rise * np.diff(F))
            z.append(lfilter([1.0], [1.0, -np.exp(rate * h)], driven)[::finer])
        q[:, j] = ((z[0] - z[1]) / (2 * swing)).real
        p[:, j] = ((lambdas[0] * z[0] - lambdas[1] * z[1]) / (2 * swing)).real
    return q, p
