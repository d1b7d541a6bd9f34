"""The rig solved independently from its STEP file: gmsh's tetrahedra, tied and solved by CalculiX.

It shares no mesh, element, tie or contact with our model. Each side states the error of its mesh,
estimated from one with elements twice as large as a run does; the results may differ by no more
than the sum of both.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from beadwave import fem
from beadwave.fem import factorised, modes
from beadwave.geometry.cad.occ import write_step
from beadwave.workflows.evidence.harness import Comparison
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.body_shapes import shapes
from beadwave.workflows.scene.rig import screw_cells
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.errors.second_mesh import COARSER, ORDER
from beadwave.workflows.stages.structure import assembly, bodies
from beadwave.workflows.stages.structure.reduction import contact_of

from peer_programs import require_program
from programs import calculix as program
from programs.calculix_tied import Screw, tied_deck
from programs.step_tetrahedra import ElementSizes, StepPatch, step_tetrahedra

SHORT = ('assembly.parts=["block", "sheets"]',)  # what stands on the sheets' support
# changes of a scene, and the factor of the sizes below: the mean motion under a screw fills the
# matrices, so that the rig on screws takes larger elements
RIGS = {"rig-full-tie": ((), 1.0), "rig-rom": (SHORT, 2.0)}
STRUCK = "block"
GROUND = "sheets_support"  # the sheets are held where it would touch them
# element sizes [m]: in the bodies, at the edges of touching faces, round the disc
INSIDE = {STRUCK: 12e-3, "sheet-y": 3e-3, "sheet+y": 3e-3}
RIM, ROUND_DISC = 1.2e-3, 0.6e-3
N_MODES = 10
RIGID = [1e14] * 3 + [1e10] * 3  # N/m, N m/rad: as good as rigid for CalculiX
SOURCE = "CalculiX on gmsh's tetrahedra of the STEP file, *TIE and *DLOAD; errors stated of both"


pytestmark = [pytest.mark.peer, pytest.mark.minutes]


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_program(program.PROGRAM, program.PACKAGE)


@pytest.mark.parametrize("name", RIGS)
def test_the_rig_meshed_anew_and_tied_by_calculix_is_ours_within_both_mesh_errors(name, check):
    changes, scale = RIGS[name]
    rig = scene(name, changes)
    pipeline = pipeline_of(rig, quiet)

    # ours, ten frequencies and the compliance at the contact less the half-space's, on the
    # mesh of a run and on one of elements COARSER times as large
    ours = []
    for mesh in (pipeline("mesh"), bodies.parts(rig, coarser=COARSER)):
        model = assembly.model(rig, mesh)
        contact = assembly.contact(rig, mesh, model)
        hz = modes(model.K, model.M, N_MODES).frequency_hz
        compliance = contact.w @ factorised(model.K).solve(contact.w)
        local = contact_of(rig, model, contact).half_space
        ours.append(np.append(hz, compliance - local))

    theirs = [by_calculix(rig, pipeline, size) for size in (scale, COARSER * scale)]

    # each side states |fine - coarse| / (COARSER^ORDER - 1) of its own fine mesh
    stated = [
        np.abs(fine - coarse) / (COARSER**ORDER - 1) for fine, coarse in (ours, theirs)
    ]  # fmt: skip
    quantities = [f"mode {j} [Hz]" for j in range(1, N_MODES + 1)]
    quantities.append("compliance less the half-space [m/N]")
    difference = np.abs(ours[0] / theirs[0] - 1)
    allowed = sum(stated) / theirs[0]
    for quantity, *row in zip(
        quantities, ours[0], theirs[0], difference, allowed, strict=True
    ):  # fmt: skip
        check(Comparison(f"{name} meshed anew, {quantity}", *map(float, row), SOURCE))


def by_calculix(rig: Scene, pipeline: Pipeline, scale: float) -> np.ndarray:
    """Ten frequencies [Hz] and the compliance at the contact less the half-space's [m/N], of
    tetrahedra `scale` times the sizes above and a disc under even pressure."""
    materials, spot = pipeline("mesh").materials, pipeline("contact").spot
    radius = rig.strike.radius

    # tetrahedra of the STEP file, which holds the ground as well: its imprint is what is held
    disc = StepPatch(STRUCK, spot.point, -spot.inward, radius)
    inside = {body: scale * size for body, size in INSIDE.items()}
    with TemporaryDirectory() as folder:
        step = Path(folder) / "rig.step"
        bodies_and_ground = (*rig.rig.assembly.parts, GROUND)
        write_step(shapes(rig.but(assembly={"parts": bodies_and_ground})), step)
        mesh = step_tetrahedra(step, ElementSizes(inside, scale * RIM, scale * ROUND_DISC), disc)

    # sheets held at the ground's imprint, tied to the block or on their screws' springs: of each
    # screw a share of the sheet's face, and what of the block's face is under it
    touching = mesh.touching
    supported = [faces.ravel() for (_, at), faces in touching.items() if at == GROUND]
    ties = [(touching[pair], touching[pair[::-1]]) for pair in touching if pair[1] == STRUCK]
    screws = []
    if rig.rig.assembly.constraint == "wires":
        a, head = rig.rig.assembly, rig.bushings["head"]
        springs = fem.Bushing(*(getattr(head, key) for key in fem.DIRECTIONS))
        for sheet, under in ties:
            nodes = np.unique(sheet)
            for x, (x_low, x_high) in zip(a.screw_x, screw_cells(a), strict=True):

                def inside_cell(points: np.ndarray, x_low=x_low, x_high=x_high) -> np.ndarray:
                    return (points[:, 0] > x_low) & (points[:, 0] < x_high)

                centre = np.array([x, mesh.points[nodes[0], 1], a.head_screw_z])
                share = nodes[inside_cell(mesh.points[nodes])]
                stiffness = np.minimum(springs, RIGID)
                screws.append(Screw(share, under, inside_cell, centre, stiffness))
        ties = []
    deck = tied_deck(
        mesh.points, mesh.cells, materials,
        ties=ties, held=np.concatenate(supported), disc=(mesh.disc, spot.inward), screws=screws,
    )  # fmt: skip

    # the half-space under even pressure, w = 16 (1 - nu^2) / (3 pi^2 E b)
    results = program.answer(deck)
    m = materials[STRUCK]
    half_space = 16 * (1 - m.poisson**2) / (3 * np.pi**2 * m.young * radius)
    return np.append(results.frequency_hz[:N_MODES], results.compliance - half_space)
