"""A coupled run by its energy: the ledger over the striker's, with and without the wall's part."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupling.coupled_march import EnergyGain
from dem import Trajectory


class EnergyRun(NamedTuple):
    """A coupled run and what it made of energy."""

    name: str
    trajectory: Trajectory
    gain: EnergyGain

    @property
    def milliseconds(self) -> NDArray[np.float64]:
        return 1e3 * self.trajectory.t

    @property
    def total(self) -> NDArray[np.float64]:
        """The whole ledger over the striker's energy, 1 at the start (k,)."""
        return self._share(self.trajectory.energy_total)

    @property
    def without_wall(self) -> NDArray[np.float64]:
        """The ledger without the wall's part over the striker's energy, 1 at the start (k,)."""
        run = self.trajectory
        wall = run.energy_wall + run.energy_residual + run.dissipated_wall
        return self._share(run.energy_total - wall)

    def _share(self, energy: NDArray[np.float64]) -> NDArray[np.float64]:
        return 1 + (energy - energy[0]) / self.trajectory.energy_kinetic[0]
