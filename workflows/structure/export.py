"""Models for other programs: input deck, geometry, reduced matrices."""

from beadwave import rom
from beadwave.fem.exchange.abaqus import input_deck
from beadwave.workflows.files.output_file import OutputFile
from beadwave.workflows.files.wall_file import require_reader
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.body_shapes import shapes
from beadwave.workflows.stages.chain.walls import save
from beadwave.workflows.stages.engine.pipeline import Pipeline
from beadwave.workflows.stages.structure.assembly import dashpots

FORMATS = (".npz", ".mat", ".h5")
FULL_FORMATS = (".mat", ".npz")


def write_model(pipeline: Pipeline, inp: OutputFile | None, step: OutputFile | None) -> None:
    """The model as an input deck for CalculiX or Abaqus, the geometry as STEP; raises InvalidScene
    for parts that a deck does not hold, and for geometry that came from a file."""
    scene = pipeline.scene
    if step and step.path.suffix.lower() not in (".step", ".stp"):
        raise InvalidScene(f"--step {step.path} must end in .step or .stp.")
    for table in ("masses", "springs", "measured"):
        if inp and getattr(scene, table):
            raise InvalidScene(
                f"{scene.name}: [[{table}]] are not written to --inp; drop them, or take the "
                "matrices of beadwave reduce --matrices."
            )
    if inp:
        model = pipeline("model")
        struck = scene.bending is not None or scene.strike is not None
        w, materials = pipeline("contact").w if struck else None, pipeline("mesh").materials
        text = input_deck(model, materials, w=w, C=dashpots(scene, model))
        with inp.writing() as path:
            path.write_text(text, encoding="utf-8", newline="\n")
    if step:
        from beadwave.geometry.cad.occ import write_step

        if scene.assembly is not None and scene.assembly.file:
            raise InvalidScene(
                f"{scene.name} has its geometry from {scene.assembly.file}; copy that."
            )
        with step.writing() as path:
            write_step(shapes(scene), path)


def write_reduced(pipeline: Pipeline, out: OutputFile, matrices: OutputFile | None = None) -> None:
    """Write the reduced model, and to `matrices` the full model; raises InvalidScene for an unknown
    ending."""
    require_formats(out, matrices)
    reduced = pipeline("reduction")
    with out.writing() as path:
        save(path, reduced, pipeline.scene.damping)
    if matrices:
        with matrices.writing() as path:
            rom.save_full(path, full_matrices(pipeline))


def require_formats(out: OutputFile, matrices: OutputFile | None = None) -> None:
    """Raise InvalidScene for endings that no format has, or that nothing here writes."""
    if out.path.suffix not in FORMATS:
        raise InvalidScene(f"--out {out.path} must end in one of {', '.join(FORMATS)}.")
    if matrices and matrices.path.suffix not in FULL_FORMATS:
        raise InvalidScene(f"--matrices {matrices.path} must end in {' or '.join(FULL_FORMATS)}.")
    require_reader(out.path)


def full_matrices(pipeline: Pipeline) -> dict:
    """K, M, w and where there are dashpots C of the joined and held model on its free unknowns:
    T_mesh gives the mesh's displacements, x, y, z of node 1, then of node 2, ... of mesh_points."""
    model, C = pipeline("model"), dashpots(pipeline.scene, pipeline("model"))
    bends = pipeline.scene.bending is not None
    points = model.drawn.p.T if bends else model.structure.points
    matrices = {"K": model.K, "M": model.M, "w": pipeline("contact").w}
    matrices |= {"T_mesh": model.T, "mesh_points": points}
    return matrices if C is None else matrices | {"C": C}
