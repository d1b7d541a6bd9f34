"""Arrays in few bytes, as the page reads them: base64, columns of 8 or 16 bits with a scale."""

from base64 import b64decode, b64encode
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

TOP = {"i1": 127, "i2": 32767}


def quantised(columns: ArrayLike, bits: str = "i2") -> dict[str, Any]:
    """Columns (n, k) as integers, each in units of its own largest value over TOP."""
    values = np.asarray(columns, dtype=float)
    scale = np.abs(values).max(axis=0, initial=0.0) / TOP[bits]
    steps = np.rint(values / np.where(scale > 0, scale, 1.0)).astype(f"<{bits}")
    return {**_packed(steps, bits), "scale": scale.tolist()}


def whole(values: NDArray[np.integer]) -> dict[str, Any]:
    """Whole numbers (n, ...) >= 0 in as few bytes as they need."""
    largest = values.max(initial=0)
    kind = next(kind for kind in ("u1", "u2", "u4") if largest <= np.iinfo(kind).max)
    return _packed(values.astype(f"<{kind}"), kind)


def packed_integers(values: ArrayLike, bits: str) -> dict[str, Any]:
    """Whole numbers (n, ...) of 8 or 16 bits, which may be negative."""
    return _packed(np.asarray(values).astype(f"<{bits}"), bits)


def floats(values: ArrayLike) -> dict[str, Any]:
    """Numbers (n, ...) in single precision."""
    return _packed(np.asarray(values, dtype="<f4"), "f4")


def _packed(values: NDArray, kind: str) -> dict[str, Any]:
    data = b64encode(np.ascontiguousarray(values).tobytes()).decode()
    return {"kind": kind, "shape": list(values.shape), "data": data}


def unpacked(packed: dict[str, Any]) -> NDArray:
    """The numbers that `floats` or `whole` packed, in their shape."""
    raw = b64decode(packed["data"])
    return np.frombuffer(raw, f"<{packed['kind']}").reshape(packed["shape"])
