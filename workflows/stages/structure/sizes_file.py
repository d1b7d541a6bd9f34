"""sizes.npz: sizes of elements that mesh.error has led to, which the key mesh.sizes takes again.

asked, stated, floor    relative errors
scale, usual            times all sizes, and times those by the shape of a body at most
curved                  1 of elements that follow curved faces, 0 of straight ones
fine                    1 of elements at a contact as small as its patch, 0 of others
points.NAME (n, 3) [m]  places in a body, between which the nearest one counts
sizes.NAME (n, m) [m]   sizes there along each of its axes
axes.NAME (m, 3)        unit vectors; a row of zeros stands for all directions that no other row has
box.NAME (2, 3) [m]     lower and upper corner of the body
"""

from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from beadwave.geometry.meshing.size_field import SizeField
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.named_files import require_file
from beadwave.workflows.stages.structure.meshed_parts import AdaptedSizes, ElementSizes

NUMBERS = "asked", "stated", "floor", "scale", "usual", "curved", "fine"
ADVICE = "give the sizes.npz of a run with mesh.error"


def arrays_of(adapted: AdaptedSizes) -> dict[str, NDArray]:
    """The content of a file by names."""
    sizes = adapted.sizes
    values = (
        adapted.asked, adapted.stated, adapted.floor, sizes.scale, sizes.usual,
        float(sizes.curved), float(sizes.fine),
    )  # fmt: skip
    content = {name: np.array(value) for name, value in zip(NUMBERS, values, strict=True)}
    for body, field in sizes.fields.items():
        arrays = field.points, field.sizes, field.axes, sizes.boxes[body]
        content |= dict(zip(_names(body), arrays, strict=True))
    return content


def adapted_of(path: str) -> AdaptedSizes:
    """The sizes in a file; raises InvalidScene for what is none."""
    require_file(path, ADVICE, key="mesh.sizes = ")
    try:
        with np.load(path, allow_pickle=False) as archive:
            content = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, BadZipFile):
        raise InvalidScene(f"mesh.sizes = {path!r} is no .npz of arrays; {ADVICE}.") from None

    # numbers, and fields of every body
    missing = [name for name in NUMBERS if name not in content]
    bodies = [name.removeprefix("points.") for name in content if name.startswith("points.")]
    missing += [name for body in bodies for name in _names(body) if name not in content]
    if missing:
        raise InvalidScene(f"mesh.sizes = {path!r} has no array {missing[0]!r}; {ADVICE}.")
    asked, stated, floor, scale, usual, is_curved, is_fine = (
        _number(path, content, name) for name in NUMBERS
    )
    fields, boxes = {}, {}
    for body in bodies:
        points, sizes, axes, box = (content[name] for name in _names(body))
        n, m = len(np.atleast_1d(points)), len(np.atleast_1d(axes))
        shapes = [(n, 3), (n, m), (m, 3), (2, 3)]
        arrays = points, sizes, axes, box
        for name, array, shape in zip(_names(body), arrays, shapes, strict=True):
            is_number = array.dtype.kind == "f" and np.all(np.isfinite(array))
            if array.shape != shape or not is_number or not array.size:
                raise InvalidScene(
                    f"mesh.sizes = {path!r}: {name!r} is no array of {shape} finite numbers; "
                    f"{ADVICE}."
                )
        if sizes.min() <= 0 or np.ptp(box, axis=0).min() <= 0:
            raise InvalidScene(
                f"mesh.sizes = {path!r}: sizes and box of {body!r} must be above 0; {ADVICE}."
            )
        fields[body], boxes[body] = SizeField(points, sizes, axes), box
    sizes_of_all = ElementSizes(fields, usual, scale, boxes, is_curved > 0, is_fine > 0)
    return AdaptedSizes(sizes_of_all, asked, stated, floor, None, None, None, "", ())


def _names(body: str) -> tuple[str, ...]:
    return tuple(f"{kind}.{body}" for kind in ("points", "sizes", "axes", "box"))


def _number(path: str, content: dict[str, NDArray], name: str) -> float:
    """A number of a file that is 0 or above; scale and usual are above."""
    value = content[name]
    if value.shape or value.dtype.kind != "f" or not np.isfinite(value) or value < 0:
        raise InvalidScene(f"mesh.sizes = {path!r}: {name!r} is no number of 0 or above; {ADVICE}.")
    if name in ("scale", "usual") and value == 0:
        raise InvalidScene(f"mesh.sizes = {path!r}: {name!r} = 0 must be above 0; {ADVICE}.")
    return float(value)
