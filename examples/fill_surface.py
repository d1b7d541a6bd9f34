"""A closed surface of triangles, of a 3-D scan for instance, as a body.

You will see the volume of the mesh of tetrahedra that fills the surface beside the volume that the
triangles enclose, V = sum a . (b x c) / 6 over corners a, b, c seen counter-clockwise from outside:
they are equal where the surface is closed. The file is what assembly.mesh takes, in metres:

    [assembly]
    mesh = "part.msh"          # one body, called part
    held = ["part:-z"]

Run it: python examples/fill_surface.py scan.stl part.msh 1e-3     metres in a unit of the file
"""

import sys
from pathlib import Path

import gmsh
import numpy as np

from beadwave.geometry.meshing.gmsh_session import session


def filled(surface: Path, target: Path, metres: float = 1e-3) -> tuple[float, float]:
    """Write the mesh between the triangles; volumes [m^3] of mesh and surface. Raises ValueError
    for a surface that is not closed."""
    with session(f"{surface} could not be filled"):
        # corners of an STL stand once for each triangle: equal ones become one node
        gmsh.merge(str(surface))
        gmsh.model.mesh.removeDuplicateNodes()
        tags, points, _ = gmsh.model.mesh.getNodes()
        place = dict(zip(tags.tolist(), points.reshape(-1, 3), strict=True))
        _, corners = gmsh.model.mesh.getElementsByType(2)
        if not len(corners):
            raise ValueError(f"{surface} holds no triangles; give a closed surface as .stl.")

        # closed: every edge, whichever way it is named, has two triangles
        triangles = corners.reshape(-1, 3)
        edges = np.sort(np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)]), axis=1)
        n_open = int(np.sum(np.unique(edges, axis=0, return_counts=True)[1] != 2))
        if n_open:
            raise ValueError(
                f"{surface} is not closed: {n_open} edges do not have two triangles; close it "
                "first."
            )
        a, b, c = (
            np.array([place[tag] for tag in triangles.ravel()]).reshape(-1, 3, 3).swapaxes(0, 1)
        )
        enclosed = abs(float(np.sum(a * np.cross(b, c)))) / 6 * metres**3

        # tetrahedra inside, in the file's unit, and then in metres
        surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
        volume = gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(surfaces)])
        gmsh.model.geo.synchronize()
        gmsh.model.addPhysicalGroup(3, [volume], name=target.stem)
        gmsh.model.mesh.generate(3)
        scale = np.zeros((3, 4))
        scale[:, :3] = metres * np.eye(3)
        gmsh.model.mesh.affineTransform(scale.ravel().tolist())
        tetrahedra = gmsh.model.mesh.getElementsByType(4)[0]
        of_mesh = float(np.sum(gmsh.model.mesh.getElementQualities(tetrahedra, "volume")))
        gmsh.write(str(target))
    return of_mesh, enclosed


def main(surface: str = "scan.stl", target: str = "part.msh", metres: str = "1e-3") -> None:
    """Print both volumes."""
    of_mesh, enclosed = filled(Path(surface), Path(target), float(metres))
    print(f"volume of the mesh {1e9 * of_mesh:.6g} mm^3, of the surface {1e9 * enclosed:.6g} mm^3")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:4])
    except ValueError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
