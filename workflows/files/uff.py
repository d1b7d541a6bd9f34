"""Data sets 58 of universal files (UFF), through pyuff."""

from pathlib import Path

from workflows.files.foreign import arrays
from workflows.scene import InvalidScene

FIELDS = (
    "func_type", "rsp_node", "x", "data", "id1",
    "abscissa_axis_units_lab", "ordinate_axis_units_lab",
)  # fmt: skip


def data_sets_58(path: Path) -> list[dict]:
    """What is asked of every data set 58: numbers, arrays and labels; raises Unreadable."""
    pyuff()
    held = arrays("uff", path, *FIELDS)
    sets: list[dict] = [{} for _ in range(int(held.pop("count")))]
    for key, value in held.items():
        number, name = key.split()
        sets[int(number)][name] = value if value.ndim else value.item()
    return sets


def pyuff():
    """The library; raises InvalidScene where it is not installed."""
    try:
        import pyuff
    except ImportError:
        raise InvalidScene(
            "UFF58 files need pyuff; ./install.sh identify adds it, or give .csv."
        ) from None
    return pyuff
