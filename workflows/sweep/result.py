"""A finished sweep: its table, effects of the keys, and pictures."""

from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from json import loads
from pathlib import Path
from typing import Any

import numpy as np

from beadwave.system import adding
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.report import tables
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import InvalidScene, nearest
from beadwave.workflows.scene.named_files import unfit
from beadwave.workflows.stages.warnings import CURES
from beadwave.workflows.sweep.core.case_row import DONE, LARGE_ERROR, TEXT, other_wave
from beadwave.workflows.sweep.core.design import Design
from beadwave.workflows.sweep.core.effects import Effects, rank_correlations, sobol_effects
from beadwave.workflows.sweep.store import ABOUT, SIGNALS, TABLE

N_DRAWN = 6  # modes of scenes without a chain that are drawn by default
SHOWN = 40  # cases of a table on a terminal
MAIN = ("echo_delay_s", "echo_ratio")
ERRORS = ("error_time", "error_reduction", "error_mesh")  # columns, of the striker's speed
Array = np.ndarray


class Sweep:
    """A row a case, what outputs depend on, and pictures.

    design    which cases there are
    columns   the table's columns by name, keys first; (n_cases,) arrays
    units     of keys, where they have one
    folder    where cases.parquet is
    face      of a scan: its name, axes and edges; None of other sweeps
    notes     notes for the user on folder and errors, in sentences
    """

    def __init__(self, folder: Path, table: Any, notes: tuple[str, ...] = ()) -> None:
        self.folder = folder
        about = loads(table.schema.metadata[ABOUT])
        self.columns = {
            name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names
        }
        keys = {key: tuple(self.columns[key].tolist()) for key in about["keys"]}
        self.design = Design(about["kind"], keys, about["base"])
        self.units: dict[str, str] = about["units"]
        self.face: dict[str, Any] | None = about.get("face")
        self.notes = (
            *notes,
            *_of_large_errors(self.columns, "points" if self.face else "cases"),
            *(_of_points(self.columns) if self.face else _of_sizes(self.columns)),
            *_of_the_striker(self.columns),
        )

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Columns with numbers that cases have."""
        no_outputs = {"case", "seconds", *self.design.keys, *TEXT}
        return tuple(
            name for name, values in self.columns.items()
            if name not in no_outputs and np.isfinite(values).any()
        )  # fmt: skip

    @property
    def main(self) -> tuple[str, ...]:
        """Columns that are drawn by default: of each chain echo delay and ratio at its last sphere
        and the force at the wall, and of friction the surface's velocity and the loop."""
        chains: dict[str, list[str]] = {}
        for name in self.outputs:
            if name.endswith(MAIN):
                chains.setdefault(name[: name.rindex("sphere_")], []).append(name)
        waves = [name for names in chains.values() for name in names[-len(MAIN) :]]
        walls = (f"{chain}wall_peak_force_N" for chain in chains or [""])
        further = (*walls, "surface_velocity_ratio", "loop_energy_J")
        modes = [name for name in self.outputs if name.endswith("_hz")]
        if modes:
            return tuple(modes[:N_DRAWN])
        return (*waves, *(n for n in self.outputs if n in further))

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
        from beadwave.workflows.sweep.sweep_pictures import face_map, picture

        name = output or next(iter(self.main), "")
        if self.face and keys is None:
            return face_map(name, self._output(name), self.columns, self.face)
        drawn = keys or self.design.keys
        for key in drawn:
            _require_name(key, self.design.keys, "key")
        of_keys, others = (
            {self._with_unit(key): self.columns[key] for key in some}
            for some in (drawn, [key for key in self.design.keys if key not in drawn])
        )
        return picture(name, self._output(name), of_keys, others)

    def pictures(self) -> tuple[Picture, ...]:
        """Pictures of the main outputs."""
        return tuple(self.plot(name) for name in self.main)

    def _output(self, name: str) -> Array:
        _require_name(name, self.outputs, "output")
        return self.columns[name]

    def counts(self) -> dict[str, int]:
        """Numbers of cases that are done, refused and failed."""
        return dict(Counter(self.columns["status"].tolist()))

    def messages(self) -> dict[str, int]:
        """Sentences of cases without a result, the most frequent first."""
        rows = zip(self.columns["status"].tolist(), self.columns["message"].tolist(), strict=True)
        return dict(Counter(m for status, m in rows if m and status != DONE).most_common())

    def found(self) -> tuple[Table, ...]:
        """The table or, of many cases, the range of each output; and what outputs depend on."""
        first = self._cases() if self.design.n_cases <= SHOWN else self._ranges()
        effects = self._effects()
        return (first,) if effects is None else (first, effects)

    def _cases(self) -> Table:
        """Keys, main outputs and status of every case, to the digits that its errors support."""
        names = (*self.design.keys, *self.main, "status")
        columns = [self.columns[name].tolist() for name in names]
        n = len(self.design.keys)
        texts = [
            *map(tables.apart, columns[:n]),
            *(tables.apart(column, self._digits, zeros=True) for column in columns[n:]),
        ]
        heading = tuple(map(self._with_unit, names))
        rows = zip(*columns, strict=True)
        return Table("cases", names, tuple(rows), (heading, *zip(*texts, strict=True)))

    @cached_property
    def _digits(self) -> int:
        """Most digits of an output that the smallest of the rows' largest errors supports, 3 to 6;
        of errors that are not known, 6."""
        errors = [self.columns[name] for name in ERRORS if name in self.columns]
        known = np.nan_to_num(errors, nan=0.0).max(axis=0, initial=0.0)
        smallest = known[known > 0].min(initial=1.0)
        return int(np.clip(np.ceil(-np.log10(smallest)), 3, 6)) if (known > 0).any() else 6

    def _with_unit(self, name: str) -> str:
        """The name of a column, with the unit of a key that has one."""
        return f"{name} [{self.units[name]}]" if name in self.units else name

    def _ranges(self) -> Table:
        """Smallest, median and largest value of each output, over the cases that have one."""
        rows = []
        for name in self.outputs:
            y = self.columns[name][np.isfinite(self.columns[name])]
            rows.append((name, float(y.min()), float(np.median(y)), float(y.max())))
        heading = "output", "smallest", "median", "largest"
        texts = ((name, *tables.apart(values, self._digits)) for name, *values in rows)
        return Table("outputs", heading, tuple(rows), (heading, *texts))

    def _effects(self) -> Table | None:
        """Sobol's indices of the main outputs, or rank correlations of a Latin hypercube; None for
        other designs and where no output has any."""
        rows: list[tuple[Any, ...]] = []
        if self.design.kind == "sobol":
            heading: tuple[str, ...] = ("output", "key", "first order", "+-", "total", "+-  ")
            for name in self.main:
                try:
                    effects = sobol_effects(self.design, self.columns[name])
                except ValueError:
                    continue
                for i, key in enumerate(self.design.keys):
                    first = float(effects.first[i]), float(effects.first_error[i])
                    total = float(effects.total[i]), float(effects.total_error[i])
                    rows.append((name, key, *first, *total))
        elif self.design.kind == "lhs":
            heading = ("output", "key", "rank correlation")
            for name in self.main:
                correlations = rank_correlations(self.design, self.columns[name])
                rows += [(name, key, value) for key, value in correlations.items()]
        return Table("effects", heading, tuple(rows)) if rows else None

    def text(self) -> str:
        """Tables, effects and messages of the sweep as text."""
        counts = ", ".join(f"{n} {status}" for status, n in self.counts().items())
        messages = [f"{n} x {sentence}" for sentence, n in list(self.messages().items())[:5]]
        texts = [tables.text(table) for table in self.found()]
        return "\n\n".join([f"{self.design.n_cases} cases: {counts}", *texts, *messages])

    def record(self) -> dict[str, Any]:
        """The sweep for JSON: numbers of cases by status, and the tables as records."""
        records = {table.name: tables.records(table) for table in self.found()}
        about = {"cases": self.design.n_cases, "status": self.counts(), "folder": str(self.folder)}
        return {**about, "done": self.counts().get(DONE, 0), **records}


def _of_large_errors(columns: dict[str, Array], rows: str) -> Iterator[str]:
    """Sentences on the rows, "cases" or "points", whose errors are large."""
    has_result = columns["status"] == DONE
    n, no_errors = has_result.sum(), np.zeros(len(has_result))
    for source in ("reduction", "mesh"):
        error = columns.get(f"error_{source}", no_errors)[has_result]
        large = error > LARGE_ERROR
        if large.any():
            of = "the striker's speed" if "error_reduction" in columns else "a frequency"
            yield (
                f"The error of the {source} is above {100 * LARGE_ERROR:g} % of {of} "
                f"{'at' if rows == 'points' else 'in'} {large.sum()} of {n} {rows}, "
                f"{100 * np.nanmax(error):.2g} % at the worst, see error_{source} in the table: "
                f"{CURES[source]}."
            )


def _of_sizes(columns: dict[str, Array]) -> Iterator[str]:
    """A sentence on the cases whose mesh misses more than mesh.error, by the sizes that the scene
    swept has chosen."""
    marked = (columns["status"] == DONE) & (columns["message"] != "")
    if marked.any():
        yield (
            f"The mesh states more than mesh.error asks for in {marked.sum()} of "
            f"{(columns['status'] == DONE).sum()} cases; `message` in the table says by how much."
        )


def _of_points(columns: dict[str, Array]) -> Iterator[str]:
    """Sentences on the points of a scan whose error of the mesh is unknown, and whose reflected
    wave is not that of the points around."""
    has_result = columns["status"] == DONE
    n = has_result.sum()
    unknown = has_result & np.isnan(columns["error_mesh"])
    if unknown.any():
        yield (
            f"error_mesh is not known at {unknown.sum()} of {n} points; `message` in the table "
            "says why."
        )
    messages = Counter(
        text for joined in columns["message"].tolist() for text in joined.split("; ")
    )
    for name in (name for name in columns if name.endswith("_reflected_s")):
        sphere = int(name.split("_")[1])
        if n_blank := messages[other_wave(sphere)]:
            yield (
                f"The reflected wave at sphere {sphere} is left blank at {n_blank} of {n} points: "
                "it is not that of the points around, or cannot be told."
            )


def _of_the_striker(columns: dict[str, Array]) -> Iterator[str]:
    """A sentence where sphere 1 alone is observed, to which no incident wave comes."""
    delays = [name for name in columns if name.endswith("_echo_delay_s")]
    if delays == ["sphere_1_echo_delay_s"] and not np.isfinite(columns[delays[0]]).any():
        yield (
            "Only sphere 1 is observed. It strikes, so that no incident wave passes it, and has "
            "neither an echo delay nor an echo ratio: observe one within the chain as well, "
            "output.spheres = [1, 5] for example."
        )


def _require_name(name: str, names: tuple[str, ...], what: str) -> None:
    if name not in names:
        raise InvalidScene(f"{what} {name!r} is not in the sweep; {nearest(name, names)}.")


def opened(folder: str | Path, notes: tuple[str, ...] = ()) -> Sweep:
    """A sweep's folder; raises InvalidScene where it holds no table of ours, and where the library
    that reads it is not installed."""
    path = Path(folder) / TABLE
    if why := unfit(path):
        raise InvalidScene(f"{path} {why}; give the folder of a sweep.")
    try:
        import pyarrow.parquet as pq

        table = pq.read_table(path)
        about = table.schema.metadata
        names = table.column_names
        for former, today in zip(("_tof_s", "_arr"), MAIN, strict=True):  # of earlier versions
            names = [
                f"{name.removesuffix(former)}_{today}"
                if name.startswith("sphere_") and name.endswith(former)
                else name
                for name in names
            ]
        table = table.rename_columns(names).replace_schema_metadata(about)
        return Sweep(Path(folder), table, notes)
    except ImportError as missing:
        raise InvalidScene(
            f"{path} is read by {missing.name}, which is not installed; {adding('sweep')}."
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as reason:
        first_line = str(reason).splitlines()[0]
        raise InvalidScene(f"{path} is no table of a sweep ({first_line}); sweep again.") from None
