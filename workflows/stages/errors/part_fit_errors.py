"""Errors of the fits of measured parts in the modes of an assembly.

Apart from `measured_parts`, which the model needs, so that a changed reduction keeps the modes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh

from beadwave import fem, rom
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.fem.modes.mac import RIGID
from beadwave.fem.modes.modes import SHIFT_HZ
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.structure.measured_parts import N_DRAWS, fitted_part, measured_part
from beadwave.workflows.stages.structure.targets import axes_of_test


class OtherFits(NamedTuple):
    """Fits that differ from the scene's by an error, and how much of a change is the error."""

    fits: dict[str, rom.ModalFit]  # by the name of the part
    share: float


def other_fits(scene: Scene) -> list[OtherFits]:
    """Fits by noise, each with 2.5 / n of its change so that their mean change counts as two
    standard deviations (of a Gaussian 1.25 times the mean), and that of the lower part of the
    band; raises InvalidScene for files that cannot be fitted."""
    parts = {table.name: fitted_part(table) for table in scene.measured or ()}
    n = N_DRAWS
    others = [
        OtherFits({name: part.by_noise[i] for name, part in parts.items()}, 2.5 / n)
        for i in range(n)
    ]
    return [*others, OtherFits({name: part.by_band for name, part in parts.items()}, 1.0)]


def part_errors(scene: Scene, model: fem.Model, modes: AssemblyModes) -> NDArray[np.float64]:
    """Relative errors (k,) of the frequencies of modes by the fits of measured parts.

    Modes of the assembly with other fits in the space of its own modes, of the static shapes of
    forces at the joints, and of all oscillators: to second order in the change. Each is the one
    whose motion of the assembly is most like the mode's.
    """
    # the space: modes, and static shapes of forces on the assembly at the points of the parts; K is
    # shifted, so that an assembly that floats has static shapes as well
    at_parts = np.concatenate([at for _, at in model.measured])
    pulls = np.vstack([(part.B @ model.T).toarray() for part, _ in model.measured]).T
    shifted = (model.K + (2 * np.pi * SHIFT_HZ) ** 2 * model.M).tocsc()
    u = np.hstack([modes.phi, fem.factorised(shifted).solve(pulls)])

    # the assembly alone in it: without the parts' oscillators, which every fit brings anew, and
    # without the springs D^T K_j D to them
    u[at_parts] = 0.0
    K, M = u.T @ (model.K @ u), u.T @ (model.M @ u)
    moved = {part.name: part.B @ (model.T @ u) for part, _ in model.measured}
    for part, _ in model.measured:
        K -= moved[part.name].T @ part.stiffness @ moved[part.name]

    # M-orthonormal, without directions that the shapes span twice
    size, V = np.linalg.eigh(M)
    V = V[:, size > 1e-10 * size[-1]] / np.sqrt(size[size > 1e-10 * size[-1]])
    K, M = V.T @ K @ V, np.eye(V.shape[1])
    moved = {name: b @ V for name, b in moved.items()}

    tables = {table.name: table for table in scene.measured}

    # the points of each part with their directions alone
    axes = axes_of_test(scene)
    turn = np.eye(3) if axes is None else axes.turn
    points = {}
    for table in scene.measured:
        measured = fitted_part(table).receptances
        nowhere = fem.SpringEnd(table.on, (0.0, 0.0), table.radius)
        points[table.name] = tuple(
            fem.PartPoint(nowhere, turn @ np.eye(3)[axis], node)
            for node, axis in zip(measured.node, measured.axis, strict=True)
        )

    def modes_with(fits: dict[str, rom.ModalFit]) -> tuple[NDArray, NDArray]:
        """Frequencies (r,) [rad/s] of the whole with these fits, and the assembly's motions."""
        whole, mass = K.copy(), M
        for name, fit in fits.items():
            part = measured_part(tables[name], fit, points[name])
            stiffness = fem.joint_stiffness(part)

            # D (m, k): elongations of the springs, the assembly's motion less the oscillators';
            # columns of oscillators that were added before are zero
            D = np.hstack([moved[name], np.zeros((len(moved[name]), len(whole) - len(K)))])
            D = np.hstack([D, -part.phi])
            whole = block_diag(whole, np.diag(part.omega**2)) + D.T @ stiffness @ D
            mass = np.eye(len(whole))
        squared, x = eigh(whole, mass)
        return np.sqrt(np.maximum(squared, 0.0)), x[: len(K)]

    # MAC in M-orthonormal coordinates is that of the motions weighted by mass
    n = len(modes.omega)
    omega, shape = modes_with({name: fitted_part(table).fit for name, table in tables.items()})
    omega, shape = omega[:n], shape[:, :n]
    error = np.zeros(n)
    for other_fit in other_fits(scene):
        others, shapes = modes_with(other_fit.fits)
        like = fem.mac(shape, shapes)
        nearest = others[like.argmax(axis=1)]
        error += other_fit.share * np.abs(nearest / np.maximum(omega, 1e-9) - 1)
    return np.where(omega > RIGID * omega.max(), error, np.nan)
