"""Measured frequency responses in CSV, .mat and data sets 58 of universal files (UFF).

CSV: a header line, then one line per frequency: frequency_hz, re_1, im_1, re_2, im_2, ...
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.identification.hit_records import MOST, degree_of_freedom
from beadwave.fem.identification.hits import FrequencyResponses
from beadwave.workflows.files.hit_files import QUANTITIES, quantity_named
from beadwave.workflows.files.record import SYNTHETIC
from beadwave.workflows.files.signal_table import SignalTable

RESPONSE = 4  # UFF58's function type of a frequency response


class Responses(NamedTuple):
    """Frequency responses of one test at common frequencies."""

    frequency_hz: NDArray[np.float64]  # (k,)
    H: NDArray[np.complex128]  # (n, k) response over force, in the unit of the file
    title: str
    # names of the points of response and reference, as "12+z"; () for a CSV's
    ends: tuple[tuple[str, str], ...] = ()
    quantity: str = ""  # "accelerations", "velocities" or "displacements" where it is known

    def by_reference(self) -> FrequencyResponses:
        """Points and references as rows and columns; the fewer are the references.

        Raises ValueError where not every point was measured with every reference.
        """
        n = len(self.H)
        ends = self.ends or tuple((f"response {i + 1}", "hammer") for i in range(n))
        responses, hammers = (tuple(dict.fromkeys(side)) for side in zip(*ends, strict=True))
        sums = np.zeros((len(responses), len(hammers), self.H.shape[1]), complex)
        count = np.zeros((len(responses), len(hammers), 1))
        for (response, hammer), h in zip(ends, self.H, strict=True):
            i, j = responses.index(response), hammers.index(hammer)
            sums[i, j] += h
            count[i, j] += 1
        if not count.all():
            i, j = np.argwhere(count[:, :, 0] == 0)[0]
            raise ValueError(
                f"there is no response of {responses[i]} to {hammers[j]}; measure each point with "
                "each reference, or leave one out"
            )
        test = FrequencyResponses(self.frequency_hz, sums / count, responses, hammers)
        return test if len(responses) >= len(hammers) else test.transposed()


def require_finite(test: Responses) -> Responses:
    """The test; raises ValueError for frequencies below 0 Hz, and where products of its numbers
    would overflow."""
    if test.frequency_hz.size and test.frequency_hz.min() < 0:
        raise ValueError(
            f"it has frequencies below 0 Hz, from {test.frequency_hz.min():g}; give the lines from "
            "0 Hz on alone"
        )
    numbers = (test.frequency_hz, test.H.real, test.H.imag)
    largest = np.max([np.abs(array).max() for array in numbers])
    if largest > MOST:
        raise ValueError(f"a number is {largest:.3g} in size, up to {MOST:g} is allowed")
    return test


def of_table(table: SignalTable, name: str) -> Responses:
    """The responses of a CSV file's table; raises ValueError where it holds none."""
    n_columns = table.values.shape[1]
    if n_columns < 3 or n_columns % 2 == 0:
        raise ValueError(f"{n_columns} columns, an odd number from 3 on is needed")
    is_synthetic = any(SYNTHETIC in text for text in (table.title, ", ".join(table.header)))
    H = table.values[:, 1::2].T.astype(complex)
    H.imag = table.values[:, 2::2].T
    return Responses(table.values[:, 0], H, SYNTHETIC if is_synthetic else name)


def of_data_sets(sets: Sequence[dict]) -> Responses:
    """The responses of data sets 58, as pyuff reads them, in their order; raises ValueError where
    they hold none, or where these have different numbers of lines."""
    sets = [s for s in sets if s["func_type"] == RESPONSE]
    if not sets:
        raise ValueError("no data set 58 with a frequency response")
    if any(len(s["x"]) != len(sets[0]["x"]) for s in sets):
        raise ValueError("responses with different numbers of lines")
    H = np.array([np.asarray(s["data"], dtype=complex) for s in sets])
    ends = tuple(
        (
            degree_of_freedom(int(s["rsp_node"]), int(s["rsp_dir"])),
            degree_of_freedom(int(s["ref_node"]), int(s["ref_dir"])),
        )
        for s in sets
    )
    quantity = QUANTITIES.get(int(sets[0].get("ordinate_spec_data_type", 0)), "")
    f = np.asarray(sets[0]["x"], dtype=float)
    return Responses(f, H, str(sets[0]["id1"]).strip(), ends, quantity)


def of_mat(variables: dict[str, NDArray], name: str) -> Responses:
    """The responses of a .mat file: frequency_hz (k,) and H (k, n) or (n, k), complex.

    Raises ValueError where it holds none.
    """
    f = np.ravel(variables["frequency_hz"]) if "frequency_hz" in variables else np.zeros(0)
    H = np.atleast_2d(variables["H"])
    if f.dtype.kind not in "fiu" or H.dtype.kind not in "fiuc" or H.ndim != 2:
        raise ValueError("frequency_hz or H is no array of numbers")
    H = H if H.shape[1] == len(f) else H.T
    if H.shape[1] != len(f):
        raise ValueError(f"H is {H.shape[::-1]}, frequency_hz has {len(f)} values")
    quantity = quantity_named(variables)
    return Responses(f.astype(float), H.astype(complex), name, quantity=quantity)


def write_csv(path: Path, test: Responses) -> None:
    """Write responses H (n, k) as CSV, the title in the header line; numbers are rounded to six
    digits, by up to 5e-6 of each."""
    columns = [column for h in test.H for column in (h.real, h.imag)]
    names = [f"{name}_{i}" for i in range(1, len(test.H) + 1) for name in ("re", "im")]
    header = f"frequency_hz,{','.join(names)}  ({test.title})"
    table = np.column_stack([test.frequency_hz, *columns])
    with path.open("w", encoding="utf-8", newline="\n") as file:
        np.savetxt(file, table, fmt="%.6g", delimiter=",", header=header, comments="")


def data_set(test: Responses, i: int) -> dict:
    """Data set 58 of a response, counted from 1, with the keys of pyuff."""
    return {
        "func_type": RESPONSE, "rsp_node": i, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1,
        "data": test.H[i - 1], "x": test.frequency_hz, "id1": test.title,
        "rsp_ent_name": f"response {i}", "ref_ent_name": "hammer",
        "abscissa_spacing": 1, "abscissa_spec_data_type": 18, "ordinate_spec_data_type": 12,
        "orddenom_spec_data_type": 13,
    }  # fmt: skip
