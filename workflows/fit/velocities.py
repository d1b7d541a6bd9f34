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

VELOCITIES = ("t", "v", "spheres", "time_unit", "velocity_unit")


def record(path: Path) -> Record:
    """The velocities of a file; raises InvalidScene where it holds none that can be used."""
    uff = partial(uff_columns, column=record_formats.sphere_column, named=False)
    csv = partial(csv_columns, column=record_formats.sphere_column)
    read = {".csv": csv, ".mat": _mat_columns, **dict.fromkeys(ENDINGS, uff)}
    if path.suffix.lower() not in read:
        raise InvalidScene(f"{path} must end in .csv, .mat, .uff or .unv.")
    require_file(path, "give measured velocities as .csv, .mat or .uff")
    t, spheres, v, title = laid_out(path, read[path.suffix.lower()])
    return Record(t, v, spheres, title)


def laid_out(
    path: Path, read: Callable[[Path], Found]
) -> tuple[NDArray, tuple[Any, ...], NDArray, str]:
    """t (k,) [s], what m columns of a file hold, their values (r, k, m), and its title or name;
    raises InvalidScene."""
    with told_of(path):
        t, columns, title = read(path)
        t = equidistant(t)
        return t, *stacked(t, columns), title or path.stem


@contextmanager
def told_of(path: Path) -> Iterator[None]:
    """What is wrong with a file raised as InvalidScene."""
    try:
        yield
    except InvalidScene:
        raise
    except UnicodeDecodeError:
        raise InvalidScene(f"{path} is no text in UTF-8; save it as such.") from None
    except (ValueError, KeyError, IndexError, TypeError, OSError) as error:
        raise InvalidScene(f"{path}: {str(error).rstrip('.')}; correct the file.") from None


def csv_columns(path: Path, column: Column) -> Found:
    """What a CSV file holds."""
    return record_formats.of_csv(path.read_text(encoding="utf-8-sig"), column)


def uff_columns(path: Path, column: Column, *, named: bool = True) -> Found:
    """What a universal file holds."""
    record_formats.require_whole(path.read_bytes())
    return record_formats.of_data_sets(data_sets(path, 58), column, named=named)


def variables(path: Path, needed: tuple[str, ...]) -> dict:
    """The variables of a .mat file that are asked for, and its title where it has one."""
    return record_formats.require_variables(arrays("matlab", path, *needed, "title"), needed)


def _mat_columns(path: Path) -> Found:
    return record_formats.velocities_of_mat(variables(path, VELOCITIES))
