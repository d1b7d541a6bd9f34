"""What the known errors of a model do to numbers that are found with it.

A model that is better in one respect (finer elements, more modes, another theory) shows signals
f + d; records that are like it move the numbers of least squares, to first order, by

    b = (J^T J + B)^-1 J^T d,

J and d over the noise, B the information of the bounds. Nobody knows whether the better model is
right, so b counts as a bound of a bias: it joins the bars in quadrature, along its direction.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.fit.core.calibration.uncertainty import combinations
from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.forward import System
from workflows.fit.core.inspection.information import bounds_information
from workflows.fit.core.inspection.inversion import Inversion, residual_parts, scales

NOISE = "noise"


class BetterModel(NamedTuple):
    """A model beside the one of a fit, and how much of their difference counts as its error."""

    system: Callable[[NDArray[np.float64]], System]
    share: float


def widened(
    fit: RecordFit, inversion: Inversion, models: Mapping[str, Sequence[BetterModel]]
) -> Inversion:
    """The same with bars that hold the model errors, with the part of each cause in every bar, and
    with what the errors leave of the records at the best numbers.

    `models` are those that are better in what a cause names. Raises what the system raises for
    values that cannot be marched.
    """
    bars, scale = inversion.uncertainty, scales(inversion.parameters)
    theta = inversion.value[: len(fit.unknowns.parameters)]
    J = inversion.slopes.reshape(-1, inversion.slopes.shape[-1])
    H = J.T @ J + bounds_information(inversion.parameters)
    projection = np.linalg.pinv(H, hermitian=True) @ J.T

    causes, covariance = {NOISE: bars.two_sigma}, bars.covariance.copy()
    squares = np.zeros_like(inversion.model)
    for cause, better in models.items():
        b = np.zeros((len(better), len(scale)))
        for i, model in enumerate(better):
            forward = fit.forward._replace(system=model.system)
            signals = inversion.gains * forward.signals(fit.unknowns, theta, fit.shots)
            d = model.share * ((signals - inversion.model) * fit.weight).ravel()
            moved = projection @ d
            b[i] = moved * scale
            squares += ((d - J @ moved) ** 2).reshape(squares.shape)
        causes[cause] = np.linalg.norm(b, axis=0)
        covariance += b.T @ b / 4.0

    in_scales = covariance / np.outer(scale, scale)
    uncertainty = bars._replace(
        covariance=covariance,
        two_sigma=np.sqrt(sum(part**2 for part in causes.values())),
        combinations=combinations(in_scales, in_scales[:0], np.ones(len(scale), bool)),
    )
    beyond = residual_parts(fit, np.sqrt(squares)) if models else ()
    return inversion._replace(uncertainty=uncertainty, causes=causes, beyond=beyond)
