"""The further functionals of a reduced model as fields of a file.

w (r, 3) of a contact with friction; w_load (r, s) and w_sense (r, m) with their names;
half_space_matrix_m_per_N and contact_axes (3, 3).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from beadwave.rom.factorisation import ReductionError
from beadwave.rom.reduced_model import Columns, ReducedModel

MATRICES = {"half_space": "half_space_matrix_m_per_N", "axes": "contact_axes"}
GROUPS = {"load": "shaker", "sense": "sensor"}


def column_fields(reduced: ReducedModel) -> dict[str, object]:
    """The further functionals by their names in a file; what the model does not know is left out.

    w (r, 3) along n, t1, t2, only of a contact with friction: it replaces the single column;
    w_load (r, s), w_sense (r, m) with load_names and sense_names; half_space_matrix_m_per_N (3, 3)
    [m/N] and contact_axes (3, 3), unit vectors in rows. Empty without columns.
    """
    columns, fields = reduced.columns, {}
    if columns is None:
        return fields
    if columns.across is not None:
        fields["w"] = np.column_stack([reduced.w, columns.across])
    fields |= {name: getattr(columns, field) for field, name in MATRICES.items()}
    for group in GROUPS:
        fields[f"w_{group}"] = getattr(columns, group)
        names = getattr(columns, f"{group}_names")
        fields[f"{group}_names"] = np.array(names) if names else None
    return {name: value for name, value in fields.items() if value is not None}


def contact_columns(
    w: np.ndarray, r: int, path: str | Path
) -> tuple[np.ndarray, np.ndarray | None]:
    """w (r,) along the normal and, of three columns, those along t1 and t2 (r, 2), else None.

    Raises ReductionError for what is neither one column nor three, complex or not finite.
    """
    if np.iscomplexobj(w):
        raise ReductionError(f"{path}: w is complex; the weights of a contact are real.")
    if w.size == r:
        return np.ravel(w).astype(float), None
    if w.shape not in ((r, 3), (3, r)):
        raise ReductionError(
            f"{path}: w has shape {w.shape}, allowed for {r} coordinates are ({r},), along the "
            f"normal, and ({r}, 3), along the normal and two directions of the face."
        )
    w = _real(w if w.shape == (r, 3) else w.T, "w", path)
    return w[:, 0], w[:, 1:]


def columns_of(
    content: Mapping[str, object], across: np.ndarray | None, r: int, path: str | Path
) -> Columns | None:
    """The further functionals that a file holds, None without any.

    content holds the file's arrays by name; across (r, 2) comes from `contact_columns` and is None
    of a contact known along its normal only, whose matrices (3, 3) are then not read. A vector (r,)
    counts as one column; shakers and sensors without names are numbered. Raises ReductionError for
    values that are complex, not finite or of another shape, for a half-space's matrix that is no
    compliance, and for another number of names than of columns.
    """
    # matrices of the three directions n, t1, t2
    fields: dict[str, object] = {"across": across}
    for field, name in MATRICES.items():
        if name in content and across is not None:
            fields[field] = _real(content[name], name, path)
            if fields[field].shape != (3, 3):
                shape = fields[field].shape
                raise ReductionError(f"{path}: {name} has shape {shape}, allowed is (3, 3).")
    half_space = fields.get("half_space")
    if half_space is not None:
        # it is taken off the structure, since the contact's laws hold it once more; with a negative
        # eigenvalue that would add compliance in some direction, unsymmetric it would make energy
        size = np.abs(half_space).max()
        lowest = float(np.linalg.eigvalsh((half_space + half_space.T) / 2)[0])
        if np.abs(half_space - half_space.T).max() > 1e-9 * size or lowest < -1e-9 * size:
            raise ReductionError(
                f"{path}: half_space_matrix_m_per_N is no compliance, which is symmetric and has "
                f"eigenvalues >= 0; the lowest is {lowest:.3g}. Write another, or leave it out."
            )

    # shakers and sensors, a column each; h5 and mat hand a single one over as a vector
    for group, kind in GROUPS.items():
        if f"w_{group}" not in content:
            continue
        W = _real(content[f"w_{group}"], f"w_{group}", path)
        W = W[:, None] if W.ndim == 1 else W
        if W.ndim != 2 or len(W) != r:
            raise ReductionError(
                f"{path}: w_{group} has shape {W.shape}, allowed is ({r}, m), a column for each "
                f"{kind}."
            )
        names = np.ravel(content.get(f"{group}_names", ()))
        names = tuple(_name(name) for name in names) or tuple(
            f"{kind} {j}" for j in range(1, W.shape[1] + 1)
        )
        if len(names) != W.shape[1]:
            raise ReductionError(
                f"{path}: {group}_names has {len(names)} names for the {W.shape[1]} columns of "
                f"w_{group}; give one each."
            )
        fields |= {group: W, f"{group}_names": names}
    return Columns(**fields) if any(value is not None for value in fields.values()) else None


def _real(values: object, name: str, path: str | Path) -> np.ndarray:
    """The values as an array; raises ReductionError for what is no real number or not finite."""
    A = values.toarray() if sp.issparse(values) else np.asarray(values)
    if A.dtype.kind not in "fiu" or not np.isfinite(A).all():
        raise ReductionError(f"{path}: {name} holds what is no finite real number; write it anew.")
    return A.astype(float)


def _name(name: object) -> str:
    """A name, also one as bytes (HDF5), in a cell (MATLAB) or filled up with blanks."""
    if isinstance(name, np.ndarray):
        name = np.ravel(name)[0]
    return (name.decode() if isinstance(name, bytes) else str(name)).rstrip()
