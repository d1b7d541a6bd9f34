"""The files that a run folder has of an assembly, made once and kept: a run whose results are kept
loads no finite elements to write them."""

from pathlib import Path
from tempfile import TemporaryDirectory

import rom
from fem import mode_field
from fem.assembly_modes import AssemblyModes
from workflows.scene import Scene
from workflows.stages.response import Response, save_response
from workflows.stages.walls import save


def mode_files(scene: Scene, modes: AssemblyModes) -> dict[str, bytes]:
    """Content of modes.vtu, by its name."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "modes.vtu")
        mode_field.write(path, modes.field)
        return {path.name: path.read_bytes()}


def model_files(scene: Scene, reduction: rom.ReducedModel) -> dict[str, bytes]:
    """Content of rom.npz and rom.mat, by name."""
    with TemporaryDirectory() as folder:
        paths = Path(folder, "rom.npz"), Path(folder, "rom.mat")
        for path in paths:
            save(path, reduction, scene.damping)
        return {path.name: path.read_bytes() for path in paths}


def response_files(scene: Scene, response: Response) -> dict[str, bytes]:
    """Content of response.npz and its picture, by name."""
    with TemporaryDirectory() as folder:
        path = Path(folder, "response.npz")
        save_response(path, response.found)
        picture = response.picture
        return {path.name: path.read_bytes(), f"figures/{picture.name}.png": picture.png}
