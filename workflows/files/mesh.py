"""A mesh of the user's own, read in a child."""

from pathlib import Path

from skfem import Mesh

from geometry import CellGroup, InvalidGeometry
from geometry.named_cells import NamedCells, volumes
from workflows.files.foreign import Unreadable, arrays
from workflows.scene import InvalidScene
from workflows.scene.named_files import require_file


def volumes_of(path: Path) -> dict[str, Mesh]:
    """Every named volume of a file as a mesh of its own; raises InvalidScene for what is no mesh
    and where there is no such volume."""
    require_file(path, "give a mesh that gmsh or meshio read", key="mesh: ")
    try:
        content = arrays("mesh", path)
    except Unreadable as error:
        raise InvalidScene(
            f"{str(path)!r} cannot be read as a mesh ({error}); give a file that gmsh or meshio "
            "read."
        ) from None
    groups = [
        CellGroup(name, int(dimension), content[f"cells{i}"])
        for i, (dimension, name) in enumerate(str(n).split(" ", 1) for n in content["names"])
    ]
    try:
        return volumes(NamedCells(str(path), content["points"], groups))
    except InvalidGeometry as error:
        raise InvalidScene(str(error)) from None
