"""Bodies of a user's mesh, where they touch, and the faces of it that the scene names."""

from collections.abc import Collection, Mapping, Sequence
from re import sub
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from skfem import Mesh

from beadwave.geometry.cad.contacts import FaceContact, TouchingPair
from beadwave.geometry.cad.patches import Patch, Spots
from beadwave.geometry.cad.selectors import FaceSelection
from beadwave.geometry.cad.solids import Body
from beadwave.geometry.own_mesh.faceted import Skin, bodies, skins
from beadwave.geometry.own_mesh.faceted_touching import TouchingBodies, meeting


class OwnMesh(NamedTuple):
    """A user's mesh: its bodies, their outer facets, and where they touch
    (`geometry.own_mesh.faceted`)."""

    skins: dict[str, Skin]
    bodies: dict[str, Body]
    meeting: TouchingBodies

    def marked(
        self,
        named: Mapping[str, FaceSelection],
        patches: Mapping[str, Patch],
        tied: Sequence[tuple[TouchingPair, str]],
        rounded: Collection[str] = (),
    ) -> dict[str, Mesh]:
        """The bodies' meshes with named faces, patches and ties as boundaries; of a tie the name of
        its slave is given, the body that follows the other, and pairs that are `rounded` have all
        of the faces that touch. Raises ValueError where no facets lie under a patch, and where
        whole facets of a slave cover less than 0.9 of the common area."""
        boundaries: dict[str, dict] = {name: {} for name in self.skins}
        for name, selected in named.items():
            boundaries[selected.body][name] = self.skins[selected.body].on(selected.tags).number
        for name, patch in patches.items():
            body = patch.on.body
            facets = self.meeting.under(patch, self.skins[body])
            if not len(facets):
                place = patch.centres[0] if isinstance(patch, Spots) else patch.centre
                raise ValueError(
                    f'"{name}": no facet of {body} has its middle under the washer, on the pad or '
                    f"in the thread at {np.round(place, 6).tolist()} m; take a larger one or a "
                    "finer mesh."
                )
            boundaries[body][name] = facets
        for touch, follower in tied:
            if touch.name in rounded:
                for side, body in enumerate(touch.bodies):
                    tags = [contact.faces[side] for contact in touch.contacts]
                    boundaries[body][touch.name] = self.skins[body].on(tags).number
                continue
            # the slave is tied by facets that lie wholly on its master
            for body in touch.bodies:
                boundaries[body][touch.name] = self.meeting.facets(
                    touch.name, body, self.skins[body], whole=body == follower
                )
            skin = self.skins[follower]
            area = skin.area[np.isin(skin.number, boundaries[follower][touch.name])].sum()
            # at most a tenth of the common area may lie on facets which reach past it
            if area < (1 - 0.1) * touch.area:
                raise ValueError(
                    f'"{touch.name}": of {1e6 * touch.area:.4g} mm^2 in common only '
                    f'{1e6 * area:.4g} are whole facets of "{follower}"; let its mesh end where '
                    "the other body does."
                )
        return {n: skin.mesh.with_boundaries(boundaries[n]) for n, skin in self.skins.items()}

    def closest(
        self, touch: TouchingPair, contact: FaceContact
    ) -> tuple[NDArray[np.float64], float]:
        """Middles (2, 3) [m] of the facets of two faces that are nearest to each other, and the
        size of the larger one [m]."""
        pairs = self.meeting.pairs[touch.name]
        skins = [self.skins[body] for body in touch.bodies]
        of_faces = (skins[0].tag[pairs.first] == contact.faces[0]) & (
            skins[1].tag[pairs.second] == contact.faces[1]
        )
        nearest = np.flatnonzero(of_faces)[np.argmin(pairs.gap[of_faces])]
        i, j = pairs.first[nearest], pairs.second[nearest]
        at = np.array([skins[0].middle[i], skins[1].middle[j]])
        return at, float(max(skins[0].size[i], skins[1].size[j]))


def own_mesh(volumes: Mapping[str, Mesh], gap: float) -> OwnMesh:
    """The bodies of named volumes; `gap` [m] is the distance up to which two of them touch. What
    is no letter, digit or one of _ . + - in a name becomes "-": selectors have meanings for it."""
    meshes = {sub(r"[^\w.+-]+", "-", name): mesh for name, mesh in volumes.items()}
    named = {name: mesh.boundaries or {} for name, mesh in meshes.items()}
    outsides = skins(meshes, named)
    solids = bodies(outsides, named)
    return OwnMesh(outsides, solids, meeting(outsides, solids, gap))
