"""The meshed assembly and its modes as `modes.vtu`, for ParaView and for the pictures."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh
from skfem.io.meshio import to_meshio


class ModeField(NamedTuple):
    """Modes at the vertices of the mesh."""

    mesh: Mesh
    body: NDArray[np.int32]  # (n_cells,) index into body_names
    body_names: tuple[str, ...]
    number: NDArray[np.int64]  # (k,) of the hammer-test mode
    frequency_hz: NDArray[np.float64]  # (k,)
    displacement: NDArray[np.float64]  # (k, n_vertices, 3) mass-normalised


def write(path: Path, field: ModeField) -> None:
    """Write the mesh with the body of each cell and a vector field per mode."""
    modes = zip(field.number, field.frequency_hz, field.displacement, strict=True)
    content = to_meshio(
        field.mesh,
        {f"mode {i}: {hz:.4g} Hz": u for i, hz, u in modes},
        {"body": [field.body]},
        encode_cell_data=False,
        encode_point_data=False,
    )
    content.write(path, file_format="vtu")
