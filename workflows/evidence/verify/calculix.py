"""Assemblies in CalculiX: the same meshes by its own elements, constraints and solvers."""

from collections.abc import Iterator

import numpy as np

from beadwave import rom
from beadwave.coupling.reduced_spatial_wall import spatial_wall_of
from beadwave.fem import calculix as program
from beadwave.fem import factorised, modes
from beadwave.fem.abaqus import input_deck
from beadwave.fem.model import Model
from beadwave.workflows.evidence.harness import Comparison, compared, require_program
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.assembly import dashpots
from beadwave.workflows.stages.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.progress import quiet

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


def calculix() -> Iterator[Comparison]:
    """Built-in assemblies, coarse: frequencies, compliance, K and M, response, tetrahedra."""
    require_program(program.PROGRAM, program.PACKAGE)
    for name, changes in SCENES.items():
        yield from _frequencies_and_compliance(name, pipeline_of(scene(name, changes), quiet))
    for name in ("cantilever", "rig-rom"):
        yield from _matrices_and_response(name, pipeline_of(scene(name, SCENES[name]), quiet))
        yield from _across(name, pipeline_of(scene(name, SCENES[name]), quiet))

    # gmsh's tetrahedra in CalculiX beside our hexahedra: a difference of the two fine meshes of at
    # most what halving the elements changes on both sides
    ours, theirs = [], []
    for scale in (1, 0.5):
        hexahedra = pipeline_of(scene("cantilever", (f"mesh.scale={scale}",)), quiet)
        model = hexahedra("model")
        ours.append(modes(model.K, model.M, 10).frequency_hz)
        changes = ("mesh.element=tet", f"mesh.scale={scale}")
        tetrahedra = pipeline_of(scene("cantilever", changes), quiet)
        theirs.append(program.answer(_deck(tetrahedra)).frequency_hz[:10])
    allowed = np.abs(ours[0] / ours[1] - 1) + np.abs(theirs[0] / theirs[1] - 1)
    difference = np.abs(ours[1] / theirs[1] - 1)
    worst = int(np.argmax(difference / allowed))
    yield Comparison(
        "cantilever, hexahedra beside tetrahedra [Hz]", ours[1][worst], theirs[1][worst],
        float(difference[worst]), float(allowed[worst]), "CalculiX on gmsh's tetrahedra",
    )  # fmt: skip


def calculix_bolts() -> Iterator[Comparison]:
    """The plate on its bolts in CalculiX: 60 000 unknowns, a minute or two."""
    require_program(program.PROGRAM, program.PACKAGE)
    plate = pipeline_of(scene("plate-on-bolts", ("mesh.scale=4",)), quiet)
    yield from _frequencies_and_compliance("plate-on-bolts", plate)


def _deck(pipeline: Pipeline) -> str:
    """The scene's structure as `modes --inp` writes it."""
    model, w = pipeline("model"), pipeline("contact").w
    C = dashpots(pipeline.scene, model)
    return input_deck(model, pipeline("mesh").materials, w=w, C=C)


def _frequencies_and_compliance(name: str, pipeline: Pipeline) -> Iterator[Comparison]:
    """Of ten frequencies the one that differs most; the static compliance w^T K^-1 w."""
    theirs = program.answer(_deck(pipeline))
    model, w = pipeline("model"), pipeline("contact").w
    hz = modes(model.K, model.M, 10).frequency_hz
    worst = int(np.argmax(np.abs(hz / theirs.frequency_hz[:10] - 1)))
    yield compared(f"{name}, ten frequencies [Hz]", hz[worst], theirs.frequency_hz[worst],
                   allowed=PRINTED, source=SOURCE)  # fmt: skip
    compliance = w @ factorised(model.K).solve(w)
    yield compared(f"{name}, compliance at the contact [m/N]", compliance, theirs.compliance,
                   allowed=PRINTED, source=SOURCE)  # fmt: skip


def _matrices_and_response(name: str, pipeline: Pipeline) -> Iterator[Comparison]:
    """K and M entry by entry over their largest; the receptance at the contact to 20 kHz."""
    model, w, deck = pipeline("model"), pipeline("contact").w, _deck(pipeline)
    theirs = program.matrices(deck)
    common = np.searchsorted(model.free, theirs.dof)  # CalculiX keeps some of the free dofs
    for letter, K_ours, K_theirs in (("K", model.K, theirs.K), ("M", model.M, theirs.M)):
        ours = K_ours[common][:, common].tocsr()
        difference = (ours - K_theirs).tocoo()
        worst = int(np.argmax(np.abs(difference.data)))
        i, j = difference.row[worst], difference.col[worst]
        yield compared(f"{name}, {letter} entry by entry", ours[i, j], K_theirs[i, j],
                       allowed=1e-10, of=float(abs(K_theirs).max()),
                       source=f"{SOURCE}, MATRIXSTORAGE")  # fmt: skip

    yield _receptance(f"{name}, receptance of 40 modes to 20 kHz [m/N]", model, w, deck)


def _across(name: str, pipeline: Pipeline) -> Iterator[Comparison]:
    """Static compliance along t1 and t2 of the wall of three directions, from a reduced model, and
    the receptance to 20 kHz."""
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
        yield compared(f"{name}, reduced, compliance along {axis} [m/N]", ours,
                       program.answer(deck).compliance, allowed=PRINTED, source=SOURCE)  # fmt: skip
        yield _receptance(
            f"{name}, receptance of 40 modes along {axis} [m/N]", model, patch.w, deck
        )


def _receptance(quantity: str, model: Model, w: np.ndarray, deck: str) -> Comparison:
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
