"""Arrays by name as the content of a .npz file."""

from io import BytesIO

import numpy as np
from numpy.typing import ArrayLike


def npz(arrays: dict[str, ArrayLike]) -> bytes:
    """Content of a compressed .npz file of arrays of any shape by their names."""
    file = BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()
