"""Assemblies in CalculiX: the same meshes by its own elements, constraints and solvers."""

from collections.abc import Iterator
from contextlib import nullcontext

import numpy as np

from fem import calculix as program
from fem import factorised, modes
from fem.abaqus import input_deck
from workflows.evidence.verify.comparisons import Comparison, compared, require_program
from workflows.files.scene import scene
from workflows.stages.assembly import dashpots
from workflows.stages.pipeline import Pipeline, pipeline_of

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
        yield from _solved(name, _pipeline(name, changes))
    for name in ("cantilever", "rig-rom"):
        yield from _entries(name, _pipeline(name, SCENES[name]))
        yield from _response(name, _pipeline(name, SCENES[name]))
    yield from _another_mesh()


def calculix_bolts() -> Iterator[Comparison]:
    """The plate on its bolts in CalculiX: 60 000 unknowns, a minute or two."""
    require_program(program.PROGRAM, program.PACKAGE)
    yield from _solved("plate-on-bolts", _pipeline("plate-on-bolts", ("mesh.scale=4",)))


def _pipeline(name: str, changes: tuple[str, ...]) -> Pipeline:
    return pipeline_of(scene(name, changes), lambda stage: nullcontext())


def _deck(pipeline: Pipeline) -> str:
    model, w = pipeline("model"), pipeline("contact").w
    C = dashpots(pipeline.scene, model)
    return input_deck(model, pipeline("mesh").materials, w=w, C=C)


def _solved(name: str, pipeline: Pipeline) -> Iterator[Comparison]:
    theirs = program.answer(_deck(pipeline))
    model, w = pipeline("model"), pipeline("contact").w
    hz = modes(model.K, model.M, 10).frequency_hz
    ratio = hz / theirs.frequency_hz[:10]
    worst = int(np.argmax(np.abs(ratio - 1)))
    yield compared(f"{name}, ten frequencies [Hz]", hz[worst], theirs.frequency_hz[worst],
                   allowed=PRINTED, source=SOURCE)  # fmt: skip
    compliance = w @ factorised(model.K).solve(w)
    yield compared(f"{name}, compliance at the contact [m/N]", compliance, theirs.compliance,
                   allowed=PRINTED, source=SOURCE)  # fmt: skip


def _entries(name: str, pipeline: Pipeline) -> Iterator[Comparison]:
    """K and M entry by entry, over their largest."""
    model, theirs = pipeline("model"), program.matrices(_deck(pipeline))
    at = np.searchsorted(model.free, theirs.dof)
    for letter, ours, other in (("K", model.K, theirs.K), ("M", model.M, theirs.M)):
        same = ours[at][:, at].tocoo()
        off = (same - other).tocoo()
        worst = int(np.argmax(np.abs(off.data)))
        i, j = off.row[worst], off.col[worst]
        a, b = same.tocsr()[i, j], other[i, j]
        yield compared(f"{name}, {letter} entry by entry", a, b, allowed=1e-10,
                       of=float(abs(other).max()), source=f"{SOURCE}, MATRIXSTORAGE")  # fmt: skip


def _response(name: str, pipeline: Pipeline) -> Iterator[Comparison]:
    """Of forty modes: their steady state takes no others, and no residual vector."""
    n, zeta = 40, 0.01
    f, theirs = program.receptance(_deck(pipeline), n_modes=n, zeta=zeta, span_hz=(20.0, 2e4))
    model, w = pipeline("model"), pipeline("contact").w
    found = modes(model.K, model.M, n)
    omega, participation = found.omega[:, None], (w @ found.phi)[:, None]
    at = 2 * np.pi * f
    ours = np.sum(participation**2 / (omega**2 - at**2 + 2j * zeta * omega * at), axis=0)
    name += f", receptance of {n} modes to 20 kHz [m/N]"
    source = "CalculiX, *STEADY STATE DYNAMICS"
    worst = int(np.argmax(np.abs(ours / theirs - 1)))
    difference = float(np.abs(ours[worst] / theirs[worst] - 1))
    yield Comparison(
        name, abs(ours[worst]), abs(theirs[worst]), difference, 1e-4, source
    )  # fmt: skip


def _another_mesh() -> Iterator[Comparison]:
    """gmsh's tetrahedra in CalculiX beside our hexahedra, within what finer elements change."""
    coarse, fine = (_first_modes(_pipeline("cantilever", (f"mesh.scale={s}",))) for s in (1, 0.5))
    theirs = [
        program.answer(
            _deck(_pipeline("cantilever", ("mesh.element=tet", f"mesh.scale={s}")))
        ).frequency_hz[:10]
        for s in (1, 0.5)
    ]
    allowed = np.abs(coarse / fine - 1) + np.abs(theirs[0] / theirs[1] - 1)
    off = np.abs(fine / theirs[1] - 1)
    worst = int(np.argmax(off / allowed))
    name, source = "cantilever, hexahedra beside tetrahedra [Hz]", "CalculiX on gmsh's tetrahedra"
    difference, bound = float(off[worst]), float(allowed[worst])
    yield Comparison(name, fine[worst], theirs[1][worst], difference, bound, source)


def _first_modes(pipeline: Pipeline) -> np.ndarray:
    model = pipeline("model")
    return modes(model.K, model.M, 10).frequency_hz
