"""Many cases of a scene: grids, samples and tables of values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from os import sched_getaffinity
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workflows.files.run_folder import RunFolder, own_folder
from workflows.files.scene import Changes, Source, files_read
from workflows.scene import InvalidScene
from workflows.scene.toml import toml

if TYPE_CHECKING:
    from workflows.sweep.cases import Base
    from workflows.sweep.design import Design
    from workflows.sweep.price import Price
    from workflows.sweep.result import Sweep

SWEEPS = Path("sweeps")  # of sweeps without a folder of their own
FILES = ("cases.parquet", "signals.nc")


def sweep(
    scene: Source = None,
    changes: Changes = (),
    *,
    over: Mapping[str, Any] | Iterable[str] = (),
    sample: str | None = None,
    cases: str | Path | None = None,
    seed: int = 0,
    out: str | Path | None = None,
    scheduler: str | None = None,
    workers: int | None = None,
    signals: bool = False,
    overwrite: bool = False,
    told: Callable[[int, int], None] = lambda done, n: None,
) -> Sweep:
    """Every case once, into one table (`beadwave sweep`).

    `over` has the keys that vary, as {"striker.velocity": [0.3, 0.5]} or texts as of `--over`:
    "striker.velocity=0.1:1:10", "preload.force=1:100:5:log", "wall.kind=rigid,half-space". With
    `sample` "lhs:n" or "sobol:n" they are ranges, "striker.velocity=0.1:1". `cases` is a CSV with
    a line of keys and a line of values for each case. `scheduler` is the address of a Dask
    cluster; `workers` processes of this machine compute walls that differ. `signals` keeps the
    velocities of all cases. A sweep that was stopped goes on with what is missing. `told` is
    called with cases done and cases in all. Raises InvalidScene for bad input; a case that is
    refused or fails is a row of the table with its sentence.
    """
    from workflows.sweep.cases import base_of
    from workflows.sweep.result import opened
    from workflows.sweep.store import require_libraries
    from workflows.sweep.sweep import require_keys
    from workflows.sweep.sweep import sweep as compute

    require_libraries(signals)
    base = base_of(scene, changes)
    design = _design(base, over, sample, cases, seed)
    require_keys(base, design, signals)
    chosen = base.with_values({})
    text = toml(chosen)
    path = Path(out) if out else own_folder(SWEEPS, chosen.name, text)
    read = (*files_read(chosen, scene), *([Path(cases)] if cases else []))
    folder = RunFolder(path, inputs=read, overwrite=overwrite)
    with folder.run(text, FILES), _engine(base, design, scheduler, workers) as engine:
        compute(base, design, folder, engine, signals=signals, told=told)
        found = opened(path)
        for picture in found.pictures():
            folder.write(f"figures/{picture.name}.png", picture.png)
    return found


def sweep_price(
    scene: Source = None,
    changes: Changes = (),
    *,
    over: Mapping[str, Any] | Iterable[str] = (),
    sample: str | None = None,
    cases: str | Path | None = None,
    seed: int = 0,
    workers: int | None = None,
) -> Price:
    """Cases, shared models, seconds and memory of a sweep, timed on its first cases."""
    from workflows.sweep.cases import base_of
    from workflows.sweep.price import price
    from workflows.sweep.sweep import require_keys

    base = base_of(scene, changes)
    design = _design(base, over, sample, cases, seed)
    require_keys(base, design, False)
    return price(base, design, workers or len(sched_getaffinity(0)))


def load_sweep(folder: str | Path) -> Sweep:
    """A finished sweep, from its folder."""
    from workflows.sweep.result import opened

    return opened(folder)


def _design(base: Base, over: Any, sample: str | None, cases: Any, seed: int) -> Design:
    from workflows.sweep import design

    texts = [over] if isinstance(over, str) else over
    if isinstance(over, Mapping):
        texts = [f"{key}={_listed(values)}" for key, values in over.items()]
    texts = tuple(texts)
    if cases is not None:
        if texts or sample:
            raise InvalidScene("--cases has all values; leave out --over and --sample.")
        return design.table(Path(cases))
    if sample:
        return design.sampled(texts, sample, seed, base.number)
    return design.grid(texts, base.number)


def _listed(values: Any) -> str:
    """Values as `--over` takes them; a text, start:stop:n for instance, as it is."""
    if isinstance(values, str):
        return values
    from json import dumps

    return ",".join(dumps(getattr(value, "item", lambda v=value: v)()) for value in values)


def _engine(base: Base, design: Design, scheduler: str | None, workers: int | None) -> Any:
    """Processes where a cluster or several are asked for; this one otherwise."""
    if scheduler is None and (workers or 1) == 1:
        return nullcontext()
    from workflows.sweep.cluster import engine

    return engine(scheduler, workers)
