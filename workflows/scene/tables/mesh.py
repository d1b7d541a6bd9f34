"""[mesh] and [table] of the thesis' rig."""

from typing import Literal

from beadwave.workflows.scene.named_files import FileName
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Frequency,
    Positive,
    SceneTable,
    Seed,
)
from beadwave.workflows.scene.units import (
    MASS,
)


class Mesh(SceneTable):
    """Quadratic elements; `seed` is their size in the sheets, `contact_seed` at the patch."""

    element: Literal["hex", "tet"] = "hex"  # hexahedra, or tetrahedra
    seed: Seed = 6e-3  # [m] in the sheets
    block_seed: Seed = 20e-3  # [m] in the block
    support_seed: Seed = 60e-3  # [m] in the parts below
    contact_seed: Seed = 5e-3  # [m] at the patch
    scale: Positive = 1.0  # factor on all sizes of elements
    file: FileName | None = None  # a mesh of one's own, with the names of ours


class Standing(SceneTable):
    """A table below, swaying along x and y; `frequency` with the assembly on it."""

    frequency: Frequency  # [Hz] of its sway, with the assembly on it
    mass: of(Positive, MASS, 1e-3, 1e6)  # [kg] of the table alone
