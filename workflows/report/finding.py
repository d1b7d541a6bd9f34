"""The result of a study, tables, sentences and pictures: as text, as a record, as files."""

from collections.abc import Iterable
from itertools import chain
from json import dumps
from textwrap import fill
from typing import Any, NamedTuple

from beadwave.workflows.files.run_folder import Picture, RunFolder, picture_named, write_pictures
from beadwave.workflows.report import tables
from beadwave.workflows.report.tables import LINE, Table
from beadwave.workflows.scene import InvalidScene, nearest


class Finding(NamedTuple):
    """The result of a study; the first table has the study's name, others come after it."""

    tables: tuple[Table, ...]
    sentences: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()

    def plot(self, name: str | None = None) -> Picture:
        """A picture by name, the first without one."""
        return picture_named(self.pictures, name)

    def data(self, name: str | None = None):
        """A table by name, the study's own without one, as an xarray.Dataset over its rows; raises
        InvalidScene for a name that is none of them."""
        from beadwave.workflows.report.arrays import of_table

        by_name = {table.name: table for table in self.tables}
        if name is not None and name not in by_name:
            raise InvalidScene(f"no table {name!r}; {nearest(name, by_name)}.")
        return of_table(self.tables[0] if name is None else by_name[name])

    def __repr__(self) -> str:
        return text(self)


def merged(findings: Iterable[Finding]) -> Finding:
    """One finding of several: tables of the same name are joined, and the first table leads.

    What is printed of joined tables is what each of them prints, under the headings of the first.
    """
    all_tables, sentences, pictures = (
        tuple(chain(*of_findings)) for of_findings in zip(*findings, strict=True)
    )
    by_name: dict[str, list[Table]] = {}
    for table in all_tables:
        by_name.setdefault(table.name, []).append(table)

    joined = []
    for same in by_name.values():
        rows = tuple(chain(*(table.rows for table in same)))
        # headings and rows of each as it prints them; () of one that prints nothing
        printed = [lines for table in same if (lines := tables.lines(table))]
        if all(table.printed is None for table in same):
            lines = None
        else:
            lines = (*printed[0][:1], *chain(*(lines[1:] for lines in printed))) if printed else ()
        joined.append(same[0]._replace(rows=rows, printed=lines))
    return Finding(tuple(joined), sentences, pictures)


def text(finding: Finding) -> str:
    """Tables and sentences for a person."""
    printed = [tables.text(table) for table in finding.tables if table.printed != ()]
    sentences = (fill(sentence, LINE, subsequent_indent="  ") for sentence in finding.sentences)
    return "\n".join([*("\n\n".join(printed), ""), *sentences] if printed else sentences)


def record(finding: Finding, **about: Any) -> dict[str, Any]:
    """For machines: rows, findings and the other tables by name, behind what `about` says."""
    main, *others = finding.tables
    by_name = {table.name: tables.records(table) for table in others}
    return about | {"rows": tables.records(main), "findings": list(finding.sentences)} | by_name


def files(name: str) -> tuple[str, str]:
    """Names of the two files that a study of this name always writes."""
    return f"{name}.csv", f"{name}.json"


def write(finding: Finding, folder: RunFolder, **about: Any) -> None:
    """NAME.csv, NAME_OTHER.csv of each other table, NAME.json and figures/ into a folder."""
    main = finding.tables[0].name
    for table in finding.tables:
        name = main if table.name == main else f"{main}_{table.name}"
        folder.write(f"{name}.csv", tables.as_csv(table))
    content = dumps(record(finding, **about), indent=1, allow_nan=False)
    folder.write(f"{main}.json", content + "\n")
    write_pictures(folder, finding.pictures)
