"""One Krylov space of a held assembly, by one factor of K: its modes, what its contact moves, and
the static response, for all stages that need any of them.

Solving for each apart took 44 s of processor time of the rig's 49 062 unknowns: the modes 5.4, the
modes of the contact 7, the modes with rigid joints 11, the full response 18. The space takes 5.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from beadwave import fem, rom
from beadwave.fem.modes.assembly_modes import N_MODES
from beadwave.rom.contact_space import KrylovOptions
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.tables.reduction import TO_HZ
from beadwave.workflows.stages.structure.assembly import contact
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.reduction import selection
from beadwave.workflows.stages.structure.targets import targets


def krylov_space(
    scene: Scene, mesh: Parts, model: fem.Model, factor: fem.Factor | None
) -> rom.Space | None:
    """The space, until its modes hold the scene's targets and its contact is answered to
    `KrylovOptions.exact`; None of an assembly that floats, whose K has no factor."""
    if factor is None:
        return None
    options, chosen, sought = KrylovOptions(), selection(scene), targets(scene, model)

    # the space grows from the force at the contact, and ends where that is answered
    n = model.K.shape[0]
    try:
        w, error = contact(scene, mesh, model).w, options.exact
    except ValueError:  # the modes do without it; what reduces the assembly says what is wrong
        w, error = model.M @ np.random.default_rng(2).standard_normal(n), np.inf

    def enough(omega: NDArray[np.float64], shapes: Callable[[], NDArray[np.float64]]) -> bool:
        """True if the modes omega (k,) [rad/s] of `shapes` (n, k) are as many as are listed, with
        the targets among them."""
        smallest, largest = (min(n_modes, n - 2) for n_modes in N_MODES)
        if len(omega) < smallest:
            return False
        if len(omega) >= largest or not sought:
            return True
        return bool(np.all(fem.pair(model, fem.Modes(omega, shapes()), sought).index >= 0))

    with fem.one_thread():
        return rom.krylov_space(
            rom.Pencil(model.K, model.M, factor),
            w,
            rom.no_modes(n),
            error,
            max(TO_HZ, chosen.to_hz or 0.0),
            (chosen.n_modes or 0) + options.extra,
            enough,
        )
