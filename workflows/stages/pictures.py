"""The stage that renders, in a process of its own."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from skfem import Mesh

import fem
from fem import mode_field as field_file
from fem.assembly_modes import AssemblyModes
from workflows.files.child import child
from workflows.files.run_folder import Picture
from workflows.scene import Scene

TIME_LIMIT = 120  # s


class NoPicture(RuntimeError):
    """The pictures could not be rendered; the message says what to install."""


def pictures(scene: Scene, modes: AssemblyModes, contact: fem.ContactPatch) -> tuple[Picture, ...]:
    """The meshed assembly and four modes; raises NoPicture where nothing can be rendered."""
    return _rendered(modes.field, [*contact.spot.point, *contact.spot.inward])


def picture_of(meshes: dict[str, Mesh]) -> Picture:
    """Bodies alone, a colour each; raises NoPicture."""
    nothing = np.empty(0)
    return _rendered(field_file.ModeField(meshes, *(nothing,) * 4))[0]


def _rendered(modes: field_file.ModeField, strike: Sequence[float] = ()) -> tuple[Picture, ...]:
    """The pictures of a field, drawn in a process of its own: a broken graphics library may end
    it."""
    with TemporaryDirectory() as folder:
        field = Path(folder) / "modes.vtu"
        field_file.write(field, modes)
        images = [Path(folder) / "assembly.png", Path(folder) / "modes.png"]
        point = ",".join(f"{number:.9g}" for number in strike)
        arguments = [str(field), ",".join(modes.meshes), point, *map(str, images)]
        try:
            process = child("workflows.report.render", *arguments, seconds=TIME_LIMIT)
        except TimeoutError:
            raise NoPicture(
                f"assembly and modes were not rendered within {TIME_LIMIT} s; the rest is complete."
            ) from None
        if process.returncode != 0:
            raise NoPicture(
                "assembly and modes could not be rendered, the rest is complete; install an "
                "off-screen GL library (Debian: apt-get install libgl1 libosmesa6) and run again."
            )
        return tuple(Picture(image.stem, image.read_bytes()) for image in images)
