"""The meshed assembly and its modes as `modes.vtu`, for ParaView and for the pictures."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from meshio import Mesh as Grid
from numpy.typing import NDArray
from skfem import Mesh, MeshHex, MeshTet
from skfem.io.meshio import to_meshio

MEASURED = "measured"


class ModeField(NamedTuple):
    """Modes at the vertices of the bodies, one body after the other."""

    meshes: dict[str, Mesh]
    number: NDArray[np.int64]  # (k,) among the computed ones, from 1
    frequency_hz: NDArray[np.float64]  # (k,)
    displacement: NDArray[np.float32]  # (k, n_vertices, 3) mass-normalised
    target: NDArray[np.int64]  # (k,) the measured mode that it is, from 1; 0 for none

    @property
    def names(self) -> list[str]:
        """Names of the modes in the file."""
        names = []
        for i, hz, t in zip(self.number, self.frequency_hz, self.target, strict=True):
            # from 10 kHz on, four digits would be written with a power of ten
            digits = f"{hz:.0f}" if hz >= 9999.5 else f"{hz:.4g}"
            names.append(f"mode {i}: {digits} Hz{f', {MEASURED} {t}' if t else ''}")
        return names


def write(path: Path, field: ModeField) -> None:
    """Write the meshes with the body of each cell, counted from 0, and a vector field per mode.

    The first mode is the active vector field: ParaView's Warp By Vector takes it unasked. meshio
    writes no such attribute, so it is put into the file's text afterwards.
    """
    bodies = [
        to_meshio(_of_corners(mesh), encode_cell_data=False, encode_point_data=False)
        for mesh in field.meshes.values()
    ]
    first = np.cumsum([0, *(len(body.points) for body in bodies)])
    blocks = [
        (c.type, n + c.data) for n, body in zip(first, bodies, strict=False) for c in body.cells
    ]
    grid = Grid(
        np.concatenate([body.points for body in bodies]),
        blocks,
        dict(zip(field.names, field.displacement, strict=True)),
        {"body": [np.full(len(cells), i, np.int32) for i, (_, cells) in enumerate(blocks)]},
    )
    grid.write(path, file_format="vtu")
    if field.names:
        raw = path.read_bytes()
        active = f'<PointData Vectors="{field.names[0]}">'.encode()
        path.write_bytes(raw.replace(b"<PointData>", active, 1))


def _of_corners(mesh: Mesh) -> Mesh:
    """The mesh without the middles of curved edges: modes are drawn at its vertices."""
    if mesh.doflocs.shape[1] == mesh.nvertices:
        return mesh
    return (MeshHex if isinstance(mesh, MeshHex) else MeshTet)(mesh.p[:, : mesh.nvertices], mesh.t)
