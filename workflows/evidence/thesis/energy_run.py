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

    @property
    def missing(self) -> float:
        """Largest gap of the ledger without the wall's part."""
        return float((1 - self.without_wall).max())

    @property
    def growth(self) -> float:
        """Rms velocity of the wall in the last third of the time after the first touch over that in
        the first."""
        v = self.trajectory.wall_v[self.trajectory.contact_force[:, -1].argmax() :]
        first, _, last = (np.sqrt(np.mean(part**2)) for part in np.array_split(v, 3))
        return float(last / first)

    def change(self, energy: NDArray[np.float64]) -> float:
        """Largest change of a part of the ledger (k,) over the striker's energy."""
        return float(np.abs(energy - energy[0]).max() / self.trajectory.energy_kinetic[0])
