"""Measured mode shapes from universal files, found in `fem.identification.measured_shapes`."""

from functools import lru_cache
from pathlib import Path

from beadwave.fem.identification import measured_shapes as shapes
from beadwave.workflows.files.foreign import Unreadable
from beadwave.workflows.files.uff import ENDINGS, data_sets
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import require_file


def measured_shape(path: Path, hz: float) -> shapes.MeasuredShape:
    """The shape of the mode at `hz`; raises InvalidScene where the file has none."""
    if path.suffix.lower() not in ENDINGS:
        raise InvalidScene(f"shape = {str(path)!r} must end in {' or '.join(ENDINGS)}.")
    require_file(path, "give measured shapes as .uff", key="shape: ")
    try:
        return shapes.measured_shape(_sets(path, path.stat().st_mtime_ns), hz)
    except InvalidScene:
        raise
    except (Unreadable, ValueError, KeyError, TypeError, IndexError) as error:
        why = f"it has no {error}" if isinstance(error, KeyError) else str(error).rstrip(".")
        raise InvalidScene(f"shape: {path} holds no shape that can be read: {why}.") from None


@lru_cache(maxsize=4)
def _sets(path: Path, stamp: int) -> tuple[dict, ...]:
    kinds = (*shapes.POINTS, shapes.UNITS, shapes.SHAPE, shapes.RESPONSE)
    return tuple(data_sets(path, *kinds))
