"""Reduced models, of a scene's assembly or of one's own matrices."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from workflows.api.progress import Progress, quiet
from workflows.files.output_file import OutputFile, output_files
from workflows.files.run_folder import Picture
from workflows.files.scene import Changes, Source, files_read
from workflows.files.scene import scene as load_scene
from workflows.scene import Scene
from workflows.scene.parts import with_structure

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy.sparse import sparray

    from rom import ReducedModel
    from workflows.pipeline.pipeline import Pipeline


@dataclass(frozen=True, repr=False)
class Reduced:
    """A reduced model: `model` with K, M, C, w and the outer nodes' T; to a file by `save`."""

    scene: Scene
    model: ReducedModel
    pipeline: Pipeline

    def save(
        self, path: str | Path, matrices: str | Path | None = None, *, overwrite: bool = False
    ) -> list[Path]:
        """Write .npz, .mat or .h5, and to `matrices` (.mat, .npz) the full K, M and w."""
        files = _files(path, matrices, files_read(self.scene), overwrite)
        from workflows.assembly.export import write_reduced

        write_reduced(self.pipeline, *files)
        return [file.path for file in files]

    def plot(self) -> Picture:
        """The receptance at the contact, and solutions of the full model."""
        return self.pipeline("response").picture

    def __repr__(self) -> str:
        return f"{self.scene.name}: {self.model.kind}, {len(self.model.w)} coordinates"


def _files(out, matrices, inputs: tuple[Path, ...], overwrite: bool) -> list[OutputFile]:
    """Where both go; raises InvalidScene where one cannot."""
    given = {"--out": out, "--matrices": matrices}
    return list(output_files(given, inputs=inputs, overwrite=overwrite).values())


def reduce(
    scene: Source = None,
    changes: Changes = (),
    *,
    out: str | Path | None = None,
    matrices: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Reduced:
    """The assembly reduced to few coordinates at the contact (`beadwave reduce`).

    `out` writes it to .npz, .mat or .h5, `matrices` the full model's K, M, w; files that
    beadwave did not write, or that were changed since, are only replaced with `overwrite`. Raises
    InvalidScene for bad input, ValueError where a computation fails.
    """
    chosen = with_structure(load_scene(scene, changes))
    files = _files(out, matrices, files_read(chosen, scene), overwrite) if out else []
    from workflows.assembly.export import require_formats, write_reduced
    from workflows.pipeline.pipeline import pipeline_of

    if files:
        require_formats(*files)
    pipeline = pipeline_of(chosen, progress)
    found = Reduced(chosen, pipeline("reduction"), pipeline)
    if files:
        write_reduced(pipeline, *files)
    return found


def reduce_matrices(
    K: ArrayLike | sparray,
    M: ArrayLike | sparray,
    w: ArrayLike,
    *,
    C: ArrayLike | sparray | None = None,
    modes: int = 40,
    half_space: float = 0.0,
    young: float | None = None,
    poisson: float | None = None,
) -> ReducedModel:
    """K [N/m], M [kg], C [N s/m] (n, n) of one's own model, reduced for `beadwave.impact(rom=...)`.

    w (n,): u_w = w @ u is the displacement into the wall under the contact, averaged over the
    patch, sum(w) = 1 along the normal; the contact force enters as w F. `modes` free modes and the
    residual vector K^-1 w, so that the static compliance is exact. half_space [m/N] is the
    compliance of the patch on a half-space that the mesh holds, and the Hertz law once more:
    0.6 (1 - poisson^2) / (young b) of a Hertz-weighted disc of radius b on solid elements, 0 where
    w reads a point of a beam or shell. young [Pa] and poisson are of the surface struck, for the
    Hertz law; steel without them. Raises rom.ReductionError, a ValueError.
    """
    import fem
    import rom

    asked = rom.Selection(n_modes=modes)
    found = rom.free_modes(K, M, w, asked, C=C, factorise=fem.factorised)
    return found._replace(contact=rom.Contact(half_space, young=young, poisson=poisson))
