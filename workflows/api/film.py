"""The impact of a run folder as a film."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from workflows.api.progress import Progress, quiet
from workflows.files.run_folder import RunFolder
from workflows.scene import InvalidScene
from workflows.scene.named_files import require_file


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

    `out` is a file in the run folder, .mp4 (extra `film`) or .gif; film.mp4 or film.gif without
    it. `pvd` writes surfaces over time for ParaView instead. Returns the files. Raises
    InvalidScene where the folder is no finished run.
    """
    from workflows.results.film import film as draw
    from workflows.results.film import paraview, require_name
    from workflows.results.report import require_summary

    path = Path(folder)
    require_summary(path)
    require_file(path / "scene.toml", "run the scene again")
    if pvd and out:
        raise InvalidScene(f"--pvd writes film.pvd; leave out --out {out}.")
    name = out or ("film.mp4" if find_spec("imageio_ffmpeg") else "film.gif")
    require_name(name)
    held = RunFolder(path, overwrite=overwrite).held("film.pvd" if pvd else name)
    with held as open_folder, progress("film"):
        return list(paraview(open_folder) if pvd else draw(open_folder, name, seconds=seconds))
