"""The lowest modes of an assembly, enough to contain its targets, and which modes these are."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.assembly.constraints import Overconstrained
from beadwave.fem.assembly.model import Model
from beadwave.fem.modes.mac import RIGID, Target, effective_mass, pair
from beadwave.fem.modes.mode_field import ModeField
from beadwave.fem.modes.modes import Modes, modes, require_accurate

N_MODES = (30, 80)  # the second number if the first modes do not contain all targets
SHOWN = 12  # modes that are shown without targets


class AssemblyModes(NamedTuple):
    """Modes of the joined assembly, and which of them are the targets."""

    omega: NDArray[np.float64]  # (k,) [rad/s]
    phi: NDArray[np.float64]  # (n, k) mass-normalised
    index: NDArray[np.int64]  # (n_targets,) -1 where none fits
    score: NDArray[np.float64]  # (n_targets,)
    n_dofs: int
    effective_mass: NDArray[np.float64]  # (k, 3) share of the mass along x, y, z
    field: ModeField  # all up to the highest target, or the lowest ones where there are none
    load_factor: float | None = None  # static load over that which buckles it; None where unloaded
    overconstrained: tuple[Overconstrained, ...] = ()  # dofs that two constraints would hold

    @property
    def paired_hz(self) -> dict[str, float]:
        """Frequencies [Hz] of the targets that were found, by their number from "1" on."""
        hz = self.omega / (2 * np.pi)
        return {str(i + 1): float(hz[j]) for i, j in enumerate(self.index) if j >= 0}


def assembly_modes(
    model: Model,
    targets: Sequence[Target],
    known: Modes | None = None,
) -> AssemblyModes:
    """The lowest modes, the targets among them: N_MODES[0] of them, N_MODES[1] where a target is
    not among the first. A target that is in neither has the index -1.

    `known` are the lowest modes, at least `N_MODES[0]` of them, where they are there already.
    Raises ValueError for modes that are lost in the rounding of K.
    """
    if known is not None:
        require_accurate(known, model.K, model.M, 0.0)

    # first few modes, then more if targets are missing
    for n_modes in N_MODES:
        n = min(n_modes, model.K.shape[0] - 2)
        if known is None:
            solution = modes(model.K, model.M, n)
        else:
            solution = Modes(known.omega[:n], known.phi[:, :n])
        paired = pair(model, solution, targets)
        if np.all(paired.index >= 0):
            break

    # shown are all up to the highest target, or the lowest elastic ones
    last = paired.index.max(initial=-1) + 1
    elastic = np.flatnonzero(solution.omega > RIGID * solution.omega.max())
    index = np.arange(last) if last else elastic[:SHOWN]
    target = np.zeros(len(solution.omega), dtype=int)
    target[paired.index[paired.index >= 0]] = np.flatnonzero(paired.index >= 0) + 1

    field = field_of(model, solution, index, target[index])
    return AssemblyModes(
        solution.omega,
        solution.phi,
        paired.index,
        paired.score,
        model.M.shape[0],
        effective_mass(model, solution.phi),
        field,
        load_factor=model.load_factor,
        overconstrained=model.overconstrained,
    )


def field_of(
    model: Model, modes: Modes, index: NDArray[np.int64], target: NDArray[np.int64]
) -> ModeField:
    """The modes at positions `index` (k,) at the vertices of the bodies, in single precision, for
    pictures; `target` (k,) as that of `ModeField`."""
    structure = model.structure
    u = (model.T @ modes.phi[:, index]).astype(np.float32)
    corners = [structure.first[body] + b.nodal_dofs.T for body, b in structure.basis.items()]
    return ModeField(
        {body: basis.mesh for body, basis in structure.basis.items()},
        index + 1,
        modes.omega[index] / (2.0 * np.pi),
        np.moveaxis(u[np.concatenate(corners)], 2, 0),
        target,
    )
