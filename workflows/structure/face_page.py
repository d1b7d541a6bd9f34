"""A page on which a click on a face shows the selectors that pick it (`beadwave look --out`)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from beadwave.geometry.cad.selectors import faces
from beadwave.geometry.cad.solids import ALIGNED, Body, Face
from beadwave.geometry.errors import InvalidGeometry
from beadwave.workflows.report.report import harmless_json, in_one_file


def face_page(
    name: str,
    bodies: Mapping[str, Body],
    triangles: Mapping[str, Mapping[int, NDArray[np.float64]]],
) -> str:
    """HTML of all faces as `triangles`, by body and tag, with the selectors that pick each; to be
    called while the drawing is open, since selectors are tried on its bodies."""
    rows: list[dict[str, Any]] = []
    for body in bodies.values():
        for face in body.faces:
            corners = triangles[body.name][face.tag]

            # a point on the face: the middle of its largest triangle; of a ring the middle of all
            # would lie off it
            sides = corners[:, 1:] - corners[:, :1]
            largest = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).argmax()
            point = corners[largest].mean(axis=0)
            picked = []
            for text in words(body, face, point):
                try:
                    tags = faces(text, bodies).tags
                except InvalidGeometry:
                    continue
                if face.tag in tags:
                    picked.append({"text": text, "faces": len(tags)})
                    if "@" in text:  # the shortest of the points does
                        break
            of_size = "" if face.radius is None else f" of {2e3 * face.radius:.4g} mm"
            rows.append(
                {
                    "body": body.name,
                    "kind": f"{face.kind}{of_size}, {1e6 * face.area:.4g} mm²",
                    "selectors": sorted(picked, key=lambda row: row["faces"] != 1),
                    "points": corners.reshape(-1).round(7).tolist(),
                }
            )
    return in_one_file(
        "faces", scripts=["vendor/ogl.min.js"], module="faces", styles=["style.css", "faces.css"],
        name=name, faces=rows, data=Markup(harmless_json({"faces": rows})),
    )  # fmt: skip


def words(body: Body, face: Face, point: np.ndarray) -> list[str]:
    """Selectors that may pick a face with this point (3,) [m] on it, those by the point last; see
    `geometry.cad.selectors`."""
    texts = []
    if face.normal is not None and np.abs(face.normal).max() > 1 - ALIGNED:
        axis = int(np.abs(face.normal).argmax())
        texts.append(f"{body.name}:{'+' if face.normal[axis] > 0 else '-'}{'xyz'[axis]}")
    if face.name:
        texts.append(f"{body.name}:#{face.name}")
    if face.axis is not None and face.radius is not None:
        what = "hole" if face.hollow else "cylinder"
        texts += [f"{body.name}:{what}({2e3 * face.radius:.6g} mm)", f"{body.name}:{what}"]
    for digits in (3, 4, 5, 7):  # of the point, that is rounded as far as it still picks the face
        texts.append(
            f"{body.name}@" + ",".join(f"{x:.{digits}g}" for x in point.round(digits) + 0.0)
        )
    return texts
