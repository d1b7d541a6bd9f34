"""The table of a sweep on disk: parts as cases are done, one Parquet file at the end."""

from collections.abc import Mapping
from json import dumps, loads
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from beadwave.system import adding
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.quantities import entries
from beadwave.workflows.stages.engine.cache import digest
from beadwave.workflows.sweep.core.case_row import DONE, FAILED, TEXT, Rows
from beadwave.workflows.sweep.core.design import Design
from beadwave.workflows.sweep.inputs import Inputs

TABLE, SIGNALS = "cases.parquet", "signals.nc"
ABOUT = b"beadwave"  # in the table's metadata: what it is a table of


def require_libraries(signals: bool) -> None:
    """Raise InvalidScene where a library that writes the tables is not installed."""
    try:
        import pyarrow  # noqa: F401

        if signals:
            import h5netcdf  # noqa: F401
    except ImportError as missing:
        raise InvalidScene(
            f"a sweep writes its table by {missing.name}, which is not installed; "
            f"{adding('sweep')} installs it."
        ) from None


class About(NamedTuple):
    """Metadata of a table besides its design: units of keys that no scene has, and the face whose
    points its cases are (name, axes, edges)."""

    units: dict[str, str]
    face: dict[str, Any] | None = None


NO_UNITS = About({})
NO_COLUMNS: Mapping[str, Any] = MappingProxyType({})


class Store:
    """Parts of a design's rows in a run folder, and the whole table of them."""

    def __init__(
        self, folder: RunFolder, design: Design, scene: Scene, signals: bool, inputs: Inputs,
        about: About = NO_UNITS,
    ) -> None:  # fmt: skip
        self._folder = folder
        self._inputs = inputs
        self._design = design
        self._spheres = scene.output.spheres if scene.output else ()
        self._signals = signals
        columns = design.columns.items()
        self._kinds = {key: {type(value) for value in values} for key, values in columns}
        units = {entry.key: entry.quantity.kind.unit for entry in entries(scene.written)}
        self._units = about.units | {key: units[key] for key in design.keys if key in units}
        self._face = about.face
        self._scene_toml = (folder.path / "scene.toml").read_text(encoding="utf-8")
        self._key = digest([self._scene_toml, design.digest, inputs.key])[:12]
        self._prefix = f"part-{self._key}{'-signals' if signals else ''}-"

    @property
    def parts(self) -> list[Path]:
        """Files of rows that are complete, of this design and scene alone."""
        paths = self._folder.base.path.glob(f"{self._prefix}*.parquet")
        return [path for path in paths if self._folder.base.ours(self._name(path))]

    def finished(self) -> bool:
        """True if the folder has the whole table of this design, scene and content of files."""
        has_signals = self._folder.base.ours(SIGNALS) or not self._signals
        return self._key_of_table() == self._key and has_signals

    def notes(self) -> tuple[str, ...]:
        """A sentence where the table of the same scene and cases is out of date."""
        base = self._folder.base
        if self._key_of_table() in (None, self._key) or not base.ours("scene.toml"):
            return ()
        if (base.path / "scene.toml").read_text(encoding="utf-8") != self._scene_toml:
            return ()
        reason = "since a file that it was made of changed, or the program did"
        return (f"replaced: the table in {base.path}, {reason}",)

    def _key_of_table(self) -> str | None:
        """The key in the metadata of the table in the folder; None without a table of ours."""
        import pyarrow.parquet as pq

        base = self._folder.base
        if not base.ours(TABLE):
            return None
        metadata = pq.read_schema(base.path / TABLE).metadata or {}
        return loads(metadata.get(ABOUT, b"{}")).get("key")

    def failed(self) -> int:
        """Cases with a row that says that they failed."""
        import pyarrow.parquet as pq

        paths = [self._folder.base.path / TABLE] if self.finished() else self.parts
        columns = (pq.read_table(path, columns=["status"])["status"] for path in paths)
        return sum(statuses.to_pylist().count(FAILED) for statuses in columns)

    def reopen(self) -> None:
        """Make the cases without a result missing; the others of the table are a part again."""
        import pyarrow.parquet as pq

        # rows with a result of a finished table become a part, their signals first: a case counts
        # as done by its row
        base = self._folder.base
        if not self.parts and self.finished():
            rows = pq.read_table(base.path / TABLE, filters=[("status", "==", DONE)])
            cases = rows["case"].to_numpy()
            if self._signals:
                import h5netcdf

                with h5netcdf.File(base.path / SIGNALS, "r") as file:
                    series = {name: file[name][:][cases] for name in ("v", "wall_force")}
                    series["t"] = file["time"][:]
                with base.writing(f"{self._prefix}kept.npz") as path:
                    np.savez(path, cases=cases, **series)
            with base.writing(f"{self._prefix}kept.parquet") as path:
                pq.write_table(rows, path)

        # parts without any result go
        read = {path: pq.read_table(path, columns=["status"])["status"] for path in self.parts}
        without = [path for path, status in read.items() if DONE not in status.to_pylist()]
        base.clear(self._name(path) for path in without)

    def keep(self) -> None:
        """Leave the table of an earlier sweep of this design as it is."""
        self._folder.keep((TABLE, SIGNALS) if self._signals else (TABLE,))

    def missing(self) -> list[int]:
        """Cases without a row in the parts."""
        has_row = np.zeros(self._design.n_cases, bool)
        has_row[self.rows("case")["case"]] = True
        return np.flatnonzero(~has_row).tolist()

    def rows(self, *names: str) -> dict[str, np.ndarray]:
        """Columns of all rows in the parts."""
        import pyarrow.parquet as pq

        tables = [pq.read_table(path, columns=list(names)) for path in self.parts]
        if not tables:
            return {name: np.zeros(0, int) for name in names}
        return {
            name: np.concatenate([table[name].to_numpy() for table in tables]) for name in names
        }

    def add(self, rows: Rows) -> None:
        """Write rows as a part, complete or not at all. Raises ValueError where a file that they
        were made of changed."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._inputs.require_unchanged()
        name = f"{self._prefix}{min(rows.cases)}-{len(rows.cases)}"
        if rows.signals:  # first: a case counts as done by its row
            with self._folder.base.writing(f"{name}.npz") as path:
                np.savez(path, cases=rows.cases, **rows.signals)

        # keys as numbers, or as text where one value of the whole design is none
        columns: dict[str, Any] = {"case": pa.array(rows.cases, pa.int64())}
        for key, values in self._design.columns.items():
            cells, kinds = [values[i] for i in rows.cases], self._kinds[key]
            if kinds <= {int, float}:
                # Arrow makes no float of an integer above 2^53
                number = float if float in kinds else int
                columns[key] = pa.array([number(cell) for cell in cells])
                continue
            columns[key] = pa.array(
                [cell if isinstance(cell, str) else dumps(cell, default=str) for cell in cells]
            )
        for column, values in rows.columns.items():
            columns[column] = pa.array(values, pa.string() if column in TEXT else pa.float64())
        with self._folder.base.writing(f"{name}.parquet") as path:
            pq.write_table(pa.table(columns), path)

    def finish(self, columns: Mapping[str, Any] = NO_COLUMNS) -> None:
        """The whole table, in order of the cases, as cases.parquet, with these values (n_cases,) in
        `columns` in place of the parts'; the parts go with the run. Raises ValueError where a file
        that they were made of changed."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._inputs.require_unchanged(by_content=True)
        base, design = self._folder.base, self._design

        # rows of all parts in the order of the cases; columns in place of theirs are those that
        # only the whole table could give
        signal_parts = [
            path for path in base.path.glob(f"{self._prefix}*.npz") if base.ours(self._name(path))
        ]
        parts = [*self.parts, *signal_parts]
        tables = [pq.read_table(path) for path in self.parts]
        table = pa.concat_tables(tables, promote_options="permissive").sort_by("case")
        for name, values in columns.items():
            table = table.set_column(table.column_names.index(name), name, pa.array(values))

        # the table says what it is a table of: `Sweep` and the next sweep read it
        about = {
            "kind": design.kind, "keys": design.keys, "base": design.base, "key": self._key,
            "units": self._units, "face": self._face,
        }  # fmt: skip
        table = table.replace_schema_metadata({ABOUT: dumps(about)})
        with self._folder.writing(TABLE) as path:
            pq.write_table(table, path)
        if signal_parts:
            with self._folder.writing(SIGNALS) as path:
                _write_signals(path, signal_parts, table, self._spheres)
        base.leave(self._name(part) for part in parts)

    def _name(self, path: Path) -> str:
        """Path of a file below the folder, as its marker has it."""
        return path.relative_to(self._folder.base.path).as_posix()


def _write_signals(path: Path, parts: list[Path], table: Any, spheres: tuple[int, ...]) -> None:
    """Velocities and the wall's force of every case, as netCDF with named dimensions.

    From the parts' arrays v (m, k, spheres) and wall_force (m, k) of their cases (m,), at times
    t (k,) that all parts share. One part at a time is read, as all may not fit into the memory;
    cases without a result stay at the fill value.
    """
    import h5netcdf

    with np.load(parts[0]) as first:
        t = first["t"]
    variables = [
        ("time", "time", t, "s", "time since the striker starts"),
        ("sphere", "sphere", np.array(spheres), "1", "counted from the striker"),
    ]
    # numeric columns of the table besides the signals
    for key in table.column_names:
        values = table[key].to_numpy()
        if (key != "status" and values.dtype.kind == "f") or key == "case":
            variables.append((key, "case", values, "", "see the table of cases"))
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"case": table.num_rows, "time": t.size, "sphere": len(spheres)}
        for name, axis, values, unit, long_name in variables:
            variable = file.create_variable(name, (axis,), values.dtype, data=values)
            variable.attrs.update(units=unit, long_name=long_name)
        v = file.create_variable("v", ("case", "time", "sphere"), np.float32)
        force = file.create_variable("wall_force", ("case", "time"), np.float32)
        v.attrs.update(units="m/s", long_name="velocity towards the wall")
        force.attrs.update(units="N", long_name="contact force at the wall")
        for part in parts:
            # an .npz reads an array from the file each time that it is asked for
            with np.load(part) as arrays:
                of_part = zip(*(arrays[name] for name in ("cases", "v", "wall_force")), strict=True)
            for case, v_of_case, force_of_case in of_part:
                v[case], force[case] = v_of_case, force_of_case
