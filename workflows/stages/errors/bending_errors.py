"""The errors of frequencies and compliance of a beam or a plate, by cause: mesh and theory.

Each cause is a second model in addition to the run's own: the one on shorter elements, and those of
other theories of bending, whose shares add up.
"""

import numpy as np

from beadwave import rom
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.fem.modes.mac import RIGID
from beadwave.workflows.report.summary import NumberError
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.errors.number_errors import with_errors
from beadwave.workflows.stages.structure.reduction import SecondModel


def structure_errors(
    scene: Scene,
    modes: AssemblyModes,
    reduction: rom.ReducedModel,
    second: SecondModel,
    others: tuple[SecondModel, ...] = (),
) -> tuple[NumberError, ...]:
    """The frequencies [Hz] and the static compliance [m/N] with their errors of mesh and theory.

    Modes of two models are paired by their order among the elastic ones of the reduced models,
    where these have as many; a mode that the reduced model lacks has no row.
    """

    def elastic(reduced):
        """(k,) [rad/s] rising."""
        omega = np.sort(rom.modal(reduced).omega)
        return omega[omega > RIGID * omega.max()]

    def compliance(reduced):
        """[m/N] w^T K^-1 w less the half-space that the Hertz law holds already."""
        return rom.static_compliance(reduced) - (reduced.contact.half_space or 0.0)

    # by cause the models that are compared, each with its elastic frequencies
    causes = {"mesh": (second,), **({"theory": others} if others else {})}
    models = [(cause, elastic(m.reduced), m) for cause, of in causes.items() for m in of]
    reduced_omega, rows = elastic(reduction), []
    for i, omega in enumerate(modes.omega):
        j = int(np.abs(reduced_omega - omega).argmin())
        # a mode's frequency and that of the reduced model, if it has it, differ by 5e-3 at most
        if abs(reduced_omega[j] - omega) > 5e-3 * omega:
            continue

        # models with another number of elastic modes cannot be paired by order: nothing is known
        errors = dict.fromkeys(causes, 0.0)
        for cause, theirs, model in models:
            moved = (
                abs(theirs[j] / reduced_omega[j] - 1)
                if len(theirs) == len(reduced_omega)
                else np.nan
            )
            errors[cause] += model.left * moved * omega / (2 * np.pi)
        rows.append(with_errors(f"mode {i + 1}", omega / (2 * np.pi), "Hz", errors))

    s, errors = compliance(reduction), dict.fromkeys(causes, 0.0)
    for cause, _, model in models:
        errors[cause] += model.left * abs(compliance(model.reduced) - s)
    return (*rows, with_errors("static_compliance_m_per_N", s, "m/N", errors))
