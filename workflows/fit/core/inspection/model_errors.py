"""The bars of an inspection with the errors of its model that are known."""

from collections.abc import Mapping, Sequence

import numpy as np

from workflows.fit.core import model_errors
from workflows.fit.core.calibration.parameters import scales
from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.inversion import Inversion, residual_parts
from workflows.fit.core.model_errors import BetterModel


def widened(
    fit: RecordFit, inversion: Inversion, models: Mapping[str, Sequence[BetterModel]]
) -> Inversion:
    """The same with bars that hold the model errors, with the part of each cause in every bar, and
    with what the errors leave of the records at the best numbers.

    `models` are those that are better in what a cause names; smaller steps of time are added here.
    The model is fitted to what each of them shows at the best numbers: where numbers move along a
    valley of the misfit, derivatives at its end told a sixth of it. Raises what a system raises for
    values that cannot be marched.
    """
    scale, n = scales(inversion.parameters), len(fit.unknowns.parameters)
    theta = inversion.value[:n]

    def signals(forward):
        """(S, k, m) by the gains that were found."""
        return inversion.gains * forward.signals(fit.unknowns, theta, fit.shots)

    by_cause = model_errors.changes(fit.forward, inversion.model, signals, models)
    biases, squares = {}, np.zeros_like(inversion.model)
    for cause, changes in by_cause.items():
        biases[cause] = np.zeros((len(scale), len(changes)))
        for i, (change, share) in enumerate(changes):
            shots = tuple(
                shot._replace(y=y)
                for shot, y in zip(fit.shots, inversion.model + change, strict=True)
            )
            moved_fit = fit._replace(shots=shots)
            moved = moved_fit.solved(theta, about=theta).point
            of_model = fit.forward.signals(fit.unknowns, moved, fit.shots)
            biases[cause][:n, i] = share * (moved - theta) / scale[:n]
            # gains follow the numbers, in the order of their sensors
            gains = moved_fit.gains(of_model) - inversion.gains
            for g in range(len(scale) - n):
                biases[cause][n + g, i] = share * gains[fit.gain == g][0] / scale[n + g]
            squares += (share * moved_fit.off(of_model)) ** 2

    result = model_errors.widened(inversion.uncertainty, scale, biases)
    beyond = residual_parts(fit, np.sqrt(squares))
    return inversion._replace(uncertainty=result.uncertainty, causes=result.causes, beyond=beyond)
