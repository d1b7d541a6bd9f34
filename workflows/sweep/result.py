"""A finished sweep: its table, what it says, and pictures of it."""

from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from json import loads
from pathlib import Path
from typing import Any

import numpy as np

from workflows.files.run_folder import Picture
from workflows.report import tables
from workflows.report.tables import Table
from workflows.scene import InvalidScene, nearest
from workflows.scene.named_files import unfit
from workflows.sweep.core.design import Design
from workflows.sweep.core.effects import Effects, sobol_effects
from workflows.sweep.core.rows import DONE, LARGE_ERROR, TEXT, other_wave
from workflows.sweep.effects import effects_table
from workflows.sweep.store import ABOUT, SIGNALS, TABLE

SHOWN = 40  # cases of a table on a terminal
MAIN = ("tof_s", "arr")
CURES = {
    "reduction": "raise reduction.to_hz, or wall.cutoff",
    "mesh": "take smaller elements (the seeds of [mesh] or of bodies, or mesh.scale)",
}
Array = np.ndarray


class Sweep:
    """What a sweep found: a row a case.

    design    which cases there are
    columns   the table's columns by name, keys first; (n_cases,) arrays
    units     of keys, where they have one
    folder    where cases.parquet is
    face      of a scan: its name, axes and edges; None of other sweeps
    notes     what the user is to know of the folder, in sentences
    """

    def __init__(self, folder: Path, table: Any, notes: tuple[str, ...] = ()) -> None:
        self.folder = folder
        about = loads(table.schema.metadata[ABOUT])
        self.columns = {name: _array(table[name]) for name in table.column_names}
        keys = {key: tuple(self.columns[key].tolist()) for key in about["keys"]}
        self.design = Design(about["kind"], keys, about["base"])
        self.units: dict[str, str] = about["units"]
        self.face: dict[str, Any] | None = about.get("face")
        self.notes = (*notes, *(_of_points(self.columns) if self.face else ()))

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Columns with numbers that cases have."""
        own = {"case", "seconds", *self.design.keys, *TEXT}
        return tuple(
            name for name, values in self.columns.items()
            if name not in own and np.isfinite(values).any()
        )  # fmt: skip

    @property
    def main(self) -> tuple[str, ...]:
        """The outputs that are drawn unasked: TOF and ARR of the last sphere, the wall's force."""
        waves = [name for name in self.outputs if name.endswith(MAIN)]
        return (*waves[-len(MAIN) :], *(n for n in self.outputs if n == "wall_peak_force_N"))

    def data(self) -> Any:
        """The table as a pandas.DataFrame."""
        import pandas

        return pandas.DataFrame(self.columns).set_index("case")

    def signals(self) -> Any:
        """Velocities and the wall's force of all cases, an xarray.Dataset with the dimensions
        case, time, sphere; raises InvalidScene where the sweep did not keep them."""
        path = self.folder / SIGNALS
        if not path.is_file():
            raise InvalidScene(f"{self.folder} has no signals; sweep with --signals.")
        import xarray

        return xarray.open_dataset(path, engine="h5netcdf")

    def effects(self, output: str, *, logarithm: bool = False) -> Effects:
        """Sobol's indices of an output, or of its logarithm, with their standard errors."""
        y = self._output(output)
        try:
            return sobol_effects(self.design, np.log(y) if logarithm else y)
        except ValueError as reason:
            raise InvalidScene(str(reason)) from None

    def plot(self, output: str | None = None, keys: tuple[str, ...] | None = None) -> Picture:
        """An output over keys, all that vary without any; raises InvalidScene for other names."""
        from workflows.sweep.figures import face_map, picture

        name = output or next(iter(self.main), "")
        if self.face and keys is None:
            return face_map(name, self._output(name), self.columns, self.face)
        chosen = keys or self.design.keys
        for key in chosen:
            _known(key, self.design.keys, "key")
        keyed = {self._named(key): self.columns[key] for key in chosen}
        return picture(name, self._output(name), keyed)

    def pictures(self) -> tuple[Picture, ...]:
        """Those of the main outputs."""
        return tuple(self.plot(name) for name in self.main)

    def _named(self, key: str) -> str:
        return f"{key} [{self.units[key]}]" if key in self.units else key

    def _output(self, name: str) -> Array:
        _known(name, self.outputs, "output")
        return self.columns[name]

    def counts(self) -> dict[str, int]:
        """How many cases are done, refused and failed."""
        return dict(Counter(self.columns["status"].tolist()))

    def messages(self) -> dict[str, int]:
        """Sentences of cases without a result, the most frequent first."""
        rows = zip(self.columns["status"].tolist(), self.columns["message"].tolist(), strict=True)
        return dict(Counter(m for status, m in rows if m and status != DONE).most_common())

    def found(self) -> tuple[Table, ...]:
        """The table or, of many cases, the range of each output; and what outputs depend on."""
        effects = effects_table(self.design, {name: self.columns[name] for name in self.main})
        first = self._cases() if self.design.n_cases <= SHOWN else self._ranges()
        return (first,) if effects is None else (first, effects)

    def _cases(self) -> Table:
        names = (*self.design.keys, *self.main, "status")
        columns = [self.columns[name].tolist() for name in names]
        shown = zip(*map(tables.apart, columns), strict=True)
        return Table("cases", names, tuple(zip(*columns, strict=True)), (names, *shown))

    def _ranges(self) -> Table:
        rows = []
        for name in self.outputs:
            there = self.columns[name][np.isfinite(self.columns[name])]
            rows.append((name, *map(float, (there.min(), np.median(there), there.max()))))
        heading = "output", "smallest", "median", "largest"
        shown = ((name, *tables.apart(values)) for name, *values in rows)
        return Table("outputs", heading, tuple(rows), (heading, *shown))

    def text(self) -> str:
        """For a person."""
        counts = ", ".join(f"{n} {status}" for status, n in self.counts().items())
        said = [f"{n} x {sentence}" for sentence, n in list(self.messages().items())[:5]]
        shown = [tables.text(table) for table in self.found()]
        return "\n\n".join([f"{self.design.n_cases} cases: {counts}", *shown, *said])

    def record(self) -> dict[str, Any]:
        """For machines: cases by status, and the tables."""
        found = {table.name: tables.records(table) for table in self.found()}
        about = {"cases": self.design.n_cases, "status": self.counts(), "folder": str(self.folder)}
        return {**about, "done": self.counts().get(DONE, 0), **found}


def _of_points(columns: dict[str, Array]) -> Iterator[str]:
    """How many points of a scan have large errors, none of the mesh, or another reflected wave."""
    done = columns["status"] == DONE
    for of in ("reduction", "mesh"):
        error = columns[f"error_{of}"][done]
        large = error > LARGE_ERROR
        if large.any():
            yield (
                f"The error of the {of} is above {100 * LARGE_ERROR:g} % of the striker's speed "
                f"at {large.sum()} of {done.sum()} points, {100 * np.nanmax(error):.2g} % at the "
                f"worst, see error_{of} in the table: {CURES[of]}."
            )
    unknown = done & np.isnan(columns["error_mesh"])
    if unknown.any():
        yield (
            f"error_mesh is not known at {unknown.sum()} of {done.sum()} points; `message` in the "
            "table says why."
        )
    blank = Counter(each for m in columns["message"].tolist() for each in m.split("; "))
    for sphere in (name for name in columns if name.endswith("_reflected_s")):
        n = blank[other_wave(int(sphere.split("_")[1]))]
        if n:
            yield (
                f"The reflected wave at sphere {sphere.split('_')[1]} is left blank at {n} of "
                f"{done.sum()} points: it is not that of the points around, or cannot be told."
            )


def _array(column: Any) -> Array:
    return column.to_numpy(zero_copy_only=False)


def _known(name: str, names: tuple[str, ...], what: str) -> None:
    if name not in names:
        raise InvalidScene(f"{what} {name!r} is not in the sweep; {nearest(name, names)}.")


def opened(folder: str | Path, notes: tuple[str, ...] = ()) -> Sweep:
    """A sweep's folder; raises InvalidScene where it holds no table of ours."""
    path = Path(folder) / TABLE
    if why := unfit(path):
        raise InvalidScene(f"{path} {why}; give the folder of a sweep.")
    try:
        import pyarrow.parquet as pq

        table = pq.read_table(path)
        return Sweep(Path(folder), table, notes)
    except ImportError as missing:
        raise InvalidScene(
            f"{path} is read by {missing.name}, which is not installed; ./install.sh sweep."
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as reason:
        said = str(reason).splitlines()[0]
        raise InvalidScene(f"{path} is no table of a sweep ({said}); sweep again.") from None
