"""The bars of an inspection with the errors of its model that are known."""

from collections.abc import Mapping, Sequence

from workflows.fit.core import model_errors
from workflows.fit.core.inspection.fitting import RecordFit
from workflows.fit.core.inspection.information import bounds_information
from workflows.fit.core.inspection.inversion import Inversion, residual_parts, scales
from workflows.fit.core.model_errors import TIME, TIME_SHARE, BetterModel


def widened(
    fit: RecordFit, inversion: Inversion, models: Mapping[str, Sequence[BetterModel]]
) -> Inversion:
    """The same with bars that hold the model errors, with the part of each cause in every bar, and
    with what the errors leave of the records at the best numbers.

    `models` are those that are better in what a cause names; smaller steps of time are added here.
    Raises what a system raises for values that cannot be marched.
    """
    theta = inversion.value[: len(fit.unknowns.parameters)]

    def signals(forward):
        """(S k m,) over the noise, by the gains that were found."""
        shown = forward.signals(fit.unknowns, theta, fit.shots)
        return (inversion.gains * shown * fit.weight).ravel()

    of_fit = (inversion.model * fit.weight).ravel()
    differences = {TIME: [TIME_SHARE * (signals(fit.forward.with_steps(0.5)) - of_fit)]}
    for cause, better in models.items():
        differences[cause] = []
        for model in better:
            beside = of_fit
            if model.beside is not None:
                beside = signals(fit.forward._replace(system=model.beside))
            shown = signals(fit.forward._replace(system=model.system))
            differences[cause].append(model.share * (shown - beside))

    J = inversion.slopes.reshape(-1, inversion.slopes.shape[-1])
    result = model_errors.widened(
        inversion.uncertainty, scales(inversion.parameters), J, differences,
        B=bounds_information(inversion.parameters),
    )  # fmt: skip
    beyond = residual_parts(fit, result.left.reshape(inversion.model.shape))
    return inversion._replace(uncertainty=result.uncertainty, causes=result.causes, beyond=beyond)
