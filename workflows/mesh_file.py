"""A mesh of the user's own in place of ours: any file that meshio reads, with our names on it.

Volumes are named as the bodies ("block", "sheet+y", ...), in gmsh as physical groups. Surfaces may
be named as the faces ("block:+x", "sheet+y:head", ...); those that are not are looked for where
the dimensions of [assembly] put them. Touching parts must not share nodes.
"""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
from skfem import Mesh, MeshHex, MeshTet

import geometry
from geometry import Assembly, Interface
from workflows.scene import InvalidScene, nearest


def mesh_of(path: Path, assembly: Assembly, faces: set[str]) -> Mesh:
    """The mesh of a file, edges straight; raises InvalidScene where it cannot stand for ours."""
    if not path.is_file():
        raise InvalidScene(f"mesh.file = {str(path)!r}: there is no such file.")
    try:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            mesh = Mesh.load(path)
    except (Exception, SystemExit) as error:  # meshio prints, and leaves the process
        raise InvalidScene(
            f"mesh.file = {str(path)!r} cannot be read as a mesh ({type(error).__name__}); "
            "give a file that meshio reads."
        ) from None
    mesh = _straight(mesh, path)
    _require(path, "volume", bodies(assembly), mesh.subdomains or {})
    given = {name: f for name, f in (mesh.boundaries or {}).items() if len(f)}
    body = {name: mesh.subdomains[name] for name in sorted(bodies(assembly))}
    placed = geometry.named(mesh, assembly, body).with_boundaries(given)
    _require(path, "surface", faces, {n: f for n, f in placed.boundaries.items() if len(f)})
    return placed


def bodies(assembly: Assembly) -> set[str]:
    """Names that the volumes of a mesh must have."""
    sheets = {"sheet-y", "sheet+y"} if "sheets" in assembly.parts else set()
    return (set(assembly.parts) - {"sheets"}) | sheets


def faces(touching: tuple[Interface, ...], held: tuple[str, ...], struck: str) -> set[str]:
    """Names that the surfaces of a mesh must have for these interfaces."""
    joined = {f for t in touching for f in (t.slave, t.master, *t.screws, *t.halves)}
    return {*joined, *held, struck}


def _straight(mesh: Mesh, path: Path) -> Mesh:
    for kind in (MeshTet, MeshHex):
        if isinstance(mesh, kind):
            corners, t = np.unique(mesh.t, return_inverse=True)
            plain = kind(np.ascontiguousarray(mesh.p[:, corners]), t.reshape(mesh.t.shape))
            return plain.with_subdomains(mesh.subdomains or {}).with_boundaries(
                mesh.boundaries or {}
            )
    raise InvalidScene(
        f"mesh.file = {str(path)!r} holds a {type(mesh).__name__}; give tetrahedra or hexahedra."
    )


def _require(path: Path, what: str, wanted: set[str], found: dict) -> None:
    missing = sorted(wanted - set(found))
    if missing:
        raise InvalidScene(
            f"mesh.file = {str(path)!r} has no {what} named {missing[0]!r} "
            f"({len(missing)} of {len(wanted)} are missing), {nearest(missing[0], found or ['-'])}."
        )
