"""The stage that renders meshes and modes, in a child process.

Where no graphics library is installed, pyvista ends its process with a segmentation fault, which no
`try` can catch.
"""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from skfem import Mesh

import fem
from fem import mode_field as field_file
from fem.assembly_modes import AssemblyModes
from workflows.files.child import child
from workflows.files.run_folder import NoPicture, Picture
from workflows.scene import Scene

TIME_LIMIT = 120  # s, of the child; not varied


def pictures(scene: Scene, modes: AssemblyModes, contact: fem.ContactPatch) -> tuple[Picture, ...]:
    """Pictures of the meshed assembly with the point struck, and of four modes; raises
    NoPicture."""
    return _rendered(modes.field, [*contact.spot.point, *contact.spot.inward])


def picture_of(meshes: dict[str, Mesh]) -> Picture:
    """Picture of the meshes of bodies, each in a colour; raises NoPicture."""
    nothing = np.empty(0)
    return _rendered(field_file.ModeField(meshes, *(nothing,) * 4))[0]


def _rendered(modes: field_file.ModeField, strike: Sequence[float] = ()) -> tuple[Picture, ...]:
    """Pictures of assembly and modes, rendered by a child; `strike` is the point struck and the
    direction of the force (6,). Raises NoPicture."""
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
