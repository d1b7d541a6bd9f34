"""Damping ratios of modes from loss factors of parts, by their shares of the strain, and back.

    zeta_i = 1/2 sum_j eta_j U_ij / U_i

with U_ij the strain energy of part j (a material, the springs of a joint) in the undamped mode i,
U_i that of the mode. It holds for small damping, to first order: the shape is that without damping
(E. E. Ungar, E. M. Kerwin, J. Acoust. Soc. Am. 34 (1962) 954; C. D. Johnson, D. A. Kienholz, AIAA
J. 20 (1982) 1284). Loss factors are not negative: least squares with bounds (Lawson and Hanson).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from beadwave.fem.assembly.model import Model
from beadwave.fem.modes.mac import RIGID, spring_forms
from beadwave.fem.modes.modes import Modes

PRIOR_DEVIATION = 0.3  # deviation of a loss factor before the test: rubber has some 0.3
SIGNIFICANT_DEVIATIONS = 2.0  # deviations from 0, beyond which a value is one
ASSUMED_RATIO_DEVIATION = 0.1  # relative deviation of a ratio that comes without
MIN_ENERGY_SHARE = 1e-3  # of a mode's strain energy, below which in all modes a part has no say


class LossFactors(NamedTuple):
    """Loss factors of n parts, and the damping ratios (m,) that they give."""

    value: NDArray[np.float64]  # (n,) >= 0
    deviation: NDArray[np.float64]  # (n,)
    is_value: NDArray[np.bool_]  # (n,) significant; of others 2 deviations above are a bound
    zeta: NDArray[np.float64]  # (m,) fitted
    scatter: float  # rms of (fitted - measured) / deviation, over what is free


def strain_shares(
    model: Model, modes: Modes, material: Mapping[str, str]
) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    """Names (n,) of materials, joints and springs between points, "materials.steel" or
    "joints.bolts", and their shares (k, n) of the strain energy of each mode; those of a rigid
    motion are 0. `material` names that of each body."""
    shares: dict[str, NDArray[np.float64]] = {}
    elastic = modes.omega > RIGID * modes.omega.max()
    total = np.where(elastic, modes.omega**2, np.inf)  # twice the energy of a mode of unit mass

    def add(name: str, energy: NDArray[np.float64]) -> None:
        """Twice the energies (k,) [rad^2/s^2] of a part to those of the same name."""
        shares[name] = shares.get(name, 0.0) + energy / total

    structure = model.structure
    for body in structure.basis:
        dofs = structure.dofs(body)
        u, K = model.T[dofs] @ modes.phi, structure.K[dofs][:, dofs]
        add(f"materials.{material[body]}", np.sum(u * (K @ u), axis=0))
    for spring, dof, k in zip(model.spring, model.elongation, model.stiffness, strict=True):
        add(f"joints.{spring.rpartition('.')[0]}", k * modes.phi[dof] ** 2)
    for name, form in spring_forms(model, modes.phi).items():
        spring = name.partition(":")[2].rpartition(".")[0]
        add(f"springs.{spring}", np.diag(form.K).copy())
    return tuple(shares), np.array([*shares.values()]).reshape(len(shares), -1).T


def damping_ratios_of(
    shares: NDArray[np.float64], loss: Sequence[float] | NDArray[np.float64]
) -> NDArray[np.float64]:
    """zeta (k,) of modes with these shares (k, n), from the loss factors (n,) of the parts."""
    return 0.5 * shares @ np.asarray(loss, float)


def loss_factors(
    shares: NDArray[np.float64],
    zeta: NDArray[np.float64],
    deviation: NDArray[np.float64],
) -> LossFactors:
    """Loss factors (n,) that give modes with these shares (m, n) their measured damping ratios
    (m,), which have standard deviations (m,).

    Where the ratios scatter about the fit by more than their deviations, as they do where damping
    is not a matter of strain alone, the bars are those of the scatter. A prior, a loss factor of 0
    with the deviation `prior`, bounds the bars and leaves the values as they are: a part that no
    mode strains has that bar and not an infinite one.
    """
    # least squares with no negative value; values at 0 are no free parameters of the scatter
    A, b = 0.5 * shares / deviation[:, None], zeta / deviation
    value, _ = nnls(A, b)
    active = value > 0
    spare = len(b) - np.count_nonzero(active)
    residual = A @ value - b
    scatter = np.sqrt(residual @ residual / spare) if spare > 0 else 0.0
    widened = max(scatter, 1.0)
    covariance = np.linalg.inv(A.T @ A / widened**2 + np.eye(len(value)) / PRIOR_DEVIATION**2)
    bars = np.sqrt(np.diag(covariance))
    return LossFactors(
        value,
        bars,
        value > SIGNIFICANT_DEVIATIONS * bars,
        damping_ratios_of(shares, value),
        scatter,
    )
