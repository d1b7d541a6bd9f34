"""Readers of foreign binary files, run in a child: SECONDS KIND PATH RESULT [NAME ...].

The result is an .npz of plain arrays; a file that is refused gives the reason as text next to it,
with exit status REFUSED. Libraries that read binary files may crash or never end: the process that
started this one sees the result alone.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from beadwave.system import end_after_work, free_memory, limit_memory

REFUSED = 3
Arrays = dict[str, np.ndarray]


def _mesh(path: Path) -> Arrays:
    """points (n, 3), names "dimension origin name" (g,) of groups, and the nodes of each as cells0,
    cells1, ... (m, nodes)."""
    from beadwave.geometry.own_mesh.mesh_file import mesh_file

    points, groups = mesh_file(path)
    names = np.array([f"{g.dimension} {g.origin:d} {g.name}" for g in groups], dtype=str)
    cells = {f"cells{i}": group.nodes for i, group in enumerate(groups)}
    return {"points": points, "names": names, **cells}


def _matlab(path: Path, *names: str) -> Arrays:
    """The variables of these names that a .mat file of version 4 to 7 has, each a plain array;
    raises ValueError for other files."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        variables = loadmat(str(path), appendmat=False, spmatrix=False, variable_names=names)
    except NotImplementedError:
        raise ValueError("it is a .mat file of version 7.3; save it with -v7") from None
    except (MatReadError, ValueError):
        raise ValueError("it is no .mat file of version 4 to 7, which can be read") from None
    except MemoryError:
        raise
    except Exception:  # what scipy meets in a file that is cut off: OSError, TypeError, zlib.error
        raise ValueError("it is cut off or damaged; write it anew") from None
    return {name: _plain(variables[name]) for name in names if name in variables}


def _plain(value) -> np.ndarray:
    """Numbers or text, also from a cell or a sparse matrix; of other things their shape alone."""
    value = value.toarray() if hasattr(value, "toarray") else np.asarray(value)
    while value.dtype == object and value.size == 1:
        value = np.asarray(value.ravel()[0])
    return np.full(value.shape, "no numbers") if value.dtype.kind in "OV" else value


def _uff(path: Path, kinds: str, *names: str) -> Arrays:
    """Entries of these names of the data sets of these kinds, "58 15", as "0 x", "1 x", ... by the
    number of the set, and the `count` of sets; raises ValueError for other files."""
    import pyuff

    try:
        file = pyuff.UFF(str(path))
        wanted = np.isin(file.get_set_types(), list(map(int, kinds.split())))
        sets = [file.read_sets(int(number)) for number in np.flatnonzero(wanted)]
    except Exception:  # pyuff raises nothing narrower
        raise ValueError("it is no UFF file that pyuff can read") from None
    values = {
        f"{i} {name}": _plain(data_set[name])
        for i, data_set in enumerate(sets)
        for name in names
        if name in data_set
    }
    return {"count": np.array(len(sets)), **values}


def _reduced(path: Path, target: Path) -> None:
    """Write the reduced model of a .mat or .h5 as .npz; raises rom.ReductionError for one that is
    no model, ValueError for a damaged file."""
    from beadwave import rom

    read = {".mat": rom.load_mat, ".h5": rom.load_h5}[path.suffix]
    try:
        rom.save_npz(target, read(path))
    except (rom.ReductionError, MemoryError):
        raise
    except Exception as odd:  # what a reader meets in a damaged file
        raise ValueError(f"{path} cannot be read, it is damaged ({odd}); write it anew") from odd


def _step(path: Path) -> Arrays:
    """names (n,) of the bodies of a STEP file: that it can be read at all is what is asked."""
    from beadwave.geometry.cad.occ import model

    with model({}, path) as cad:
        return {"names": np.array(list(cad.bodies), dtype=str)}


def _saved(read: Callable[..., Arrays]) -> Callable[..., None]:
    """A reader that writes its arrays to a target: value0, value1, ..., their names as `keys`."""

    def save(path: Path, target: Path, *names: str) -> None:
        content = read(path, *names)
        numbered = {f"value{i}": value for i, value in enumerate(content.values())}
        with open(target, "wb") as file:
            np.savez(file, keys=np.array(list(content), dtype=str), **numbered)

    return save


READERS = {
    "mesh": _saved(_mesh), "matlab": _saved(_matlab), "uff": _saved(_uff), "reduced": _reduced,
    "step": _saved(_step),
}  # fmt: skip


def main() -> None:
    """Read the file named on the command line, or say what is wrong with it."""
    seconds, kind, path, target, *names = sys.argv[1:]
    end_after_work(float(seconds))  # so that a busy machine refuses nothing
    limit_memory(max(2**30, free_memory()))  # the readers themselves take 2**30 bytes
    try:
        READERS[kind](Path(path), Path(target), *names)
    except MemoryError:
        _refuse(target, "it does not fit into the memory that is free")
    except (Exception, SystemExit) as error:  # meshio leaves the process, others raise anything
        _refuse(target, " ".join(f"{error}".split()) or type(error).__name__)


def _refuse(target: str, why: str) -> None:
    Path(target).with_suffix(".txt").write_text(why, encoding="utf-8", newline="\n")
    sys.exit(REFUSED)


if __name__ == "__main__":
    main()
