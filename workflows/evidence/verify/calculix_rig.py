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

from fem import calculix as program
from fem import factorised, modes
from fem.calculix_tied import Screw, tied_deck
from geometry.assembly import screw_cells
from geometry.cad import write_step
from geometry.step_tetrahedra import ElementSizes, StepPatch, Tetrahedra, step_tetrahedra
from workflows.evidence.verify.comparisons import Comparison, require_program
from workflows.files.scene import scene
from workflows.scene import Scene
from workflows.scene.assembly import assembly as dimensions
from workflows.stages import assembly, bodies
from workflows.stages.errors import COARSER, ORDER
from workflows.stages.parts import Parts
from workflows.stages.pipeline import Pipeline, pipeline_of
from workflows.stages.reduction import contact_of

SHORT = ('assembly.parts=["block", "sheets"]',)  # what stands on the sheets' support
RIGS = {"rig-full-tie": ((), 1.0), "rig-rom": (SHORT, 2.0)}  # changes, and of sizes the factor:
# the mean motion under a screw fills the matrices
STRUCK = "block"
GROUND = "sheets_support"  # the sheets are held where it would touch them
INSIDE = {STRUCK: 12e-3, "sheet-y": 3e-3, "sheet+y": 3e-3}  # m
RIM, ROUND_DISC = 1.2e-3, 0.6e-3  # m, at the edges of touching faces and of the disc
N_MODES = 10
RIGID = [1e14] * 3 + [1e10] * 3  # N/m, N m/rad: as good as rigid for CalculiX
SOURCE = "CalculiX on gmsh's tetrahedra of the STEP file, *TIE and *DLOAD; errors stated of both"


def calculix_rig() -> Iterator[Comparison]:
    """Block and sheets, meshed anew from a STEP file and tied by CalculiX: some minutes."""
    require_program(program.PROGRAM, program.PACKAGE)
    for name, (changes, scale) in RIGS.items():
        yield from _meshed_anew(name, scene(name, changes), scale)


def _meshed_anew(name: str, rig: Scene, scale: float) -> Iterator[Comparison]:
    pipeline, rough = pipeline_of(rig, _silent), assembly.mesh(rig, COARSER)
    ours, allowed = _with_error(_ours(rig, pipeline("mesh")), _ours(rig, rough))
    theirs, more = _with_error(*(_theirs(pipeline, s) for s in (scale, COARSER * scale)))
    names = [f"mode {j} [Hz]" for j in range(1, N_MODES + 1)]
    names.append("compliance less the half-space [m/N]")
    allowed = (allowed + more) / theirs
    for what, *row in zip(names, ours, theirs, np.abs(ours / theirs - 1), allowed, strict=True):
        yield Comparison(f"{name} meshed anew, {what}", *map(float, row), SOURCE)


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
    disc = StepPatch(STRUCK, pipeline("contact").spot.point, -inward, b)
    inside = {body: scale * size for body, size in INSIDE.items()}
    mesh = _meshed(rig, ElementSizes(inside, scale * RIM, scale * ROUND_DISC), disc)
    found = program.answer(_deck(rig, mesh, materials, inward))
    m = materials[STRUCK]
    half_space = 16 * (1 - m.poisson**2) / (3 * np.pi**2 * m.young * b)
    return np.append(found.frequency_hz[:N_MODES], found.compliance - half_space)


def _deck(rig: Scene, mesh: Tetrahedra, materials, inward: np.ndarray) -> str:
    """Sheets held at the ground's imprint, tied to the block or on their screws' springs."""
    touching = mesh.touching
    held = np.concatenate([faces.ravel() for (_, at), faces in touching.items() if at == GROUND])
    pairs = [(touching[pair], touching[pair[::-1]]) for pair in touching if pair[1] == STRUCK]
    wires = rig.assembly.constraint == "wires"
    joined = {"screws": [*_screws(rig, mesh.points, pairs)]} if wires else {}
    return tied_deck(
        mesh.points, mesh.cells, materials,
        ties=[] if wires else pairs, held=held, disc=(mesh.disc, inward), **joined,
    )  # fmt: skip


def _screws(rig: Scene, points: np.ndarray, pairs) -> Iterator[Screw]:
    """Of each screw a share of the sheet, and what of the block is under it."""
    a, springs = dimensions(rig.assembly), assembly.bushings(rig.springs)["head"]
    for sheet, under in pairs:
        nodes = np.unique(sheet)
        for x, (left, right) in zip(a.screw_x, screw_cells(a), strict=True):

            def inside(place: np.ndarray, left=left, right=right) -> np.ndarray:
                return (place[:, 0] > left) & (place[:, 0] < right)

            centre = np.array([x, points[nodes[0], 1], a.head_screw_z])
            share = nodes[inside(points[nodes])]
            yield Screw(share, under, inside, centre, np.minimum(springs, RIGID))


def _meshed(rig: Scene, sizes: ElementSizes, disc: StepPatch) -> Tetrahedra:
    with TemporaryDirectory() as folder:
        step = Path(folder) / "rig.step"
        parts = (*rig.assembly.parts, GROUND)
        write_step(bodies.shapes(rig.but(assembly={"parts": parts})), step)
        return step_tetrahedra(step, sizes, disc)
