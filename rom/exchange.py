"""Reduced models in files: .npz, .mat for MATLAB, .h5; and models made elsewhere.

Every format holds K, M, w, and where known C and T, under these names; w is a column in .mat. Of a
contact with friction w has three columns, along n, t1 and t2; shakers and sensors are the columns
of w_load and w_sense, named by load_names and sense_names.
kind, n_boundary, n_residual and provenance (JSON text: jsondecode in MATLAB) stand next to them.
A file with K, M and w alone is a model made elsewhere and reads as kind "imported". What is known
of the contact and the mass stands as numbers under the names of rom.contact_fields.

T_surface, surface_points and surface_faces (nodes counted from 1) give the outer nodes back,
coordinates names each q, about says what the names are and in which units. C_damping is what a
scene's [damping] adds to C; it is written for others and not read back.

To write: `_fields` of the model -> np.savez, savemat or h5py. To read: load -> a mapping of arrays
by name -> `_model`, which checks every one of them, since a file may come from anywhere.
"""

import json
import zlib
from collections.abc import Callable, Mapping
from math import prod
from pathlib import Path
from zipfile import BadZipFile, ZipFile, is_zipfile

import numpy as np
import scipy.sparse as sp
from numpy.lib.format import read_array_header_1_0, read_array_header_2_0, read_magic
from numpy.typing import ArrayLike
from scipy.io import loadmat, savemat
from scipy.io.matlab import MatReadError

from beadwave.rom.column_fields import column_fields, columns_of, contact_columns
from beadwave.rom.contact_fields import contact, known_fields, mass_properties
from beadwave.rom.factorisation import ReductionError, require_symmetric
from beadwave.rom.reduced_model import ReducedModel, Surface, contact_functional

ABOUT = """\
M q'' + (C + C_damping) q' + K q = w F, contact displacement u_w = w' q, SI units:
K [N/m], M [kg], C and C_damping [N s/m] where q is a displacement [m], else by the scale of q;
w [1]; F [N] along the chain's travel. The first n_boundary q are displacements, coordinates names
all. Outer nodes: u = T_surface q [m], rows x, y, z of node 1, then of node 2, ...; surface_points
(m x 3) [m]; surface_faces count nodes from 1, surface_body numbers the body of each node by
surface_bodies. C is of dashpots, zeros without them; C_damping and T_surface stand where known.
Of a contact with friction w has three columns, along the rows n, t1, t2 of contact_axes, and
half_space_matrix_m_per_N belongs to these; columns of w_load are shakers, of w_sense sensors."""
BROKEN = (OSError, ValueError, TypeError, KeyError, EOFError, BadZipFile, MatReadError, zlib.error)


def save_npz(
    path: str | Path, reduced: ReducedModel, *, C_damping: ArrayLike | None = None
) -> None:
    """Write a reduced model to .npz; C_damping (r, r) is added for others to read."""
    with open(path, "wb") as file:
        np.savez(file, **_fields(reduced, C_damping))


def load_npz(path: str | Path, *, w: ArrayLike | None = None) -> ReducedModel:
    """Read a reduced model from .npz; w (r,) where the file has none.

    Raises FileNotFoundError, or ReductionError if the content is not a reduced model.
    """
    return _model(_readable(path, "npz", lambda: _archive(path)), path, w)


def _archive(path: str | Path, most_bytes: float = 4e9) -> dict[str, np.ndarray]:
    """The arrays of an .npz by name; raises ValueError where an array's header promises other bytes
    than there are, or all of them too many: K, M and C of 13 000 coordinates are 4 GB."""
    with open(path, "rb") as file:
        if not is_zipfile(file):
            raise BadZipFile("it is no whole zip archive")
        with ZipFile(file) as archive:
            total = sum(entry.file_size for entry in archive.infolist())
            if total > most_bytes:
                raise ValueError(
                    f"it unpacks to {total / 1e9:.3g} GB, allowed are {most_bytes / 1e9}"
                )
            header = {(1, 0): read_array_header_1_0, (2, 0): read_array_header_2_0}
            for entry in archive.infolist():
                with archive.open(entry) as member:
                    shape, _, dtype = header[read_magic(member)](member)
                    if prod(shape) * dtype.itemsize != entry.file_size - member.tell():
                        raise ValueError(f"{entry.filename} does not hold the {shape} that it says")
    with np.load(path, allow_pickle=False) as arrays:
        return dict(arrays)


def save_mat(
    path: str | Path, reduced: ReducedModel, *, C_damping: ArrayLike | None = None
) -> None:
    """Write a reduced model to a level 5 .mat file, which MATLAB and Octave read without a toolbox;
    vectors become columns, names cells of strings, C_damping (r, r) as in save_npz."""
    fields = _fields(reduced, C_damping)
    for name in _names(fields):
        fields[name] = fields[name].astype(object)  # a cell of strings
    with open(path, "wb") as file:
        savemat(file, fields, oned_as="column", do_compression=True)


def load_mat(path: str | Path, *, w: ArrayLike | None = None) -> ReducedModel:
    """Read K, M[, C][, w] from a .mat file, ours or a foreign one; w (r,) where it has none.

    Raises FileNotFoundError, or ReductionError if the content is not a reduced model.
    """
    content = _readable(path, "mat", lambda: loadmat(str(path), appendmat=False, spmatrix=False))
    return _model({k: v for k, v in content.items() if not k.startswith("__")}, path, w)


def save_h5(path: str | Path, reduced: ReducedModel, *, C_damping: ArrayLike | None = None) -> None:
    """Write a reduced model to HDF5, one dataset an array at the root; C_damping (r, r) as in
    save_npz. Needs h5py: raises ImportError without it."""
    import h5py

    fields = _fields(reduced, C_damping)
    for name in _names(fields):
        fields[name] = [word.encode() for word in fields[name]]
    with h5py.File(path, "w") as file:
        for name, value in fields.items():
            file[name] = value


def load_h5(path: str | Path, *, w: ArrayLike | None = None) -> ReducedModel:
    """Read a reduced model from HDF5, K, M and w at its root; w (r,) where the file has none.
    Needs h5py.

    Raises FileNotFoundError, or ReductionError if the content is not a reduced model.
    """
    import h5py

    def content() -> dict[str, object]:
        with h5py.File(path, "r") as file:
            return {name: file[name][()] for name in file}

    return _model(_readable(path, "HDF5", content), path, w)


def save_full(path: str | Path, matrices: Mapping[str, sp.sparray | np.ndarray]) -> None:
    """Write matrices of a whole structure, dense or sparse (n, m) by name, to .mat; to a path with
    any other ending as .npz, which has no sparse arrays: A is A_data, A_indices, A_indptr (by
    columns) and A_shape there, as scipy.sparse.csc_array((data, indices, indptr), shape) takes
    them."""
    if Path(path).suffix == ".mat":
        with open(path, "wb") as file:
            savemat(file, dict(matrices), oned_as="column", do_compression=True)
        return
    arrays: dict[str, np.ndarray] = {}
    for name, A in matrices.items():
        if not sp.issparse(A):
            arrays[name] = A
            continue
        A = sp.csc_array(A)
        arrays |= {f"{name}_data": A.data, f"{name}_indices": A.indices}
        arrays |= {f"{name}_indptr": A.indptr, f"{name}_shape": np.array(A.shape)}
    with open(path, "wb") as file:
        np.savez_compressed(file, **arrays)


def _fields(reduced: ReducedModel, C_damping: ArrayLike | None) -> dict[str, object]:
    """Arrays of a model to write, by name in the file; without dashpots C is zero, other unknown
    fields are left out."""
    fields = {name: getattr(reduced, name) for name in ("K", "M", "C", "w", "T")}
    if reduced.C is None:
        fields["C"] = np.zeros_like(reduced.K)
    fields["C_damping"] = C_damping

    # the way back to the outer nodes; MATLAB counts from 1
    surface = reduced.surface
    if surface:
        fields["T_surface"] = surface.T
        fields["surface_points"], fields["surface_faces"] = surface.points, surface.faces + 1
        if surface.body is not None:
            fields["surface_body"] = surface.body + 1
            fields["surface_bodies"] = np.array(surface.bodies)

    # what the coordinates are, and all that is known of contact, mass and further functionals
    fields["kind"] = reduced.kind
    fields["n_boundary"], fields["n_residual"] = reduced.n_boundary, reduced.n_residual
    fields["provenance"], fields["about"] = json.dumps(reduced.notes), ABOUT
    fields |= known_fields(reduced) | column_fields(reduced)
    fields["error"] = reduced.error
    if reduced.coordinates:
        fields["coordinates"] = np.array(reduced.coordinates)
    return {name: value for name, value in fields.items() if value is not None}


def _names(fields: Mapping[str, object]) -> list[str]:
    """The fields that are lists of names."""
    arrays = {name: field for name, field in fields.items() if isinstance(field, np.ndarray)}
    return [name for name, field in arrays.items() if field.dtype.kind == "U"]


def _readable(path: str | Path, format_name: str, read: Callable):
    """Result of read(); raises FileNotFoundError, or ReductionError with the reason."""
    try:
        return read()
    except FileNotFoundError:
        raise
    except NotImplementedError:  # by scipy.io of HDF5 in a .mat
        raise ReductionError(
            f"{path} is a MATLAB 7.3 file; save it with '-v7', or as .h5 with K, M and w in it."
        ) from None
    except MemoryError:
        raise ReductionError(f"{path} does not fit into memory; give fewer coordinates.") from None
    except BROKEN as broken:
        raise ReductionError(f"{path} cannot be read as {format_name}: {broken}") from broken


def _model(content: Mapping[str, object], path: str | Path, w: ArrayLike | None) -> ReducedModel:
    """The model of what a file holds by name, w (r,) instead of the file's where it is given.

    Raises ReductionError whatever a file holds that is no reduced model.
    """
    try:
        return _read(content, path, w)
    except ReductionError:
        raise
    except (ValueError, TypeError, IndexError, OverflowError) as error:
        raise ReductionError(f"{path} is not a reduced model: {error}.") from error
    except RecursionError as error:
        raise ReductionError(
            f"{path}: provenance is nested too deeply; write plain notes."
        ) from error


def _read(content: Mapping[str, object], path: str | Path, w: ArrayLike | None) -> ReducedModel:
    """The model field by field; errors of numpy and json on content that is none go through."""
    # K, M, C: real, dense, symmetric
    matrices: dict[str, np.ndarray | None] = {"K": None, "M": None, "C": None}
    for name in matrices:
        if name not in content:
            continue
        A = _dense(content[name])
        if A.dtype.kind not in "fiu" or A.ndim != 2 or A.size == 0:
            raise ReductionError(f"{path}: {name} is not a real matrix (shape {A.shape}).")
        matrices[name] = np.array(A, dtype=float)
        require_symmetric(matrices[name], f"{path}: {name}")
    for name in ("K", "M"):
        if matrices[name] is None:
            raise ReductionError(
                f"{path} holds no matrix named {name}; it has {sorted(content) or 'nothing'}."
            )

    # w, a row, a column, three columns or sparse
    r = len(matrices["K"])
    w = content.get("w") if w is None else w
    if w is None:
        raise ReductionError(f"{path} holds no w; pass the {r} weights of the contact.")
    w, across = contact_columns(_dense(w), r, path)

    # its maker's notes, of no effect
    notes = json.loads(_text(content, "provenance", "{}"))
    if not isinstance(notes, dict):
        raise ReductionError(f"{path}: provenance is {notes!r}; it must be a JSON object of notes.")
    notes = {name: note if isinstance(note, str) else str(note) for name, note in notes.items()}
    # fields of the contact once stood among the notes
    fields = dict(content) | {name: note for name, note in notes.items() if name not in content}

    # the way back to the outer nodes, whose nodes and bodies a file counts from 1
    surface = None
    names = ("surface_points", "surface_faces", "T_surface")
    if all(name in content for name in names):
        points, faces, T_surface = (np.asarray(content[name]) for name in names)
        surface = Surface(points, faces - 1, T_surface)
        if "surface_body" in content:
            bodies = tuple(map(_word, np.ravel(content.get("surface_bodies", ()))))
            surface = surface._replace(body=np.ravel(content["surface_body"]) - 1, bodies=bodies)

    # all fields; what a foreign file does not say is none, and its kind "imported"
    T = content.get("T")
    reduced = ReducedModel(
        **matrices,
        w=contact_functional(w, r),
        T=None if T is None else np.array(_dense(T), dtype=float),
        kind=_text(content, "kind", "imported"),
        n_boundary=int(np.ravel(content.get("n_boundary", 0))[0]),
        notes=notes,
        n_residual=int(np.ravel(content.get("n_residual", 0))[0]),
        error=float(np.ravel(content["error"])[0]) if "error" in content else None,
        coordinates=tuple(map(_word, np.ravel(content.get("coordinates", ())))),
        surface=surface,
        contact=contact(fields, r, path),
        mass=mass_properties(fields, path),
        columns=columns_of(content, across, r, path),
    )

    # sizes that must agree with K (r, r)
    for name in ("M", "C"):
        A = getattr(reduced, name)
        if A is not None and A.shape != (r, r):
            raise ReductionError(f"{path}: {name} is {A.shape[0]} x {A.shape[1]}, K is {r} x {r}.")
    if reduced.C is not None and not reduced.C.any():  # no dashpots
        reduced = reduced._replace(C=None)
    for name in ("n_boundary", "n_residual"):
        if not 0 <= getattr(reduced, name) <= r:
            raise ReductionError(
                f"{path}: {name} is {getattr(reduced, name)}; it must be from 0 to {r}."
            )
    for name, T in (("T", reduced.T), ("T_surface", reduced.surface and reduced.surface.T)):
        if T is not None and T.shape[1] != r:
            raise ReductionError(f"{path}: {name} has {T.shape[1]} columns, K is {r} x {r}.")
    return reduced


def _dense(A: object) -> np.ndarray:
    """A as a dense array; MATLAB keeps sparse ones as such."""
    return A.toarray() if sp.issparse(A) else np.asarray(A)


def _text(content: Mapping[str, object], name: str, default: str) -> str:
    """The text under a name, the default where there is none."""
    return _word(np.ravel(content.get(name, default))[0])


def _word(text: object) -> str:
    """A string, also one as bytes (HDF5) or in a cell of its own (MATLAB)."""
    if isinstance(text, np.ndarray):
        text = np.ravel(text)[0]
    return text.decode() if isinstance(text, bytes) else str(text)
