"""Many cases of a scene: grids, samples and tables of values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from beadwave.workflows.files.own_folder import place
from beadwave.workflows.files.run_folder import RunFolder, write_pictures
from beadwave.workflows.files.scene import Changes, Source, files_read
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.toml import toml

if TYPE_CHECKING:
    from beadwave.workflows.sweep.cases import Base
    from beadwave.workflows.sweep.core.design import Design
    from beadwave.workflows.sweep.cost_estimate import Price
    from beadwave.workflows.sweep.result import Sweep

SWEEPS = Path("sweeps")  # of sweeps without a folder of their own
SCANS = Path("scans")
FILES = ("cases.parquet", "signals.nc")


class Cases(NamedTuple):
    """The cases of a sweep.

    `over` has the keys that vary, as {"striker.velocity": [0.3, 0.5]} or as texts of `--over`:
    "striker.velocity=0.1:1:10", "preload.force=1:100:5:log", "wall.kind=rigid,half-space". With
    `sample` "lhs:n" or "sobol:n" they are ranges, "striker.velocity=0.1:1". `table` is a CSV
    instead, with a line of keys and a line of values for each case. `again` computes those that
    an earlier sweep into the folder left without a result.
    """

    over: Mapping[str, Any] | Iterable[str] = ()
    sample: str | None = None
    table: str | Path | None = None
    seed: int = 0
    again: bool = False


def sweep(
    scene: Source = None,
    changes: Changes = (),
    *,
    over: Iterable[str] | Mapping[str, Any] = (),
    sample: str | None = None,
    cases: str | Path | Cases | Mapping[str, Any] | None = None,
    seed: int = 0,
    again: bool = False,
    out: str | Path | None = None,
    signals: bool = False,
    on: int | str = 1,
    overwrite: bool = False,
    told: Callable[[int, int], None] = lambda done, n: None,
) -> Sweep:
    """Every case once, into one table (`beadwave sweep`).

    over     a key that varies: start:stop:n, start:stop:n:log, or a list a,b,c; with --sample a
             range low:high or low:high:log. May be repeated; a unit is optional
    sample   samples of ranges: lhs:N, a Latin hypercube; sobol:N, N (keys + 2) cases for indices of
             Sobol
    cases    a CSV of cases: a line of keys, then values
    seed     random seed of --sample
    again    compute cases that have no result once more
    out      folder; default sweeps/NAME
    signals  keep velocities and wall force: signals.nc

    `over` is {"striker.velocity": [0.3, 0.5]} as well; `cases` may be such a dict too, or a Cases.
    `on` is how many processes compute walls that differ, or the address of a Dask scheduler. A
    sweep that was stopped goes on with what is missing. `told` is called with cases done and cases
    in all. Raises InvalidScene for bad input; a case that is refused or fails is a row of the
    table with its sentence.
    """
    from beadwave.workflows.sweep.cases import base_of
    from beadwave.workflows.sweep.result import opened
    from beadwave.workflows.sweep.store import require_libraries
    from beadwave.workflows.sweep.sweep import sweep as compute

    # which cases: the scene, the keys that vary, their values
    require_libraries(signals)
    base = base_of(scene, changes)
    described = _cases(over, sample, cases, seed, again)
    design, notes_on_design = _design(base, described, signals)

    # where: a folder that belongs to these cases of this scene
    scene_swept = base.with_values({})
    text = f"{toml(scene_swept)}\n# swept: {design.n_cases} cases, {design.digest}\n"
    path, notes = place(out, SWEEPS, scene_swept.name, text)
    inputs = files_read(scene_swept, scene, described.table)
    folder = RunFolder(path, inputs=inputs, overwrite=overwrite)

    # every case once, in this process or on a cluster, then pictures of the whole table
    engine_or_none: Any = nullcontext()
    if on != 1:
        from beadwave.workflows.sweep.cluster import engine as cluster

        engine_or_none = cluster(on)
    with folder.run(text, FILES) as folder, engine_or_none as engine:
        notes += notes_on_design + compute(
            base, design, folder, engine, signals=signals, progress=told, again=described.again
        )
        _draw(folder, design)
    return opened(path, notes)


def _draw(folder: RunFolder, design: Design) -> None:
    """Write the pictures of a table; raises InvalidScene where every case was refused."""
    from beadwave.workflows.sweep.result import opened

    table = opened(folder.find(FILES[0]).parent)
    _require_sound_case(design, table.counts().get("refused", 0), table.messages())
    write_pictures(folder, table.pictures())


def _require_sound_case(design: Design, refused: int, messages: Iterable[str]) -> None:
    """Raise InvalidScene where every case was refused."""
    if refused == design.n_cases:
        raise InvalidScene(f"all {refused} cases are refused; {next(iter(messages))}")


def scan(
    scene: Source = None,
    changes: Changes = (),
    *,
    face: str | None = None,
    grid: str = "20x20",
    out: str | Path | None = None,
    signals: bool = False,
    overwrite: bool = False,
    told: Callable[[int, int], None] = lambda done, n: None,
) -> Sweep:
    """The chain at every point of a grid over a plane face, into one table (`beadwave scan`).

    face     a plane face, body:+x; default the one that is struck
    grid     points along the two axes that span the face
    out      folder; default scans/NAME
    signals  keep velocities and wall force: signals.nc

    All points share one reduction;
    the errors of each are in the table. The reflected wave of a sphere is the same wave at all
    points, NaN where it cannot be told; `notes` of the result say where errors are large and how
    many waves are left out. Other arguments as in `sweep`; a scan that was stopped goes on with the
    points that are missing. Raises InvalidScene for bad input; a point
    whose patch leaves the face is a row with its sentence.
    """
    from beadwave.workflows.stages.structure.face import StruckFace
    from beadwave.workflows.sweep.cases import base_of
    from beadwave.workflows.sweep.result import opened
    from beadwave.workflows.sweep.scan import grid as grid_of
    from beadwave.workflows.sweep.scan import scan as compute
    from beadwave.workflows.sweep.scan import struck_scene
    from beadwave.workflows.sweep.store import require_libraries

    require_libraries(signals)
    points, base = grid_of(grid), base_of(scene, changes)
    scene_scanned = struck_scene(base, face)
    text = f"{toml(scene_scanned)}\n# scanned: {points.rows}x{points.columns} points\n"
    path, notes = place(out, SCANS, scene_scanned.name, text)
    inputs = files_read(scene_scanned, scene)
    folder = RunFolder(path, inputs=inputs, overwrite=overwrite)
    with folder.run(text, FILES) as folder:
        struck = StruckFace(scene_scanned)
        design = points.design(struck)
        notes += compute(struck, design, folder, signals=signals, progress=told)
        _draw(folder, design)
    return opened(path, notes)


def sweep_price(
    scene: Source = None,
    changes: Changes = (),
    *,
    over: Iterable[str] | Mapping[str, Any] = (),
    sample: str | None = None,
    cases: str | Path | Cases | Mapping[str, Any] | None = None,
    seed: int = 0,
    processes: int | None = None,
) -> Price:
    """Cases, shared models, seconds and memory of a sweep, timed on its first cases; arguments as
    in `sweep`."""
    from beadwave.workflows.sweep.cases import base_of
    from beadwave.workflows.sweep.cluster import require_processes
    from beadwave.workflows.sweep.cost_estimate import price

    base = base_of(scene, changes)
    design, notes = _design(base, _cases(over, sample, cases, seed), signals=False)
    require_processes(processes or 1)
    expected = price(base, design, processes or 1)
    _require_sound_case(design, expected.refused, expected.notes)
    return expected._replace(notes=expected.notes + notes)


def load_sweep(folder: str | Path) -> Sweep:
    """A finished sweep from its folder; raises InvalidScene where it holds no table."""
    from beadwave.workflows.sweep.result import opened

    return opened(folder)


def _cases(
    over: Iterable[str] | Mapping[str, Any],
    sample: str | None,
    cases: str | Path | Cases | Mapping[str, Any] | None,
    seed: int,
    again: bool = False,
) -> Cases:
    """The cases that the arguments of a sweep describe."""
    if isinstance(cases, Cases):
        return cases
    if isinstance(cases, Mapping):
        return Cases(cases, sample, None, seed, again)
    return Cases(over, sample, cases, seed, again)


def _design(base: Base, cases: Cases, signals: bool) -> tuple[Design, tuple[str, ...]]:
    """The design that the cases describe, and notes on changes to keys that it varies and on bolts
    that are overloaded in a case; raises InvalidScene where the base cannot take its keys."""
    from beadwave.workflows.stages.warnings import overloaded_bolts
    from beadwave.workflows.sweep import design_words as designs
    from beadwave.workflows.sweep.cases import largest_utilisations
    from beadwave.workflows.sweep.sweep import require_keys

    # values of a mapping as `--over` takes them; a text, start:stop:n for instance, as it is
    over = cases.over
    if isinstance(over, Mapping):
        from json import dumps

        lists = {
            key: values if isinstance(values, str) else ",".join(
                dumps(value.item() if hasattr(value, "item") else value) for value in values
            )
            for key, values in over.items()
        }  # fmt: skip
        over = [f"{key}={values}" for key, values in lists.items()]
    texts = (over,) if isinstance(over, str) else tuple(over)
    if cases.table is not None:
        if texts or cases.sample:
            raise InvalidScene("--cases has all values; leave out --over and --sample.")
        design = designs.table(Path(cases.table), base.number)
    elif cases.seed < 0:
        raise InvalidScene(f"--seed {cases.seed} must be 0 or above; change it.")
    elif cases.sample:
        design = designs.sampled(texts, cases.sample, cases.seed, base.number)
    else:
        design = designs.grid(texts, base.number)
    require_keys(base, design, signals)
    overloaded = tuple(overloaded_bolts(largest_utilisations(base, design)))
    return design, designs.require_free(design, base.given) + overloaded
