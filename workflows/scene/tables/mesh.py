"""[mesh] and [table] of the thesis' rig, and what is asked of any mesh."""

from typing import Annotated, Literal

from pydantic import Field

from beadwave.workflows.scene.named_files import FileName
from beadwave.workflows.scene.quantities import of
from beadwave.workflows.scene.scene_table import (
    Frequency,
    Positive,
    RelativeError,
    SceneTable,
    Seed,
)
from beadwave.workflows.scene.units import (
    LENGTH,
    MASS,
    TIME,
)


class AskedOfMesh(SceneTable):
    """Demands on a mesh in place of sizes of elements, and the time that it may take."""

    # relative error, 0.02 or "2 %", from which sizes of elements follow: of the frequencies of the
    # targets, without targets of the first elastic modes, and of the static compliance at each
    # contact; 1e-6 at least, of which a free block without any edge that is singular takes some
    # 400,000 unknowns
    error: Annotated[RelativeError, Field(ge=1e-6, lt=1)] | None = None
    # with `error`, without targets: the elastic modes whose frequencies are bounded
    modes: Annotated[int, Field(ge=1, le=20)] = 12
    # with `error`: the mesh has so many unknowns at most
    unknowns: Annotated[int, Field(ge=1000, le=10_000_000)] = 300_000
    # [m] with `error`: holes, roundings, chamfers, slots and faces that are smaller are left out of
    # the mesh, but those that the scene names; what that changes is a part of the error
    simplify: of(Positive, LENGTH, 1e-5, 0.1) | None = None
    # sizes of elements that a run with `error` has chosen, the sizes.npz of its folder
    sizes: FileName | None = None
    # [s] that the mesh of one body may take: a command ends with a sentence after that
    seconds: of(Positive, TIME, 1.0, 1e6) = 600.0

    @property
    def asked(self) -> dict[str, float | int | str | None]:
        """Values of these keys."""
        return {key: getattr(self, key) for key in AskedOfMesh.model_fields}


class Mesh(AskedOfMesh):
    """Elements of the thesis' rig: quadratic; `seed` is their size in the sheets, `contact_seed` at
    the patch."""

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
