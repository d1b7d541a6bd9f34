"""Bodies of a mesh that the user brings, and the faces of it that the scene names."""

from collections.abc import Mapping, Sequence
from re import sub
from typing import NamedTuple

import numpy as np
from skfem import Mesh

LEFT = 0.1  # of a common area, the most that may lie on facets which reach past it


class OwnMesh(NamedTuple):
    """What is in the file, and where its bodies touch; see `geometry.faceted`."""

    skins: dict
    bodies: dict
    meeting: tuple  # geometry.faceted_touching.Meeting

    def marked(self, named: Mapping, patches: Mapping, tied: Sequence) -> dict[str, Mesh]:
        """The meshes with faces, washers and ties (each with the body that follows) as boundaries;
        raises ValueError where no facets show them."""
        found: dict[str, dict] = {name: {} for name in self.skins}
        for name, picked in named.items():
            found[picked.body][name] = self.skins[picked.body].on(picked.tags).number
        for name, patch in patches.items():
            body = patch.on.body
            found[body][name] = self.meeting.under(patch, self.skins[body])
            if not len(found[body][name]):
                raise ValueError(
                    f'"{name}": no facet of {body} has its middle under the washer or in the '
                    f"thread at {np.round(patch.centre, 6).tolist()} m; take a larger one or a "
                    "finer mesh."
                )
        for touch, follows in tied:
            for body in touch.bodies:
                whole = body == follows
                facets = self.meeting.facets(touch.name, body, self.skins[body], whole=whole)
                found[body][touch.name] = facets
            self._require_followed(touch, follows, found[follows][touch.name])
        return {n: skin.mesh.with_boundaries(found[n]) for n, skin in self.skins.items()}

    def _require_followed(self, touch, body: str, facets) -> None:
        skin = self.skins[body]
        area = skin.area[np.isin(skin.number, facets)].sum()
        if area < (1 - LEFT) * touch.area:
            raise ValueError(
                f'"{touch.name}": of {1e6 * touch.area:.4g} mm^2 in common only {1e6 * area:.4g} '
                f'are whole facets of "{body}"; let its mesh end where the other body does.'
            )


def own_mesh(volumes: Mapping[str, Mesh], gap: float) -> OwnMesh:
    """The bodies that named volumes are; `gap` [m] is the farthest that two touching ones are."""
    from geometry.faceted import bodies, skins  # load gmsh
    from geometry.faceted_touching import meeting

    meshes = {sub(r"[^\w.+-]+", "-", name): mesh for name, mesh in volumes.items()}
    named = {name: mesh.boundaries or {} for name, mesh in meshes.items()}
    outside = skins(meshes, named)
    found = bodies(outside, named)
    return OwnMesh(outside, found, meeting(outside, found, gap))
