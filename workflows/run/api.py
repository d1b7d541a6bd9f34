"""Runs and impacts: a scene in, numbers, arrays, pictures and films out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from beadwave.workflows.files.own_folder import OutputFolder, given, place
from beadwave.workflows.files.run_folder import Picture, RunFolder, picture_named
from beadwave.workflows.files.scene import Changes, Source, built_in, each, files_read
from beadwave.workflows.files.scene import scene as _loaded
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.report.provenance import origin
from beadwave.workflows.report.summary import Summary
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.named_files import require_file
from beadwave.workflows.scene.required_parts import with_spheres
from beadwave.workflows.scene.toml import toml
from beadwave.workflows.stages.engine.progress import Progress, quiet

if TYPE_CHECKING:
    import xarray

    from beadwave.rom import ReducedModel


def scene(source: Source = None, changes: Changes = ()) -> Scene:
    """A scene, checked, with every default filled in.

    `source` is the name of a built-in scene (`scenes()` lists them), a TOML file, a dict of
    tables, or a Scene; None is the rig with its reduced model, rig-rom. `changes` sets values
    by their dotted keys, {"chain.radius": 0.005} or "chain.radius=5mm". All functions that take
    a scene take these two. Raises InvalidScene with the key, the value found and the one allowed.

    >>> scene("rig-rigid", {"striker.velocity": 0.5}).striker.velocity
    0.5
    """
    return _loaded(source, changes)


def scenes() -> dict[str, str]:
    """The built-in scenes, name to what each shows, the default first."""
    return {name: text.splitlines()[0].removeprefix("# ") for name, text in built_in().items()}


RUNS = Path("runs")  # of runs without a folder of their own


@dataclass(frozen=True, repr=False)
class Run:
    """Results of a run.

    scene     as it was run, every default filled in
    summary   single numbers: `summary.peak_wall_force_N`, `summary.modes_hz`, `summary.waves`, ...
    arrays    of the trajectory by name, see the run folder's trajectory.npz
    data      the same as an xarray.Dataset: dimensions time, sphere, contact, of a crystal also
              axis, each with its unit
    folder    the run folder, None where nothing was written
    notes     what the user is to know of the folder, in sentences
    """

    scene: Scene
    summary: Summary
    folder: Path | None
    notes: tuple[str, ...]
    read: Callable[[], dict[str, NDArray]] = field(repr=False)
    draw: Callable[[], Iterable[Picture]] = field(repr=False)

    @cached_property
    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Arrays of the trajectory by name, in SI units; none of a scene without a chain."""
        return self.read()

    @property
    def data(self) -> xarray.Dataset:
        """The trajectory with named dimensions and units; raises InvalidScene without a chain."""
        if not self.arrays:
            raise InvalidScene(f"{self.summary.scene} has no spheres, and so no trajectory.")
        from beadwave.workflows.report.arrays import of_trajectory

        return of_trajectory(self.arrays)

    def plot(self, name: str | None = None) -> Picture:
        """A picture of the run: velocities, waves, energies, and of an assembly also assembly,
        modes, frequency_response; the first there is without a name. A notebook shows it."""
        return picture_named(self.draw(), name)

    def text(self) -> str:
        """The summary for a person."""
        from beadwave.workflows.report.summary_rows import details, headline

        lines = (*headline(self.summary), *details(self.summary))
        text = "\n".join(f"{label:>36}  {value}" for label, value in lines)
        return text.replace("\u00a0", " ")

    def __repr__(self) -> str:
        return f"{self.summary.scene}\n{self.text()}"


def run(
    scene: Source = None,
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
    waves_known: Callable[[Summary], None] = lambda summary: None,
) -> Run:
    """Every stage that a scene needs, into a run folder (`beadwave run`).

    out     run folder; default runs/NAME

    It gets scene.toml, given.toml, summary.json,
    trajectory.npz, figures, report.html, and of an assembly rom.npz, rom.mat, modes.vtu. Files
    that no run left there are only replaced with `overwrite`. Waves come first: `waves_known` is
    called with a summary of them, before errors are estimated and pictures drawn. `progress` is
    entered with the name of every stage that is computed. `scene` and `changes` as in
    `beadwave.scene`.
    Raises InvalidScene for bad input, ValueError where a computation fails.
    """
    chosen = load_scene(scene, changes)
    from beadwave.workflows.run.run import run as run_stages
    from beadwave.workflows.stages.engine.pipeline import (
        pipeline_of,  # a scene that is refused loads no solver
    )

    path, notes = place(out, RUNS, chosen.name, toml(chosen))
    folder = RunFolder(path, inputs=files_read(chosen, scene), overwrite=overwrite)
    command = origin("run", chosen, scene, changes)
    pipeline = pipeline_of(chosen, progress)
    summary = run_stages(pipeline, folder, origin=command, waves_known=waves_known)
    return _in_folder(chosen, summary, path, notes)


def impact(
    scene: Source = None,
    changes: Changes = (),
    *,
    rom: str | Path | ReducedModel | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
    waves_known: Callable[[Summary], None] = lambda summary: None,
) -> Run:
    """The coupled run alone (`beadwave impact`).

    rom     a reduced model (.npz, .mat, .h5, .mtx) as the wall; in Python also one in memory, of
            one's own K, M, w by `beadwave.reduce_matrices` for instance
    out     folder for scene.toml, summary.json and trajectory.npz; nothing is written without it

    `progress`, `waves_known` and what is raised as of `run`.
    """
    wall = () if rom is None else (("wall", {"kind": "rom", "file": str(_file_of(rom))}),)
    changes = (*wall, *each(changes))
    chosen = with_spheres(load_scene(scene, changes))
    from beadwave.workflows.run.run import impact as run_impact
    from beadwave.workflows.run.run import spheres
    from beadwave.workflows.stages.engine.pipeline import pipeline_of

    inputs = files_read(chosen, scene)
    path, notes = given(Path(out), toml(chosen)) if out else OutputFolder(None)
    folder = RunFolder(path, inputs=inputs, overwrite=overwrite) if path else None
    pipeline = pipeline_of(chosen, progress)
    command = origin("impact", chosen, scene, changes)
    summary = run_impact(pipeline, folder, origin=command, waves_known=waves_known)

    def read() -> dict[str, NDArray]:
        """Arrays of the run by name, shapes as in trajectory.npz."""
        if chosen.crystal:
            from beadwave.workflows.stages.crystal.numbers import crystal_arrays

            return crystal_arrays(pipeline("crystal"), pipeline("crystal-march"))
        if chosen.chains:
            from beadwave.workflows.stages.chain.several_numbers import chains_arrays

            stages = "chains", "structure", "chains-march", "chains-waves"
            return chains_arrays(chosen, *(pipeline(stage) for stage in stages))
        from beadwave.coupling.saved_run import arrays  # kept results load no march

        lateral = pipeline("friction") if chosen.friction else None
        return arrays(pipeline("impact").trajectory, pipeline("wall"), lateral)

    figures = "figures" if chosen.chain else f"{spheres(chosen)}-figures"
    return Run(chosen, summary, path, notes, read, lambda: pipeline(figures))


def load(folder: str | Path) -> Run:
    """A finished run folder, its arrays read when they are asked for; raises InvalidScene where
    there is none."""
    from beadwave.workflows.report.report import require_summary

    path = Path(folder)
    summary = require_summary(path)
    return _in_folder(load_scene(path / "scene.toml"), summary, path, ())


def _in_folder(scene: Scene, summary: Summary, path: Path, notes: tuple[str, ...]) -> Run:
    """A run whose arrays and pictures are read from its folder when they are asked for."""

    def read() -> dict[str, NDArray]:
        """Arrays of trajectory.npz by name; none of a scene without a chain."""
        file = path / "trajectory.npz"
        if not file.is_file():
            return {}
        with np.load(file) as arrays:
            return dict(arrays)

    def draw() -> Iterable[Picture]:
        """The pictures that the run left in its folder, in their order on the page."""
        from beadwave.workflows.report.report import CAPTIONS

        files = ((name, path / "figures" / f"{name}.png") for name in CAPTIONS)
        return (Picture(name, file.read_bytes()) for name, file in files if file.is_file())

    return Run(scene, summary, path, notes, read, draw)


def _file_of(rom: str | Path | ReducedModel) -> Path:
    """The file of a reduced model; one in memory is kept by its content with other results."""
    if isinstance(rom, str | Path):
        return Path(rom).absolute()
    from beadwave.rom import save_npz
    from beadwave.workflows.files.cache_folder import cache_folder
    from beadwave.workflows.files.whole_file import writing_file
    from beadwave.workflows.stages.engine.cache import fault

    matrices = (A for A in (rom.K, rom.M, rom.C, rom.w) if A is not None)
    content = sha256(b"".join(np.ascontiguousarray(A).tobytes() for A in matrices))
    content.update(repr(rom.contact).encode())
    folder = Path(mkdtemp()) if fault() else cache_folder() / "walls"
    path = folder / f"{content.hexdigest()[:32]}.npz"
    if not path.is_file():
        with writing_file(path) as part:
            save_npz(part, rom._replace(T=None, surface=None))
    return path


def film(
    folder: str | Path,
    *,
    out: str | None = None,
    pvd: bool = False,
    seconds: float = 8.0,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> list[Path]:
    """Structure and spheres moving, deformations scaled by a stated factor (`beadwave film`).

    folder   a run folder
    out      file in it, .mp4 (extra film) or .gif; default film.*
    pvd      write film.pvd and its surfaces for ParaView instead
    seconds  how long the film is, 0.5 to 60

    Returns the files. Raises InvalidScene where the folder is no finished run.
    """
    if not 0.5 <= seconds <= 60.0:
        raise InvalidScene(f"--seconds {seconds:g} must be between 0.5 and 60; change it.")
    from beadwave.workflows.report.film import film as draw
    from beadwave.workflows.report.film import paraview, require_name
    from beadwave.workflows.report.report import require_summary

    path = Path(folder)
    require_summary(path)
    require_file(path / "scene.toml", "run the scene again")
    if pvd and out:
        raise InvalidScene(f"--pvd writes film.pvd; leave out --out {out}.")
    name = out or ("film.mp4" if find_spec("imageio_ffmpeg") else "film.gif")
    require_name(name)
    run_folder = RunFolder(path, overwrite=overwrite)
    with run_folder.held("film.pvd" if pvd else name) as open_folder, progress("film"):
        return list(paraview(open_folder) if pvd else draw(open_folder, name, seconds=seconds))
