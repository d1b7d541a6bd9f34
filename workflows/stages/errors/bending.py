"""The errors of the single numbers of a beam or a plate, by cause: reduction, mesh, theory.

Each cause is a second model in addition to the run's own: the finer reduced one, the one on shorter
elements, and those of other theories of bending, whose shares add up.
"""

import numpy as np

from beadwave import coupling, rom
from beadwave.dem.waves.chain_waves import ChainWaves
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.fem.modes.mac import RIGID
from beadwave.workflows.report.summary import NumberError, QuantityErrors
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.errors.numbers import MarchedPair, numbers_with_errors, with_errors
from beadwave.workflows.stages.errors.quantities import marched, of_reduction
from beadwave.workflows.stages.errors.waves import mesh_error
from beadwave.workflows.stages.structure.reduction import SecondModel


def quantity_errors(
    scene: Scene,
    start: Start,
    reduction: rom.ReducedModel,
    second: SecondModel,
    impact: coupling.Impact,
    waves: ChainWaves,
    others: tuple[SecondModel, ...] = (),
) -> QuantityErrors:
    """TOF, ARR, peak force, arrivals and peaks with their errors; `others` are those of other
    theories."""
    pairs = {"reduction": (of_reduction(scene, start, reduction, impact),)}
    for cause, models in (("mesh", (second,)), ("theory", others)):
        if models:
            pairs[cause] = tuple(
                MarchedPair(impact.trajectory, marched(scene, start, m.reduced, impact), m.left)
                for m in models
            )
    numbers = numbers_with_errors(scene, start, impact, waves, pairs)
    return QuantityErrors(numbers, mesh_error(scene, start, second, impact))


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
