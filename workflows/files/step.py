"""STEP files, each read in a child first: OpenCASCADE crashes on damaged ones, or hangs."""

from functools import lru_cache
from pathlib import Path

from beadwave.geometry.cad.step_file import check_step
from beadwave.geometry.errors import InvalidGeometry
from beadwave.workflows.files.foreign import Refused, Unreadable, arrays, require_memory


def require_step(path: Path) -> None:
    """Raises InvalidGeometry for a file whose bodies cannot be read."""
    if path.is_file():
        try:
            require_memory(path)
        except Unreadable as error:
            raise InvalidGeometry(f"{path}: {error}; give a smaller file.") from None
    check_step(path)
    status = path.stat()
    _tried(path, (status.st_mtime_ns, status.st_size, status.st_ino))


@lru_cache(maxsize=4)
def _tried(path: Path, stamp: tuple[int, int, int]) -> None:
    try:
        arrays("step", path)
    except Refused as refused:
        raise InvalidGeometry(f"{refused}.") from None
    except Unreadable as error:
        raise InvalidGeometry(f"{path}: {error}; export the bodies as STEP again.") from None
