"""What a study leaves behind, tables, sentences and pictures: as text, as a record, as files."""

from collections.abc import Iterable
from itertools import chain, groupby
from json import dumps
from textwrap import fill
from typing import Any, NamedTuple

from workflows.files.run_folder import Picture, RunFolder, picture_named, write_pictures
from workflows.report import tables
from workflows.report.tables import LINE, Table
from workflows.scene import InvalidScene, nearest


class Finding(NamedTuple):
    """The first table is the study's own and bears its name; others stand beside it."""

    tables: tuple[Table, ...]
    sentences: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()

    def plot(self, name: str | None = None) -> Picture:
        """A picture by name, the first without one."""
        return picture_named(self.pictures, name)

    def data(self, name: str | None = None):
        """A table by name, the study's own without one, as an xarray.Dataset over its rows."""
        from workflows.report.arrays import of_table

        known = {table.name: table for table in self.tables}
        if name is not None and name not in known:
            raise InvalidScene(f"no table {name!r}; {nearest(name, known)}.")
        return of_table(self.tables[0] if name is None else known[name])

    def __repr__(self) -> str:
        return text(self)


def merged(found: Iterable[Finding]) -> Finding:
    """One finding of several; tables of the same name are joined, the first of all leads."""
    every, sentences, pictures = (tuple(chain(*parts)) for parts in zip(*found, strict=True))
    order = list(dict.fromkeys(table.name for table in every))
    named = groupby(sorted(every, key=lambda table: order.index(table.name)), lambda t: t.name)
    return Finding(tuple(_joined(list(same)) for _, same in named), sentences, pictures)


def _joined(same: list[Table]) -> Table:
    rows = tuple(chain(*(table.rows for table in same)))
    printed = [table.printed for table in same if table.printed]
    lines = (*printed[0][:1], *chain(*(lines[1:] for lines in printed))) if printed else ()
    return same[0]._replace(rows=rows, printed=lines)


def text(found: Finding) -> str:
    """Tables and sentences for a person."""
    printed = [tables.text(table) for table in found.tables if table.printed != ()]
    sentences = (fill(one, LINE, subsequent_indent="  ") for one in found.sentences)
    return "\n".join([*("\n\n".join(printed), ""), *sentences] if printed else sentences)


def record(found: Finding, **about: Any) -> dict[str, Any]:
    """For machines: rows, findings and the tables beside, after what is said `about` it."""
    own, *beside = found.tables
    more = {table.name: tables.records(table) for table in beside}
    return about | {"rows": tables.records(own), "findings": list(found.sentences)} | more


def files(name: str) -> tuple[str, str]:
    """What a study leaves in any case."""
    return f"{name}.csv", f"{name}.json"


def write(found: Finding, folder: RunFolder, **about: Any) -> None:
    """NAME.csv, NAME_BESIDE.csv of each table beside it, NAME.json and figures/ into a folder."""
    own = found.tables[0].name
    for table in found.tables:
        name = own if table.name == own else f"{own}_{table.name}"
        folder.write(f"{name}.csv", tables.as_csv(table))
    content = dumps(record(found, **about), indent=1, allow_nan=False)
    folder.write(f"{own}.json", content + "\n")
    write_pictures(folder, found.pictures)
