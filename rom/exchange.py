"""Reduced models in files: .npz, .mat for MATLAB, .h5; and models made elsewhere.

Every format holds K, M, w, and where known C and T, under these names; w is a column in .mat.
kind, n_boundary, n_residual and provenance (JSON text: jsondecode in MATLAB) stand beside them.
A file with K, M and w alone is a model made elsewhere and reads as kind "imported".
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from zipfile import BadZipFile, is_zipfile

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.io import loadmat, savemat
from scipy.io.matlab import MatReadError

from rom.factorisation import ReductionError, symmetric
from rom.reduced_model import ReducedModel, contact_functional

ARRAYS = ("K", "M", "C", "w", "T")


def save_npz(path: str | Path, reduced: ReducedModel, *, basis: bool = True) -> None:
    """Write a reduced model to .npz; basis=False leaves T out."""
    with open(path, "wb") as file:
        np.savez(file, **_fields(reduced, basis))


def load_npz(path: str | Path, *, w: ArrayLike | None = None) -> ReducedModel:
    """Read a reduced model from .npz; w (r,) where the file has none.

    Raises FileNotFoundError, or ReductionError if the content is not a reduced model.
    """
    return _model(_readable(path, "npz", lambda: _archive(path)), path, w)


def _archive(path: str | Path) -> dict[str, np.ndarray]:
    with open(path, "rb") as file:
        if not is_zipfile(file):
            raise BadZipFile("it is no whole zip archive")
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


def save_mat(path: str | Path, reduced: ReducedModel, *, basis: bool = True) -> None:
    """Write a reduced model to a level 5 .mat file; basis=False leaves T out."""
    with open(path, "wb") as file:
        savemat(file, _fields(reduced, basis), oned_as="column", do_compression=True)


def load_mat(path: str | Path, *, w: ArrayLike | None = None) -> ReducedModel:
    """Read K, M[, C][, w] from a .mat file, ours or a foreign one; w (r,) where it has none.

    Raises FileNotFoundError, or ReductionError if the content is not a reduced model.
    """
    content = _readable(path, "mat", lambda: loadmat(str(path), appendmat=False))
    return _model({k: v for k, v in content.items() if not k.startswith("__")}, path, w)


def save_h5(path: str | Path, reduced: ReducedModel, *, basis: bool = True) -> None:
    """Write a reduced model to HDF5, one dataset an array. Needs h5py."""
    import h5py

    with h5py.File(path, "w") as file:
        for name, value in _fields(reduced, basis).items():
            file[name] = value


def load_h5(path: str | Path, *, w: ArrayLike | None = None) -> ReducedModel:
    """Read a reduced model from HDF5; w (r,) where the file has none. Needs h5py.

    Raises FileNotFoundError, or ReductionError if the content is not a reduced model.
    """
    import h5py

    def content() -> dict[str, object]:
        with h5py.File(path, "r") as file:
            return {name: file[name][()] for name in file}

    return _model(_readable(path, "HDF5", content), path, w)


def _fields(reduced: ReducedModel, basis: bool) -> dict[str, object]:
    arrays = {name: getattr(reduced, name) for name in ARRAYS if basis or name != "T"}
    return (
        {name: A for name, A in arrays.items() if A is not None}
        | {
            "kind": reduced.kind,
            "n_boundary": reduced.n_boundary,
            "n_residual": reduced.n_residual,
            "provenance": json.dumps(reduced.provenance),
        }
        | ({} if reduced.error is None else {"error": reduced.error})
    )


def _readable(path: str | Path, format_name: str, read: Callable):
    try:
        return read()
    except FileNotFoundError:
        raise
    except NotImplementedError:
        raise ReductionError(
            f"{path} is a MATLAB 7.3 file; save it with '-v7', or as .h5 with K, M and w in it."
        ) from None
    except (OSError, ValueError, TypeError, EOFError, BadZipFile, MatReadError) as broken:
        raise ReductionError(f"{path} cannot be read as {format_name}: {broken}") from broken


def _model(content: Mapping[str, object], path: str | Path, w: ArrayLike | None) -> ReducedModel:
    try:
        return _consistent(_read(content, path, w), path)
    except ReductionError:
        raise
    except (ValueError, TypeError, IndexError) as odd:
        raise ReductionError(f"{path} is not a reduced model: {odd}.") from odd


def _read(content: Mapping[str, object], path: str | Path, w: ArrayLike | None) -> ReducedModel:
    matrices = {name: _matrix(content, name, path) for name in ("K", "M", "C")}
    for name in ("K", "M"):
        if matrices[name] is None:
            raise ReductionError(
                f"{path} holds no matrix named {name}; it has {sorted(content) or 'nothing'}."
            )
    r = len(matrices["K"])
    w = content.get("w") if w is None else w
    if w is None:
        raise ReductionError(f"{path} holds no w; pass the {r} weights of the contact.")
    return ReducedModel(
        **matrices,
        w=contact_functional(_real(w, path), r),
        T=_basis(content),
        kind=_text(content, "kind", "imported"),
        n_boundary=int(np.ravel(content.get("n_boundary", 0))[0]),
        provenance=_notes(content, path),
        n_residual=int(np.ravel(content.get("n_residual", 0))[0]),
        error=float(np.ravel(content["error"])[0]) if "error" in content else None,
    )


def _matrix(content: Mapping[str, object], name: str, path: str | Path) -> np.ndarray | None:
    if name not in content:
        return None
    A = content[name]
    dense = A.toarray() if sp.issparse(A) else np.asarray(A)
    if dense.dtype.kind not in "fiu" or dense.ndim != 2 or dense.size == 0:
        raise ReductionError(f"{path}: {name} is not a real matrix (shape {dense.shape}).")
    symmetric(dense, f"{path}: {name}")
    return np.array(dense, dtype=float)


def _real(w: object, path: str | Path) -> np.ndarray:
    values = np.ravel(w.toarray() if sp.issparse(w) else w)
    if np.iscomplexobj(values):
        raise ReductionError(f"{path}: w is complex; the weights of a contact are real.")
    return values.astype(float)


def _notes(content: Mapping[str, object], path: str | Path) -> dict[str, str]:
    notes = json.loads(_text(content, "provenance", "{}"))
    if not isinstance(notes, dict):
        raise ReductionError(f"{path}: provenance is {notes!r}; it must be a JSON object of notes.")
    return notes


def _basis(content: Mapping[str, object]) -> np.ndarray | None:
    T = content.get("T")
    return None if T is None else np.array(T.toarray() if sp.issparse(T) else T, dtype=float)


def _text(content: Mapping[str, object], name: str, default: str) -> str:
    text = np.ravel(content.get(name, default))[0]
    return text.decode() if isinstance(text, bytes) else str(text)


def _consistent(reduced: ReducedModel, path: str | Path) -> ReducedModel:
    r = len(reduced.w)
    for name in ("M", "C"):
        A = getattr(reduced, name)
        if A is not None and A.shape != (r, r):
            raise ReductionError(f"{path}: {name} is {A.shape[0]} x {A.shape[1]}, K is {r} x {r}.")
    for name in ("n_boundary", "n_residual"):
        if not 0 <= getattr(reduced, name) <= r:
            raise ReductionError(
                f"{path}: {name} is {getattr(reduced, name)}; it must be from 0 to {r}."
            )
    if reduced.T is not None and reduced.T.shape[1] != r:
        raise ReductionError(f"{path}: T has {reduced.T.shape[1]} columns, K is {r} x {r}.")
    return reduced
