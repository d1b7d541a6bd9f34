"""Studies that make figures of the thesis again: their names, and what each leaves behind."""

from importlib import import_module
from json import dumps
from math import isfinite, isnan
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

from workflows.accuracy.accuracy import aligned, short, table_csv
from workflows.run_folder import Picture, RunFolder, write_pictures
from workflows.scene import InvalidScene, Scene, nearest
from workflows.stages import Watch

LINE = 100  # characters of a sentence's lines on a terminal


class Table(NamedTuple):
    """Numbers that are too many to read: kept as CSV and JSON, not printed."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple, ...]


class Finding(NamedTuple):
    """A study's table (columns, rows), sentences for a reader, plots."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple, ...]
    sentences: tuple[str, ...]
    pictures: tuple[Picture, ...]
    beside: tuple[Table, ...] = ()


class Entry(NamedTuple):
    """A study's function "module:name" and what it shows."""

    function: str
    shows: str


STUDIES = {
    "singularity": Entry(
        "workflows.studies.singularity:singularity",
        "thesis, figures 6.2 and 6.3: the contact node gives way the more the finer the mesh",
    ),
    "joints": Entry(
        "workflows.studies.joints:joints",
        "thesis, table 5.3: modes 2 and 3 in conflict, and what each freedom of a joint buys",
    ),
    "damping": Entry(
        "workflows.studies.damping:damping",
        "thesis, figures 6.5 and 6.6: an undamped wall, and what its Rayleigh damping means",
    ),
    "energy": Entry(
        "workflows.studies.energy:energy",
        "thesis, figures 7.1 to 7.9: energy with and without the wall's share, two schemes",
    ),
    "wall-thickness": Entry(
        "workflows.studies.wall_thickness:wall_thickness",
        "thesis, section 2.2.2: waves from plates of any thickness, Zener's and solid ones",
    ),
    "boundary-distance": Entry(
        "workflows.studies.boundary_distance:boundary_distance",
        "thesis, section 2.2.2: waves from a plate struck ever nearer to its clamped edge",
    ),
    "wall-modulus": Entry(
        "workflows.studies.wall_modulus:wall_modulus",
        "thesis, figure 2.8: contact time and secondary waves against the wall's modulus",
    ),
    "sphere-mass": Entry(
        "workflows.studies.sphere_mass:sphere_mass",
        "thesis, figure 2.9: lighter and heavier spheres, by size and by density",
    ),
    "striker": Entry(
        "workflows.studies.striker:striker",
        "thesis, section 2.2.1: scaling with the striker's speed, trains from a heavy one",
    ),
    "walls": Entry(
        "workflows.studies.walls:walls",
        "thesis, figures 7.13 to 7.16: the waves that ten walls send back, and how far they differ",
    ),
    "plastic-contact": Entry(
        "workflows.studies.plastic_contact:plastic_contact",
        "thesis, section 7.2: three times the stiffness beside a contact that yields",
    ),
    "rig": Entry(
        "workflows.studies.rig:rig",
        "thesis, section 7.2: what is said of the experiment, against each unknown of the rig",
    ),
}


def listing() -> str:
    """The studies, a line each."""
    return "\n".join(f"{name:20}{entry.shows}" for name, entry in STUDIES.items())


def study(name: str, scene: Scene, watch: Watch) -> Finding:
    """Run a study on the scene's assembly; raises InvalidScene for a name that is none."""
    if name not in STUDIES:
        raise InvalidScene(f"study {name!r} is not known; {nearest(name, STUDIES)}.")
    module, function = STUDIES[name].function.split(":")
    found = getattr(import_module(module), function)(scene, watch)
    return found._replace(rows=_without_nan(found.rows))


def _without_nan(rows: tuple[tuple, ...]) -> tuple[tuple, ...]:
    """What has no number is None, a dash in the table."""
    return tuple(
        tuple(None if isinstance(value, float) and isnan(value) else value for value in row)
        for row in rows
    )


def text(found: Finding) -> str:
    """The table and the sentences."""
    cells = [found.columns, *(tuple(map(short, row)) for row in found.rows)]
    sentences = (fill(one, LINE, subsequent_indent="  ") for one in found.sentences)
    return "\n".join([aligned(cells, left=1), "", *sentences])


def json(found: Finding) -> str:
    """For machines."""
    beside = {table.name: _records(table) for table in found.beside}
    all_of_it = {"study": found.name, "rows": _records(found), "findings": found.sentences} | beside
    return dumps(all_of_it, indent=1, allow_nan=False)


def _records(table: Table | Finding) -> list[dict]:
    """JSON knows no infinite number."""
    return [
        {
            name: None if isinstance(value, float) and not isfinite(value) else value
            for name, value in zip(table.columns, row, strict=True)
        }
        for row in table.rows
    ]


def write(found: Finding, out: Path) -> None:
    """NAME.csv, NAME.json and figures/ into a folder."""
    folder = RunFolder(out)
    folder.make()
    folder.write(f"{found.name}.csv", table_csv(found.columns, found.rows))
    for table in found.beside:
        folder.write(f"{found.name}_{table.name}.csv", table_csv(table.columns, table.rows))
    folder.write(f"{found.name}.json", json(found) + "\n")
    write_pictures(folder, found.pictures)
