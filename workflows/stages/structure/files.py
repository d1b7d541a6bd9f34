"""The files that a run folder has of an assembly, made once and kept: a run whose results are kept
loads no finite elements to write them."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from beadwave import rom
from beadwave.fem.modes import mode_field
from beadwave.fem.modes.assembly_modes import AssemblyModes
from beadwave.workflows.files.npz import npz
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.walls import save
from beadwave.workflows.stages.errors.mesh_error import MeshErrorEstimate
from beadwave.workflows.stages.structure import sizes_file
from beadwave.workflows.stages.structure.meshed_parts import AdaptedSizes, Parts
from beadwave.workflows.stages.structure.response import Response


def mode_files(scene: Scene, modes: AssemblyModes) -> dict[str, bytes]:
    """Content of modes.vtu, by its name."""
    return written({"modes.vtu": lambda path: mode_field.write(path, modes.field)})


def model_files(scene: Scene, reduction: rom.ReducedModel) -> dict[str, bytes]:
    """Content of rom.npz and rom.mat, by name."""
    write = partial(save, reduced=reduction, table=scene.damping)
    return written({"rom.npz": write, "rom.mat": write})


def size_files(scene: Scene, adapted: AdaptedSizes) -> dict[str, bytes]:
    """Content of sizes.npz, by its name."""
    return {"sizes.npz": npz(sizes_file.arrays_of(adapted))}


def missed_files(scene: Scene, mesh: Parts, missed: MeshErrorEstimate) -> dict[str, bytes]:
    """Content of missed.npz, by its name; none of a mesh of few elements."""
    if not missed.of_cells:
        return {}
    content = {}
    for body, energy in missed.of_cells.items():
        of_body = mesh.meshes[body]
        content |= {f"energy.{body}": energy, f"points.{body}": of_body.p.T[: of_body.nvertices]}
        content[f"cells.{body}"] = of_body.t.T
    return {"missed.npz": npz(content)}


def response_files(scene: Scene, response: Response) -> dict[str, bytes]:
    """Content of response.npz and its picture, by name."""
    return {
        "response.npz": npz(response.found._asdict()),
        f"figures/{response.picture.name}.png": response.picture.png,
    }


def written(writers: dict[str, Callable[[Path], None]]) -> dict[str, bytes]:
    """Content of files, by name, each as its function writes it to a path of that name."""
    with TemporaryDirectory() as folder:
        for name, write in writers.items():
            write(Path(folder, name))
        return {name: Path(folder, name).read_bytes() for name in writers}
