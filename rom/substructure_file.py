"""Abaqus substructure matrices from .mtx: *SUBSTRUCTURE MATRIX OUTPUT, OUTPUT FILE=USER DEFINED.

    *USER ELEMENT, NODES=..., LINEAR
    ** ELEMENT NODES
    ** 101, 102, ...                 node numbers
    1, 2, 3                          degrees of freedom of the first node and those after it,
    2, 1                             until a line that begins with a node's position says otherwise
    *MATRIX,TYPE=STIFFNESS           lower triangle row by row; then TYPE=MASS, TYPE=VISCOUS DAMPING

Abaqus Keywords Reference, *USER ELEMENT and *MATRIX. Units are those of the file: take SI.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beadwave.rom.factorisation import ReductionError
from beadwave.rom.reduced_model import ReducedModel, contact_functional

NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")


class Substructure(NamedTuple):
    """K, M, C (r, r) or None, and the (node, dof) of every coordinate (r,)."""

    K: np.ndarray
    M: np.ndarray
    C: np.ndarray | None
    coordinates: tuple[tuple[int, int], ...]


def load_mtx(path: str | Path, w: ArrayLike | Mapping[tuple[int, int], float]) -> ReducedModel:
    """A reduced model from a substructure's .mtx; w (r,), or {(node, dof): weight}, whose other
    coordinates have none.

    Raises FileNotFoundError, or ReductionError with what is missing: a matrix, or a (node, dof)
    that the file does not name.
    """
    matrices = substructure(path)
    weights = w
    if isinstance(w, Mapping):
        coordinates = matrices.coordinates
        unknown = [name for name in w if name not in coordinates]
        if unknown:
            raise ReductionError(
                f"{path} has no coordinate (node, dof) = {unknown[0]}; it has "
                f"{', '.join(map(str, coordinates[:6])) or 'no list of them'} ..."
            )
        weights = np.array([w.get(name, 0.0) for name in coordinates])
    return ReducedModel(
        K=matrices.K,
        M=matrices.M,
        C=matrices.C,
        w=contact_functional(weights, len(matrices.K)),
        T=None,
        kind="imported",
        n_boundary=0,
        notes={"file": Path(path).name},
    )


def substructure(path: str | Path) -> Substructure:
    """The matrices of a substructure's .mtx and what their rows are.

    Raises FileNotFoundError, or ReductionError with what is missing.
    """
    # the head, then the numbers of each matrix by its type, up to the next keyword
    text = Path(path).read_text(encoding="latin-1")
    head, *sections = re.split(r"(?im)^\s*\*MATRIX\s*,\s*TYPE\s*=\s*([A-Z ]+?)\s*$", text)
    kinds = [kind.upper() for kind in sections[::2]]
    bodies = [re.split(r"(?m)^\s*\*", body)[0] for body in sections[1::2]]

    # lower triangles row by row; those of a kind that stands twice count once
    matrices = {}
    for kind, body in dict(zip(kinds, bodies, strict=True)).items():
        values = np.array(_numbers(body))
        r = int((np.sqrt(8 * len(values) + 1) - 1) / 2)
        if not r or r * (r + 1) // 2 != len(values):
            raise ReductionError(
                f"{path}: {kind} has {len(values)} numbers, which fill no lower triangle; "
                f"unsymmetric or cut off?"
            )
        A = np.zeros((r, r))
        A[np.tril_indices(r)] = values
        matrices[kind] = A + np.tril(A, -1).T

    # both must be there; the damping, under either of its names, need not
    for kind in ("STIFFNESS", "MASS"):
        if kind not in matrices:
            raise ReductionError(
                f"{path} holds no *MATRIX,TYPE={kind}; it has {sorted(matrices) or 'none'}, write "
                f"the substructure with STIFFNESS=YES, MASS=YES."
            )
    K, M = matrices["STIFFNESS"], matrices["MASS"]
    C = matrices.get("VISCOUS DAMPING", matrices.get("DAMPING"))
    for kind, A in matrices.items():
        if A.shape != K.shape:
            raise ReductionError(f"{path}: {kind} is {len(A)} x {len(A)}, STIFFNESS {len(K)}.")
    return Substructure(K, M, C, _coordinates(head, len(K)))


def _coordinates(head: str, r: int) -> tuple[tuple[int, int], ...]:
    """(node, dof) of every coordinate by the lines before the matrices; none where these do not
    name r of them."""
    comments = re.search(r"(?im)^\*\*\s*ELEMENT NODES\s*$((?:\n\s*\*\*.*)+)", head)
    nodes = _integers(comments.group(1)) if comments else []
    lines = [line for line in head.splitlines() if line.strip() and not line.lstrip()[0] == "*"]
    rows = [_integers(line) for line in lines]
    # the first line holds for node 1 on; another begins with the position from which it holds
    changes = {1: rows[0]} | {row[0]: row[1:] for row in rows[1:]} if rows else {}
    coordinates, dofs = [], []
    for position, node in enumerate(nodes, start=1):
        dofs = changes.get(position, dofs)
        coordinates += [(node, dof) for dof in dofs]
    return tuple(coordinates) if len(coordinates) == r else ()


def _integers(text: str) -> list[int]:
    """Whole numbers; what is too large to be one is left out, so that the list does not fit."""
    return [int(n) for n in _numbers(text) if np.isfinite(n)]


def _numbers(text: str) -> list[float]:
    """The numbers of a text, Fortran's exponents D among them."""
    return [float(word.upper().replace("D", "E")) for word in NUMBER.findall(text)]
