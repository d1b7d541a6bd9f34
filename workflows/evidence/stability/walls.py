"""Extreme walls: fast modes, light and heavy ones, damping beyond critical, dashpots."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.harness import Outcome, Trial
from beadwave.workflows.evidence.stability.chains import SPEED, N, spheres_of, striker_velocity
from beadwave.workflows.evidence.stability.trials import settled


def wall_mode_frequency() -> Iterator[Trial]:
    """A mode of ever higher frequency beside one at 1 kHz."""
    for frequency in (1e2, 1e3, 1e4, 1e5, 1e6, 1e7):
        for kind, phi in (("light", 0.3), ("stiff", 0.3 * frequency / 1e4)):
            wall = _modes([1e3, frequency], [0.3, phi])
            yield Trial(f"{frequency:g} Hz {kind}", _struck(wall))
    wall = _modes(np.geomspace(50.0, 1e7, 150), np.full(150, 0.3))
    yield Trial("150 modes, 50 Hz to 10 MHz", _struck(wall))


def one_dof_wall() -> Iterator[Trial]:
    """0.1 Hz to 1 MHz, a millionth to a million times a sphere's mass."""
    mass = spheres_of().mass[0]
    for frequency in (0.1, 10.0, 1e3, 1e5, 1e6):
        for ratio in (1e-6, 1e-3, 1.0, 1e3, 1e6):
            wall = dem.one_dof_wall(frequency, ratio * mass)
            yield Trial(f"{frequency:g} Hz, mass x {ratio:g}", _struck(wall))


def wall_damping() -> Iterator[Trial]:
    """Damping ratios of three modes, to far above critical."""
    for zeta in (0.0, 0.1, 1.0, 10.0, 1e3, 1e6):
        wall = _modes([50.0, 1e3, 1e5], np.full(3, 0.3), zeta)
        yield Trial(zeta, _struck(wall))


def dashpot_wall() -> Iterator[Trial]:
    """Coefficients from that of air to that of rock [N s/m]."""
    arriving = np.full(N, SPEED)  # all spheres together
    for coefficient in (1e-6, 1e-2, 1e2, 1e4, 1e6, 1e9):
        run = _struck(dem.dashpot_wall(coefficient), arriving)
        yield Trial(coefficient, run, "N s/m")


def _modes(frequency, phi, zeta: float = 0.0) -> dem.Wall:
    """A wall of modes at frequencies [Hz], of participations phi [kg^-1/2]."""
    omega = 2 * np.pi * np.asarray(frequency, float)
    return dem.Wall(omega, np.full(omega.size, zeta), np.asarray(phi, float))


def _struck(wall: dem.Wall, v0: np.ndarray | None = None) -> Callable[[], Outcome]:
    """The rig's spheres at a wall for 1 ms, with only the striker moving unless v0 (N,) is
    given."""
    v0 = striker_velocity() if v0 is None else v0
    return partial(settled, spheres_of(), wall, v0, 1e-3)
