"""The rig by another hand from its STEP file: gmsh's tetrahedra, tied and solved by CalculiX.

Nothing of our meshes, elements, ties or contact is in theirs. Both sides state the error that
their mesh leaves by one of elements twice as large, as a run states that of its waves; they are
to differ by no more than both together.
"""

from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from coupling.verification.comparisons import Comparison, require_program
from fem import calculix as program
from fem import factorised, modes
from fem.calculix_tied import tied_deck
from geometry.cad import write_step
from geometry.step_tetrahedra import Disc, Sizes, Tetrahedra, step_tetrahedra
from workflows.files.scene import scene
from workflows.pipeline import assembly, bodies
from workflows.pipeline.errors import COARSER, ORDER
from workflows.pipeline.parts import Parts
from workflows.pipeline.pipeline import Pipeline, pipeline_of
from workflows.pipeline.reduction import contact_of
from workflows.scene import Scene

RIG, STRUCK = "rig-full-tie", "block"
GROUND = "sheets_support"  # the sheets are held where it would touch them
INSIDE = {STRUCK: 12e-3, "sheet-y": 3e-3, "sheet+y": 3e-3}  # m
RIM, ROUND_DISC = 1.2e-3, 0.6e-3  # m, at the edges of touching faces and of the disc
N_MODES = 10
SOURCE = "CalculiX on gmsh's tetrahedra of the STEP file, *TIE and *DLOAD; errors stated of both"


def calculix_rig() -> Iterator[Comparison]:
    """The glued rig, meshed anew from its STEP file and tied by CalculiX: some minutes."""
    require_program(program.PROGRAM, program.PACKAGE)
    rig = scene(RIG, ())
    pipeline, rough = pipeline_of(rig, _silent), assembly.mesh(rig, COARSER)
    ours, allowed = _with_error(_ours(rig, pipeline("mesh")), _ours(rig, rough))
    theirs, more = _with_error(*(_theirs(pipeline, scale) for scale in (1.0, COARSER)))
    names = [f"mode {j} [Hz]" for j in range(1, N_MODES + 1)]
    names.append("compliance less the half-space [m/N]")
    allowed = (allowed + more) / theirs
    for name, *row in zip(names, ours, theirs, np.abs(ours / theirs - 1), allowed, strict=True):
        yield Comparison(f"{RIG} meshed anew, {name}", *map(float, row), SOURCE)


def _silent(stage: str):
    return nullcontext()


def _with_error(fine: np.ndarray, rough: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the finer mesh gives, and the error stated of it."""
    return fine, np.abs(fine - rough) / (COARSER**ORDER - 1)


def _ours(rig: Scene, mesh: Parts) -> np.ndarray:
    """Ten frequencies, and the compliance at the contact less the half-space's."""
    model = assembly.model(rig, mesh)
    contact = assembly.contact(rig, mesh, model)
    hz = modes(model.K, model.M, N_MODES).frequency_hz
    whole = contact.w @ factorised(model.K).solve(contact.w)
    return np.append(hz, whole - contact_of(rig, model, contact).half_space)


def _theirs(pipeline: Pipeline, scale: float) -> np.ndarray:
    """The same by elements of `scale` times the size, of a disc under even pressure."""
    rig, inward = pipeline.scene, pipeline("contact").spot.inward
    b, materials = rig.patch.radius, pipeline("mesh").materials
    disc = Disc(STRUCK, pipeline("contact").spot.point, -inward, b)
    inside = {body: scale * size for body, size in INSIDE.items()}
    mesh = _meshed(rig, Sizes(inside, scale * RIM, scale * ROUND_DISC), disc)
    touching = mesh.touching
    held = np.concatenate([faces.ravel() for (_, at), faces in touching.items() if at == GROUND])
    ties = [(touching[pair], touching[pair[::-1]]) for pair in touching if pair[1] == STRUCK]
    pressed = mesh.disc, inward
    found = program.answer(
        tied_deck(mesh.points, mesh.cells, materials, ties=ties, held=held, disc=pressed)
    )
    m = materials[STRUCK]
    half_space = 16 * (1 - m.poisson**2) / (3 * np.pi**2 * m.young * b)
    return np.append(found.frequency_hz[:N_MODES], found.compliance - half_space)


def _meshed(rig: Scene, sizes: Sizes, disc: Disc) -> Tetrahedra:
    with TemporaryDirectory() as folder:
        step = Path(folder) / f"{RIG}.step"
        parts = (*rig.assembly.parts, GROUND)
        write_step(bodies.shapes(rig.but(assembly={"parts": parts})), step)
        return step_tetrahedra(step, sizes, disc)
