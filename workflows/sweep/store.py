"""The table of a sweep on disk: parts as cases are done, one Parquet file at the end."""

from collections.abc import Mapping
from json import dumps, loads
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from workflows.files.run_folder import RunFolder
from workflows.scene import InvalidScene, Scene
from workflows.scene.quantities import entries
from workflows.stages.pipeline import digest
from workflows.sweep.core.design import Design
from workflows.sweep.core.rows import DONE, FAILED, TEXT, Rows
from workflows.sweep.inputs import Inputs

TABLE, SIGNALS = "cases.parquet", "signals.nc"
ABOUT = b"beadwave"  # in the table's metadata: what it is a table of


def require_libraries(signals: bool) -> None:
    """Raise InvalidScene where what writes the tables is not installed."""
    try:
        import pyarrow  # noqa: F401

        if signals:
            import h5netcdf  # noqa: F401
    except ImportError as missing:
        raise InvalidScene(
            f"a sweep writes its table by {missing.name}, which is not installed; "
            "./install.sh sweep installs it."
        ) from None


class About(NamedTuple):
    """What a table says of itself beside its design: units of keys that no scene has, and the face
    whose points its cases are."""

    units: dict[str, str]
    face: dict[str, Any] | None = None


ALONE = About({})
NOTHING: Mapping[str, Any] = MappingProxyType({})


class Store:
    """Parts of a design's rows in a run folder, and the whole table of them."""

    def __init__(
        self, folder: RunFolder, design: Design, scene: Scene, signals: bool, inputs: Inputs,
        about: About = ALONE,
    ) -> None:  # fmt: skip
        self._folder = folder
        self._inputs = inputs
        self._design = design
        self._spheres = scene.output.spheres
        self._signals = signals
        columns = design.columns.items()
        self._kinds = {key: {type(value) for value in values} for key, values in columns}
        units = {entry.key: entry.quantity.kind.unit for entry in entries(scene)}
        self._units = about.units | {key: units[key] for key in design.keys if key in units}
        self._face = about.face
        self._scene_toml = (folder.path / "scene.toml").read_text(encoding="utf-8")
        self._key = digest([self._scene_toml, design.digest, inputs.key])[:12]
        self._prefix = f"part-{self._key}{'-signals' if signals else ''}-"

    @property
    def parts(self) -> list[Path]:
        """Files of rows that are complete, of this design and scene alone."""
        found = self._folder.base.path.glob(f"{self._prefix}*.parquet")
        return [path for path in found if self._folder.base.ours(self._name(path))]

    def whole(self) -> bool:
        """Whether the table of this design, scene and content of files is there."""
        there = self._folder.base
        kept = there.ours(SIGNALS) or not self._signals
        return self._key_there() == self._key and kept

    def notes(self) -> tuple[str, ...]:
        """A sentence where a table of the same scene and cases does not hold any more."""
        there = self._folder.base
        if self._key_there() in (None, self._key) or not there.ours("scene.toml"):
            return ()
        if (there.path / "scene.toml").read_text(encoding="utf-8") != self._scene_toml:
            return ()
        said = "since a file that it was made of changed, or the program did"
        return (f"replaced: the table in {there.path}, {said}",)

    def _key_there(self) -> str | None:
        """The key of the table that is there."""
        import pyarrow.parquet as pq

        there = self._folder.base
        if not there.ours(TABLE):
            return None
        return loads((pq.read_schema(there.path / TABLE).metadata or {}).get(ABOUT, b"{}")).get(
            "key"
        )

    def failed(self) -> int:
        """Cases whose rows are there and say that they failed."""
        import pyarrow.parquet as pq

        paths = [self._folder.base.path / TABLE] if self.whole() else self.parts
        found = (pq.read_table(path, columns=["status"])["status"] for path in paths)
        return sum(statuses.to_pylist().count(FAILED) for statuses in found)

    def reopen(self) -> None:
        """Make the cases without a result missing; the others of the table are a part again."""
        import pyarrow.parquet as pq

        if not self.parts and self.whole():
            self._split()
        read = {path: pq.read_table(path, columns=["status"])["status"] for path in self.parts}
        without = [path for path, said in read.items() if DONE not in said.to_pylist()]
        self._folder.base.clear(self._name(path) for path in without)

    def _split(self) -> None:
        """Write what is done of the table as a part, its signals first."""
        import pyarrow.parquet as pq

        there = self._folder.base
        done = pq.read_table(there.path / TABLE, filters=[("status", "==", DONE)])
        cases = done["case"].to_numpy()
        if self._signals:
            with there.writing(f"{self._prefix}kept.npz") as path:
                np.savez(path, cases=cases, **_read_signals(there.path / SIGNALS, cases))
        with there.writing(f"{self._prefix}kept.parquet") as path:
            pq.write_table(done, path)

    def keep(self) -> None:
        """Leave the table of an earlier sweep of this design as it is."""
        self._folder.keep((TABLE, SIGNALS) if self._signals else (TABLE,))

    def missing(self) -> list[int]:
        """Cases without a row in the parts."""
        there = np.zeros(self._design.n_cases, bool)
        there[self.rows("case")["case"]] = True
        return np.flatnonzero(~there).tolist()

    def rows(self, *names: str) -> dict[str, np.ndarray]:
        """Columns of all rows in the parts."""
        import pyarrow.parquet as pq

        parts = [pq.read_table(part, columns=list(names)) for part in self.parts]
        return {
            name: np.concatenate([part[name].to_numpy() for part in parts])
            if parts
            else np.zeros(0, int)
            for name in names
        }

    def add(self, rows: Rows) -> None:
        """Write rows; they are there complete or not at all. Raises ValueError where a file that
        they were made of changed."""
        import pyarrow.parquet as pq

        self._inputs.require_unchanged()
        name = f"{self._prefix}{min(rows.cases)}-{len(rows.cases)}"
        if rows.signals:  # first: a case counts as done by its row
            with self._folder.base.writing(f"{name}.npz") as path:
                np.savez(path, cases=rows.cases, **rows.signals)
        with self._folder.base.writing(f"{name}.parquet") as path:
            pq.write_table(self._arrow(rows), path)

    def _arrow(self, rows: Rows) -> Any:
        import pyarrow as pa

        keys = {
            key: _typed([values[i] for i in rows.cases], self._kinds[key])
            for key, values in self._design.columns.items()
        }
        found = {
            name: pa.array(values, pa.string() if name in TEXT else pa.float64())
            for name, values in rows.columns.items()
        }
        return pa.table({"case": pa.array(rows.cases, pa.int64()), **keys, **found})

    def finish(self, columns: Mapping[str, Any] = NOTHING) -> None:
        """The whole table, in order of the cases, as cases.parquet, with these values (n_cases,) in
        `columns` in place of the parts'; the parts go with the run. Raises ValueError where a file
        that they were made of changed."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._inputs.require_unchanged(whole=True)
        parts = [*self.parts, *self._signal_parts()]
        tables = [pq.read_table(part) for part in self.parts]
        whole = pa.concat_tables(tables, promote_options="permissive").sort_by("case")
        for name, values in columns.items():
            whole = whole.set_column(whole.column_names.index(name), name, pa.array(values))
        whole = whole.replace_schema_metadata({ABOUT: dumps(self._about())})
        with self._folder.writing(TABLE) as path:
            pq.write_table(whole, path)
        if kept := self._signal_parts():
            with self._folder.writing(SIGNALS) as path:
                _write_signals(path, kept, whole, self._spheres)
        self._folder.base.leave(self._name(part) for part in parts)

    def _about(self) -> dict[str, Any]:
        design = self._design
        about = {"kind": design.kind, "keys": design.keys, "base": design.base}
        return about | {"key": self._key, "units": self._units, "face": self._face}

    def _signal_parts(self) -> list[Path]:
        found = self._folder.base.path.glob(f"{self._prefix}*.npz")
        return [path for path in found if self._folder.base.ours(self._name(path))]

    def _name(self, path: Path) -> str:
        return path.relative_to(self._folder.base.path).as_posix()


def _typed(values: list[Any], kinds: set[type]) -> Any:
    """Numbers as they are, a column of anything else as text."""
    import pyarrow as pa

    if kinds <= {int, float}:
        number = float if float in kinds else int  # Arrow takes no whole number above 2^53 for one
        return pa.array([number(value) for value in values])
    return pa.array([v if isinstance(v, str) else dumps(v, default=str) for v in values])


def _write_signals(path: Path, parts: list[Path], table: Any, spheres: tuple[int, ...]) -> None:
    """Velocities and the wall's force of every case, as netCDF with named dimensions."""
    import h5netcdf

    with np.load(parts[0]) as first:
        t = first["t"]
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"case": table.num_rows, "time": t.size, "sphere": len(spheres)}
        _variable(file, "time", ("time",), t, "s", "time since the striker starts")
        _variable(file, "sphere", ("sphere",), np.array(spheres), "1", "counted from the striker")
        for key in table.column_names:
            values = table[key].to_numpy()
            if (key != "status" and values.dtype.kind == "f") or key == "case":
                _variable(file, key, ("case",), values, "", "see the table of cases")
        v = file.create_variable("v", ("case", "time", "sphere"), np.float32)
        force = file.create_variable("wall_force", ("case", "time"), np.float32)
        v.attrs.update(units="m/s", long_name="velocity towards the wall")
        force.attrs.update(units="N", long_name="contact force at the wall")
        for part in parts:
            with np.load(part) as one:
                for i, case in enumerate(one["cases"]):
                    v[case], force[case] = one["v"][i], one["wall_force"][i]


def _read_signals(path: Path, cases: np.ndarray) -> dict[str, np.ndarray]:
    """Of these cases, as a part has them."""
    import h5netcdf

    with h5netcdf.File(path, "r") as file:
        own = {name: file[name][:][cases] for name in ("v", "wall_force")}
        return {"t": file["time"][:], **own}


def _variable(
    file: Any, name: str, axes: tuple[str, ...], values: np.ndarray, unit: str, says: str
):
    found = file.create_variable(name, axes, values.dtype, data=values)
    found.attrs.update(units=unit, long_name=says)
