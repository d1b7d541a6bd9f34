"""Models for other programs: input deck, geometry, reduced matrices."""

from pathlib import Path

import rom
from fem.abaqus import input_deck
from geometry.rig import shapes
from workflows.files.run_folder import writing_file
from workflows.files.wall import require_reader
from workflows.pipeline.assembly import dashpots, materials
from workflows.pipeline.pipeline import Pipeline
from workflows.pipeline.wall import save
from workflows.scene import InvalidScene
from workflows.scene.assembly import assembly

FORMATS = (".npz", ".mat", ".h5")
FULL_FORMATS = (".mat", ".npz")


def write_model(pipeline: Pipeline, inp: Path | None, step: Path | None) -> None:
    """The model as an input deck for CalculiX or Abaqus, the geometry as STEP."""
    scene = pipeline.scene
    if step and step.suffix.lower() not in (".step", ".stp"):
        raise InvalidScene(f"--step {step} must end in .step or .stp.")
    if inp:
        model = pipeline("model")
        steel = materials(scene.assembly, model.structure.basis)
        text = input_deck(model, steel, w=pipeline("contact").w, C=dashpots(scene, model))
        with writing_file(inp) as part:
            part.write_text(text, encoding="utf-8")
    if step:
        from geometry.cad import write_step

        with writing_file(step) as part:
            write_step(shapes(assembly(scene.assembly)), part)


def write_reduced(pipeline: Pipeline, path: Path, matrices: Path | None = None) -> None:
    """Write the reduced model, and to `matrices` the model it is made of; raises InvalidScene for
    an unknown ending."""
    if path.suffix not in FORMATS:
        raise InvalidScene(f"--out {path} must end in one of {', '.join(FORMATS)}.")
    if matrices and matrices.suffix not in FULL_FORMATS:
        raise InvalidScene(f"--matrices {matrices} must end in {' or '.join(FULL_FORMATS)}.")
    require_reader(path)
    reduced = pipeline("reduction")
    with writing_file(path) as part:
        save(part, reduced, pipeline.scene.damping)
    if matrices:
        with writing_file(matrices) as part:
            rom.save_full(part, full_matrices(pipeline))


def full_matrices(pipeline: Pipeline) -> dict:
    """K, M, w and where there are dashpots C of the joined and held model on its free unknowns:
    T_mesh gives the mesh's displacements, x, y, z of node 1, then of node 2, ... of mesh_points."""
    model, C = pipeline("model"), dashpots(pipeline.scene, pipeline("model"))
    points = model.structure.points
    found = {"K": model.K, "M": model.M, "w": pipeline("contact").w}
    found |= {"T_mesh": model.T, "mesh_points": points}
    return found if C is None else found | {"C": C}
