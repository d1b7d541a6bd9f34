"""Measured velocities from .csv, .mat and .uff files, their content by `workflows.files`."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from workflows.files import record_formats
from workflows.files.foreign import arrays
from workflows.files.record import Record, equidistant, stacked
from workflows.files.record_formats import Column, Found
from workflows.files.uff import ENDINGS, data_sets
from workflows.scene import InvalidScene
from workflows.scene.named_files import require_file


def record(path: Path) -> Record:
    """The velocities of a file; raises InvalidScene where it holds none that can be used."""
    uff = partial(uff_columns, column=record_formats.sphere_column, named=False)
    csv = partial(csv_columns, column=record_formats.sphere_column)

    def mat(path: Path) -> Found:
        needed = ("t", "v", "spheres", "time_unit", "velocity_unit")
        return record_formats.velocities_of_mat(variables(path, needed))

    readers = {".csv": csv, ".mat": mat, **dict.fromkeys(ENDINGS, uff)}
    if path.suffix.lower() not in readers:
        raise InvalidScene(f"{path} must end in .csv, .mat, .uff or .unv.")
    require_file(path, "give measured velocities as .csv, .mat or .uff")
    t, spheres, v, title = laid_out(path, readers[path.suffix.lower()])
    return Record(t, v, spheres, title)


def laid_out(
    path: Path, read: Callable[[Path], Found]
) -> tuple[NDArray, tuple[Any, ...], NDArray, str]:
    """t (k,) [s], what m columns of a file hold, their values (r, k, m), and its title or name;
    raises InvalidScene."""
    with refused(path):
        t, columns, title = read(path)
        t = equidistant(t)
        return t, *stacked(t, columns), title or path.stem


@contextmanager
def refused(path: Path) -> Iterator[None]:
    """Errors of reading a file raised as InvalidScene, in one sentence with its path."""
    try:
        yield
    except InvalidScene:
        raise
    except UnicodeDecodeError:
        raise InvalidScene(f"{path} is no text in UTF-8; save it as such.") from None
    except (ValueError, KeyError, IndexError, TypeError, OSError) as error:
        raise InvalidScene(f"{path}: {str(error).rstrip('.')}; correct the file.") from None


def csv_columns(path: Path, column: Column) -> Found:
    """Times and columns of a CSV file; `column` reads a heading."""
    return record_formats.of_csv(path.read_text(encoding="utf-8-sig"), column)


def uff_columns(path: Path, column: Column, *, named: bool = True) -> Found:
    """Times and columns of a universal file's data sets 58; `column` reads a name."""
    record_formats.require_whole(path.read_bytes())
    return record_formats.of_data_sets(data_sets(path, 58), column, named=named)


def variables(path: Path, needed: tuple[str, ...]) -> dict:
    """The variables of a .mat file that are needed, and its title where it has one."""
    return record_formats.require_variables(arrays("matlab", path, *needed, "title"), needed)
