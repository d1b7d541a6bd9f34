"""What an assembly is made of, before anything is computed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from workflows.api.folders import picture_folder
from workflows.api.progress import Progress, quiet
from workflows.files.output_file import OutputFile
from workflows.files.run_folder import Picture, write_pictures
from workflows.files.scene import Changes, Source
from workflows.files.scene import scene as load_scene
from workflows.scene import InvalidScene
from workflows.scene.parts import with_assembly

if TYPE_CHECKING:
    from workflows.assembly.look import Look, Seen


@dataclass(frozen=True, repr=False)
class Looked:
    """What an assembly is made of: `found.bodies`, `found.touching`, `found.holes`, ..."""

    found: Look
    seen: Seen

    def plot(self) -> Picture:
        """The bodies, a colour and a name each."""
        from workflows.assembly.look import picture

        return picture(self.seen)

    def __repr__(self) -> str:
        return self.found.text()


def look(
    source: Source,
    changes: Changes = (),
    *,
    starter: str | Path | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress = quiet,
) -> Looked:
    """Bodies, masses, touching pairs, holes and the size of the mesh (`beadwave look`).

    `source` is a STEP file, or a scene of bodies. `starter` writes a scene of a STEP file to start
    from, `out` is a folder for the picture with the names. Raises InvalidScene for bad input.
    """
    from workflows.assembly import look as looking

    path = Path(source) if isinstance(source, str | Path) else None
    is_file = path is not None and path.suffix.lower() in looking.ENDINGS
    chosen = looking.of_file(path) if is_file else load_scene(source, changes)
    if starter and not is_file:
        raise InvalidScene(f"--scene starts a scene of a STEP file; {source} is a scene already.")
    inputs = (path,) if path else ()
    written = {"inputs": inputs, "ending": ".toml", "overwrite": overwrite}
    file = OutputFile(starter, "--scene", **written) if starter else None
    folder = picture_folder(out, inputs, overwrite, "assembly")
    with progress("look"):
        seen = looking.look(with_assembly(chosen), str(source) if path else chosen.name)
        found = Looked(seen.look, seen)
        if folder:
            write_pictures(folder, (found.plot(),))
    if file:
        looking.write_starter(file, seen, path)
    return found
