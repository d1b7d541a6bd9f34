"""Measured frequency responses in and out: CSV, and UFF58 through pyuff.

CSV: a header line, then one line per frequency: frequency_hz, re_1, im_1, re_2, im_2, ...
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.files.output_file import OutputFile
from workflows.files.uff import data_sets, pyuff
from workflows.scene import InvalidScene
from workflows.scene.named_files import require_file

RESPONSE = 4  # UFF58's function type of a frequency response
HAMMER = "give a hammer test as .csv or .uff"
CSV = "CSV wants frequency_hz, re_1, im_1, ... below a header line"
UFF = (
    "a universal file wants data sets 58; shapes alone (data set 55) are targets of modes and "
    "tune: [[targets]] with hz and shape = the file"
)
MOST = 1e60  # in size of a frequency or a response
SYNTHETIC = "SYNTHETIC: computed, not measured"


class Responses(NamedTuple):
    """Frequency responses of one test on common lines."""

    frequency_hz: NDArray[np.float64]  # (k,)
    H: NDArray[np.complex128]  # (n, k)
    title: str


def responses(path: Path) -> Responses:
    """The responses of a file; raises InvalidScene where it holds none."""
    read = {".csv": _csv, ".uff": _uff, ".unv": _uff}.get(path.suffix.lower())
    if read is None:
        raise InvalidScene(f"{path} must end in .csv, .uff or .unv.")
    require_file(path, HAMMER)
    try:
        return _finite(read(path))
    except (ValueError, KeyError, IndexError, UnicodeDecodeError) as error:
        wanted = CSV if read is _csv else UFF
        raise InvalidScene(
            f"{path} holds no frequency responses that can be read ({error}); {wanted}."
        ) from None


def _finite(test: Responses) -> Responses:
    """The test; raises ValueError where products of its numbers are none."""
    parts = (test.frequency_hz, test.H.real, test.H.imag)
    largest = np.max([np.abs(part).max() for part in parts])
    if largest > MOST:
        raise ValueError(f"a number is {largest:.3g} in size, up to {MOST:g} is allowed")
    return test


def _csv(path: Path) -> Responses:
    header, *lines = path.read_text(encoding="utf-8-sig").splitlines() or [""]
    if not any(line.strip() for line in lines):
        raise ValueError("no lines below the header")
    table = np.loadtxt(lines, delimiter=",", ndmin=2)
    if table.shape[1] < 3 or table.shape[1] % 2 == 0:
        raise ValueError(f"{table.shape[1]} columns, an odd number from 3 on is needed")
    title = SYNTHETIC if SYNTHETIC in header else path.stem
    H = table[:, 1::2].T.astype(complex)
    H.imag = table[:, 2::2].T
    return Responses(table[:, 0], H, title)


def _uff(path: Path) -> Responses:
    sets = [s for s in data_sets(path, 58) if s["func_type"] == RESPONSE]
    if not sets:
        raise ValueError("no data set 58 with a frequency response")
    if any(len(s["x"]) != len(sets[0]["x"]) for s in sets):
        raise ValueError("responses with different numbers of lines")
    H = np.array([np.asarray(s["data"], dtype=complex) for s in sets])
    return Responses(np.asarray(sets[0]["x"], dtype=float), H, str(sets[0]["id1"]).strip())


def write_uff(path: Path, test: Responses) -> None:
    """Write as ASCII UFF58 (binary ones of this library cannot be read back)."""
    file = pyuff().UFF(str(path))
    for i, h in enumerate(test.H, start=1):
        file.write_sets(_data_set(test, i, h), mode="add" if i > 1 else "overwrite")


def write_csv(path: Path, test: Responses) -> None:
    """Write as CSV, the title in the header line."""
    parts = [part for h in test.H for part in (h.real, h.imag)]
    names = [f"{part}_{i}" for i in range(1, len(test.H) + 1) for part in ("re", "im")]
    header = f"frequency_hz,{','.join(names)}  ({test.title})"
    table = np.column_stack([test.frequency_hz, *parts])
    np.savetxt(path, table, fmt="%.6g", delimiter=",", header=header, comments="")


def write_synthetic(file: OutputFile, test: Responses) -> None:
    """Write a computed test, .uff or .csv."""
    write = write_csv if file.path.suffix.lower() == ".csv" else write_uff
    with file.writing() as part:
        write(part, test)


def synthetic_file(path: Path, overwrite: bool) -> OutputFile:
    """Where a computed test goes; raises InvalidScene where it cannot."""
    if path.suffix.lower() not in (".csv", ".uff"):
        raise InvalidScene(f"{path} must end in .csv or .uff.")
    return OutputFile(path, "FILE", overwrite=overwrite)


def _data_set(test: Responses, i: int, h) -> dict:
    return pyuff().prepare_58(
        binary=0,
        func_type=RESPONSE,
        rsp_node=i,
        rsp_dir=1,
        ref_node=1,
        ref_dir=1,
        data=h,
        x=test.frequency_hz,
        id1=test.title,
        rsp_ent_name=f"response {i}",
        ref_ent_name="hammer",
        abscissa_spacing=1,
        abscissa_spec_data_type=18,
        ordinate_spec_data_type=12,
        orddenom_spec_data_type=13,
    )
