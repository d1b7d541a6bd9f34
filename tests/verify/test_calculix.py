"""Built-in assemblies, coarse, beside CalculiX: the same meshes by its own elements, constraints
and solvers, and its tetrahedra."""

import numpy as np
import pytest

from beadwave import rom
from beadwave.coupling.reduced_spatial_wall import spatial_wall_of
from beadwave.fem import factorised, modes
from beadwave.fem.assembly.model import Model
from beadwave.fem.exchange.abaqus import input_deck
from beadwave.workflows.evidence.harness import Comparison
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.structure.assembly import dashpots

from peer_programs import require_program
from programs import calculix as program

PRINTED = 1e-6  # CalculiX prints seven digits
COARSE = (
    "mesh.seed=0.01",
    "mesh.block_seed=0.035",
    "mesh.support_seed=0.1",
    "mesh.contact_seed=0.01",
)
SCENES = {
    "cantilever": ("mesh.scale=2",),
    "rig-full-tie": COARSE,
    "rig-rom": COARSE,
    "rig-rom-269": COARSE,
    "rig-rom-907": COARSE,
}
SOURCE = "CalculiX on the deck that `modes --inp` writes"

pytestmark = pytest.mark.peer


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_program(program.PROGRAM, program.PACKAGE)


@pytest.mark.parametrize("name", SCENES)
def test_calculix_finds_our_frequencies_and_compliance(name, compare):
    frequencies_and_compliance(name, pipeline_of(scene(name, SCENES[name]), quiet), compare)


@pytest.mark.minutes
def test_calculix_finds_those_of_the_plate_on_its_bolts(compare):
    """60 000 unknowns."""
    plate = pipeline_of(scene("plate-on-bolts", ("mesh.scale=4",)), quiet)
    frequencies_and_compliance("plate-on-bolts", plate, compare)


def frequencies_and_compliance(name: str, pipeline: Pipeline, compare) -> None:
    """Of ten frequencies the one that differs most; the static compliance w^T K^-1 w."""
    theirs = program.answer(deck_of(pipeline))
    model, w = pipeline("model"), pipeline("contact").w
    hz = modes(model.K, model.M, 10).frequency_hz
    worst = int(np.argmax(np.abs(hz / theirs.frequency_hz[:10] - 1)))
    compare(f"{name}, ten frequencies [Hz]", hz[worst], theirs.frequency_hz[worst],
            allowed=PRINTED, source=SOURCE)  # fmt: skip
    compliance = w @ factorised(model.K).solve(w)
    compare(f"{name}, compliance at the contact [m/N]", compliance, theirs.compliance,
            allowed=PRINTED, source=SOURCE)  # fmt: skip


@pytest.mark.parametrize("name", ["cantilever", "rig-rom"])
def test_every_entry_of_the_matrices_and_the_response_are_those_of_calculix(name, check, compare):
    """K and M over their largest entries; the receptance at the contact to 20 kHz."""
    pipeline = pipeline_of(scene(name, SCENES[name]), quiet)
    model, w, deck = pipeline("model"), pipeline("contact").w, deck_of(pipeline)
    theirs = program.matrices(deck)
    common = np.searchsorted(model.free, theirs.dof)  # CalculiX keeps some of the free dofs
    for letter, K_ours, K_theirs in (("K", model.K, theirs.K), ("M", model.M, theirs.M)):
        ours = K_ours[common][:, common].tocsr()
        difference = (ours - K_theirs).tocoo()
        worst = int(np.argmax(np.abs(difference.data)))
        i, j = difference.row[worst], difference.col[worst]
        compare(f"{name}, {letter} entry by entry", ours[i, j], K_theirs[i, j],
                allowed=1e-10, of=float(abs(K_theirs).max()),
                source=f"{SOURCE}, MATRIXSTORAGE")  # fmt: skip
    check(receptance(f"{name}, receptance of 40 modes to 20 kHz [m/N]", model, w, deck))


@pytest.mark.parametrize("name", ["cantilever", "rig-rom"])
def test_compliances_and_responses_across_are_those_of_calculix(name, check, compare):
    """Static compliance along t1 and t2 of the wall of three directions, from a reduced model, and
    the receptance to 20 kHz."""
    pipeline = pipeline_of(scene(name, SCENES[name]), quiet)
    model, contact = pipeline("model"), pipeline("contact")
    materials, C = pipeline("mesh").materials, dashpots(pipeline.scene, model)
    patches = contact.across(model)
    solver = {"factor": factorised(model.K), "factorise": factorised}
    selection = rom.Selection(20, to_hz=2e4, choice="contact")
    alone = rom.free_modes(model.K, model.M, contact.w, selection, **solver)
    W = np.column_stack([patch.w for patch in patches])
    alone, columns = rom.with_columns(alone, model.K, model.M, W, **solver)
    wall = spatial_wall_of(alone._replace(columns=rom.Columns(columns, np.zeros((3, 3)))))
    compliance = np.sum((wall.phi / wall.omega[:, None]) ** 2, axis=0)
    for axis, patch, ours in zip(("t1", "t2"), patches, compliance[1:], strict=True):
        deck = input_deck(model, materials, w=patch.w, C=C)
        compare(f"{name}, reduced, compliance along {axis} [m/N]", ours,
                program.answer(deck).compliance, allowed=PRINTED, source=SOURCE)  # fmt: skip
        check(
            receptance(f"{name}, receptance of 40 modes along {axis} [m/N]", model, patch.w, deck)
        )


def test_tetrahedra_in_calculix_agree_with_our_hexahedra(check):
    """The two fine meshes differ by at most what halving the elements changes on both sides."""
    ours, theirs = [], []
    for scale in (1, 0.5):
        hexahedra = pipeline_of(scene("cantilever", (f"mesh.scale={scale}",)), quiet)
        model = hexahedra("model")
        ours.append(modes(model.K, model.M, 10).frequency_hz)
        changes = ("mesh.element=tet", f"mesh.scale={scale}")
        tetrahedra = pipeline_of(scene("cantilever", changes), quiet)
        theirs.append(program.answer(deck_of(tetrahedra)).frequency_hz[:10])
    allowed = np.abs(ours[0] / ours[1] - 1) + np.abs(theirs[0] / theirs[1] - 1)
    difference = np.abs(ours[1] / theirs[1] - 1)
    worst = int(np.argmax(difference / allowed))
    check(Comparison(
        "cantilever, hexahedra beside tetrahedra [Hz]", ours[1][worst], theirs[1][worst],
        float(difference[worst]), float(allowed[worst]), "CalculiX on gmsh's tetrahedra",
    ))  # fmt: skip


def deck_of(pipeline: Pipeline) -> str:
    """The scene's structure as `modes --inp` writes it."""
    model, w = pipeline("model"), pipeline("contact").w
    C = dashpots(pipeline.scene, model)
    return input_deck(model, pipeline("mesh").materials, w=w, C=C)


def receptance(quantity: str, model: Model, w: np.ndarray, deck: str) -> Comparison:
    """The receptance to 20 kHz at the functional w (n,) that the deck loads and reads:

    H = sum_j (w^T phi_j)^2 / (omega_j^2 - omega^2 + 2 i zeta omega_j omega) of the same forty
    modes and no residual vector: CalculiX' steady state takes the modes alone.
    """
    n, zeta = 40, 0.01
    f, H_theirs = program.receptance(deck, n_modes=n, zeta=zeta, span_hz=(20.0, 2e4))
    spectrum = modes(model.K, model.M, n)
    omega_j, participation = spectrum.omega[:, None], (w @ spectrum.phi)[:, None]
    omega = 2 * np.pi * f
    H = participation**2 / (omega_j**2 - omega**2 + 2j * zeta * omega_j * omega)
    H = np.sum(H, axis=0)
    difference = np.abs(H / H_theirs - 1)
    worst = int(np.argmax(difference))
    return Comparison(
        quantity, abs(H[worst]), abs(H_theirs[worst]),
        float(difference[worst]), 1e-4, "CalculiX, *STEADY STATE DYNAMICS",
    )  # fmt: skip
