"""Data sets of universal files (UFF), through pyuff."""

from pathlib import Path

from beadwave.system import adding
from beadwave.workflows.files.foreign import arrays
from beadwave.workflows.scene import InvalidScene

ENDINGS = (".uff", ".unv")
FIELDS = {
    58: (
        "func_type", "rsp_node", "rsp_dir", "ref_node", "ref_dir", "x", "data", "id1",
        "abscissa_axis_units_lab", "ordinate_axis_units_lab", "ordinate_axis_lab",
        "ordinate_spec_data_type",
    ),
    55: (
        "analysis_type", "freq", "eig", "modal_a", "modal_b", "node_nums", "r1", "r2", "r3",
        "id1", "id2", "id3", "id4", "id5",
    ),
    15: ("node_nums", "disp_cs", "x", "y", "z"),
    164: ("length",),
}  # fmt: skip
FIELDS[2411] = FIELDS[15]


def data_sets(path: Path, *kinds: int) -> list[dict]:
    """The FIELDS of every data set of these kinds, and its type; raises Unreadable."""
    pyuff()
    names = dict.fromkeys(name for kind in kinds for name in FIELDS[kind])
    values = arrays("uff", path, " ".join(map(str, kinds)), "type", *names)
    sets: list[dict] = [{} for _ in range(int(values.pop("count")))]
    for key, value in values.items():
        number, name = key.split()
        sets[int(number)][name] = value if value.ndim else value.item()
    return sets


def pyuff():
    """The library; raises InvalidScene where it is not installed."""
    try:
        import pyuff
    except ImportError:
        raise InvalidScene(
            f"universal files (.uff, .unv) need pyuff; {adding('identify')} adds it."
        ) from None
    return pyuff
