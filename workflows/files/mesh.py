"""A mesh of the user's own in place of ours: what gmsh or meshio read, with our names on it.

Volumes are named as the bodies ("block", "sheet+y", ...), in gmsh as physical groups. Surfaces may
be named as the faces ("block:+x", "sheet+y:head", ...); those that are not are looked for where
the dimensions of [assembly] put them. Touching parts must not share nodes. Elements of any order
are taken by their corners; what is in no body of ours is left out.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh, MeshHex, MeshTet
from skfem.io.meshio import INV_HEX_MAPPING

import geometry
from geometry import Assembly, CellGroup, Interface
from workflows.files.foreign import Unreadable, arrays
from workflows.scene import InvalidScene, nearest
from workflows.scene.named_files import require_file

KINDS = {4: MeshTet, 8: MeshHex}  # by the corners of a cell
CELLS = {4: "tetrahedra", 5: "pyramids", 6: "prisms", 8: "hexahedra"}


def mesh_of(path: Path, assembly: Assembly, faces: set[str]) -> Mesh:
    """The mesh of a file, edges straight; raises InvalidScene where it cannot stand for ours."""
    points, groups = _read(path)
    wanted = sorted(bodies(assembly))
    _require(path, "volume", set(wanted), {g.name for g in groups if g.dimension == 3})
    solid = _solid(path, points, {name: _cells(path, groups, name) for name in wanted})
    placed = geometry.named(solid.mesh, assembly, solid.body)
    placed = placed.with_boundaries(_facets(solid, groups))
    _require(path, "surface", faces, {n for n, f in placed.boundaries.items() if len(f)})
    return placed


def volumes_of(path: Path) -> dict[str, Mesh]:
    """Every named volume of a file as a mesh of its own, with the named surfaces on its outside;
    raises InvalidScene where there is none."""
    points, groups = _read(path)
    names = dict.fromkeys(g.name for g in groups if g.dimension == 3)
    cells = {name: _cells(path, groups, name) for name in names}
    if not cells:
        raise InvalidScene(
            f"{path} has no named volumes; name each body, in gmsh as a physical volume, elsewhere "
            "as a set of cells."
        )
    for kind in KINDS:
        of_kind = [t for t in cells.values() if t.shape[1] == kind]
        _require_once(path, np.concatenate([np.empty((0, kind), np.int64), *of_kind]))
    found = {}
    for name, t in cells.items():
        solid = _solid(path, points, {name: t})
        found[name] = solid.mesh.with_boundaries(_facets(solid, groups))
    return found


def _read(path: Path) -> tuple[NDArray[np.float64], list[CellGroup]]:
    """Points and named cells; raises InvalidScene for what is no mesh."""
    require_file(path, "give a mesh that gmsh or meshio read", key="mesh: ")
    try:
        found = arrays("mesh", path)
    except Unreadable as error:
        raise InvalidScene(
            f"{str(path)!r} cannot be read as a mesh ({error}); give a file that gmsh or meshio "
            "read."
        ) from None
    groups = [
        CellGroup(name, int(dimension), found[f"cells{i}"])
        for i, (dimension, name) in enumerate(str(n).split(" ", 1) for n in found["names"])
    ]
    return found["points"], groups


def _cells(path: Path, groups: list[CellGroup], body: str) -> NDArray[np.int64]:
    """Corners of a body's cells; raises InvalidScene for other cells than we compute with."""
    named = [g for g in groups if (g.name, g.dimension) == (body, 3)]
    kinds = sorted({g.corners.shape[1] for g in named})
    if len(kinds) > 1 or kinds[0] not in KINDS:
        told = " and ".join(CELLS.get(kind, f"cells of {kind} corners") for kind in kinds)
        raise InvalidScene(
            f"the mesh {str(path)!r} fills the volume {body!r} with {told}; give tetrahedra "
            "alone or hexahedra alone."
        )
    return np.concatenate([g.corners for g in named])


class _Solid(NamedTuple):
    """The bodies as one mesh, the cells of each, and where the points of the file are in it."""

    mesh: Mesh
    body: dict[str, NDArray[np.int64]]
    number: NDArray[np.int64]  # (n_points,) -1 of points that no body uses


def _solid(path: Path, points: NDArray[np.float64], cells: dict[str, NDArray[np.int64]]) -> _Solid:
    kinds = {t.shape[1]: name for name, t in cells.items()}
    if len(kinds) > 1:
        told = " and ".join(f"{name!r} with {CELLS[kind]}" for kind, name in kinds.items())
        raise InvalidScene(
            f"the mesh {str(path)!r} fills {told}; mesh all volumes with one of the two."
        )
    (n_corners,) = kinds
    used, t = np.unique(np.concatenate(list(cells.values())), return_inverse=True)
    t = t.reshape(-1, n_corners)
    _require_once(path, t)
    order = INV_HEX_MAPPING[:8] if n_corners == 8 else slice(None)
    mesh = KINDS[n_corners](*map(np.ascontiguousarray, (points[used].T, t.T[order])))
    ends = np.cumsum([0, *map(len, cells.values())])
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    return _Solid(mesh, {n: np.arange(*ends[i : i + 2]) for i, n in enumerate(cells)}, number)


def _require_once(path: Path, t: NDArray[np.int64]) -> None:
    """Raise InvalidScene where volumes overlap: their mass would count twice."""
    twice = len(t) - len(np.unique(np.sort(t, axis=1), axis=0))
    if twice:
        raise InvalidScene(
            f"the mesh {str(path)!r} has {twice} cells in two volumes; put each in one."
        )


def _facets(solid: _Solid, groups: list[CellGroup]) -> dict[str, NDArray[np.int64]]:
    """Facets on the boundary of the mesh, by the name of the surface that they belong to."""
    outer = solid.mesh.boundary_facets()
    own = np.sort(solid.mesh.facets[:, outer], axis=0).T
    found: dict[str, NDArray[np.int64]] = {}
    for name, dimension, corners in groups:
        if dimension == 2 and corners.shape[1] == own.shape[1]:
            asked = np.sort(solid.number[corners], axis=1)
            _, row = np.unique(np.concatenate([own, asked]), axis=0, return_inverse=True)
            met = outer[np.isin(row[: len(own)], row[len(own) :])]
            found[name] = np.union1d(found.get(name, met), met)
    return {name: facets for name, facets in found.items() if len(facets)}


def bodies(assembly: Assembly) -> set[str]:
    """Names that the volumes of a mesh must have."""
    sheets = {"sheet-y", "sheet+y"} if "sheets" in assembly.parts else set()
    return (set(assembly.parts) - {"sheets"}) | sheets


def faces(touching: tuple[Interface, ...], held: tuple[str, ...], struck: str) -> set[str]:
    """Names that the surfaces of a mesh must have for these interfaces."""
    joined = {f for t in touching for f in (t.slave, t.master, *t.screws, *t.halves)}
    return {*joined, *held, struck}


def _require(path: Path, what: str, wanted: set[str], found: dict) -> None:
    missing = sorted(wanted - set(found))
    if missing:
        raise InvalidScene(
            f"the mesh {str(path)!r} has no {what} named {missing[0]!r} "
            f"({len(missing)} of {len(wanted)} are missing), {nearest(missing[0], found or ['-'])}."
        )
