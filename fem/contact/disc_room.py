"""Places where a disc fits on a plane face, for the sentence on one that leaves its face."""

import numpy as np

from beadwave.fem.assembly.elasticity import Structure
from beadwave.fem.assembly.trace import face_nodes, located
from beadwave.fem.contact.contact_patch import disc_quadrature
from beadwave.fem.contact.impact_point import planar_spot


def room_on_face(structure: Structure, face: str, at: tuple[float, float], radius: float) -> str:
    """The sides of a plane face [m] and the place nearest to `at` [m] where a disc of a radius [m]
    lies on it, as a clause of a sentence; places count from the middle of the face along its axes.

    The nearest place is exact on a rectangle; around holes it is that of a grid of 25 x 25.
    """
    middle = planar_spot(structure, face, (0.0, 0.0))
    on_face = structure.points[face_nodes(structure, face)[:, 0] // 3]
    half = np.ptp(on_face @ middle.axes.T, axis=0) / 2
    sides = " x ".join(f"{2 * side:.4g}" for side in half)
    size = f"the face is {sides} m along {' and '.join(_named(axis) for axis in middle.axes)}"

    # places in a box that is smaller by the radius, the nearest ones first: the one asked for
    # moved into the box, then a grid
    room = half - radius
    if np.all(room >= 0):
        moved = np.clip(at, -room, room)
        # a disc is tried at 25 places along each side of the face
        grid = np.linspace(-room, room, 25)
        places = np.vstack([moved, np.array(np.meshgrid(*grid.T)).reshape(2, -1).T])
        places = places[np.argsort(np.linalg.norm(places - at, axis=1), kind="stable")]
        rim = np.linspace(0.0, 2 * np.pi, 32, endpoint=False)
        disc = np.vstack([disc_quadrature("area", 4, 16)[0], np.c_[np.cos(rim), np.sin(rim)]])
        for place in places:
            points = middle.point + (place + radius * disc) @ middle.axes
            if np.all(located(structure, face, points).distance <= 0):
                return f"{size}, and the nearest place for it is {(place.round(6) + 0.0).tolist()}"
    return f"{size}, where such a disc has no room"


def _named(axis: np.ndarray) -> str:
    """ "x", or the components of an axis (3,) that is no global one."""
    if abs(axis).max() > 1 - 1e-9:
        return "xyz"[int(abs(axis).argmax())]
    return f"{(axis.round(3) + 0.0).tolist()}"
