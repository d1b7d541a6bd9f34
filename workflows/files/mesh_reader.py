"""A mesh of the user's own, read in a child."""

from collections.abc import Sequence
from pathlib import Path

from beadwave.geometry import CellGroup, InvalidGeometry
from beadwave.geometry.own_mesh.cell_groups import MeshFile, Origin
from beadwave.geometry.own_mesh.named_cells import OwnVolumes, volumes
from beadwave.workflows.files.foreign import Unreadable, arrays
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import require_file


def volumes_of(path: Path, chosen: Sequence[str] = (), merge: float | None = None) -> OwnVolumes:
    """The bodies of a mesh file, those `chosen` or all, with nodes nearer than `merge` [m] merged;
    raises InvalidScene for what is no mesh and for the faults of
    `geometry.own_mesh.named_cells`."""
    require_file(path, "give a mesh that gmsh or meshio read", key="mesh: ")
    try:
        content = arrays("mesh", path)
    except Unreadable as error:
        raise InvalidScene(
            f"{str(path)!r} cannot be read as a mesh ({error}); give a file that gmsh or meshio "
            "read."
        ) from None
    groups = []
    for i, words in enumerate(content["names"]):
        dimension, origin, name = str(words).split(" ", 2)
        groups.append(CellGroup(name, int(dimension), content[f"cells{i}"], Origin(int(origin))))
    try:
        file = MeshFile(content["points"], groups)
        return volumes(file, str(path), chosen=chosen, merge=merge)
    except InvalidGeometry as error:
        raise InvalidScene(str(error)) from None
