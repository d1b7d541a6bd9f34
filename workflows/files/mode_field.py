"""The meshed assembly and its modes as `modes.vtu`, for ParaView and for the pictures."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from meshio import Mesh as Grid
from numpy.typing import NDArray
from skfem import Mesh
from skfem.io.meshio import to_meshio


class ModeField(NamedTuple):
    """Modes at the vertices of the bodies, one body after the other."""

    meshes: dict[str, Mesh]
    number: NDArray[np.int64]  # (k,) of the hammer-test mode
    frequency_hz: NDArray[np.float64]  # (k,)
    displacement: NDArray[np.float64]  # (k, n_vertices, 3) mass-normalised


def write(path: Path, field: ModeField) -> None:
    """Write the meshes with the body of each cell, counted from 0, and a vector field per mode."""
    modes = zip(field.number, field.frequency_hz, field.displacement, strict=True)
    bodies = [
        to_meshio(mesh, encode_cell_data=False, encode_point_data=False)
        for mesh in field.meshes.values()
    ]
    first = np.cumsum([0, *(len(body.points) for body in bodies)])
    blocks = [
        (c.type, n + c.data) for n, body in zip(first, bodies, strict=False) for c in body.cells
    ]
    whole = Grid(
        np.concatenate([body.points for body in bodies]),
        blocks,
        {f"mode {i}: {hz:.4g} Hz": u for i, hz, u in modes},
        {"body": [np.full(len(cells), i, np.int32) for i, (_, cells) in enumerate(blocks)]},
    )
    whole.write(path, file_format="vtu")
