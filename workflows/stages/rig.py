"""The thesis' rig: how its bodies are joined and held, and the motions of its measured modes.

full tie:  every touching face is tied to its neighbour
screw tie: bolted faces are tied to their neighbour only under the washers
wires:     bolted faces are joined by screws of six stiffnesses each, all others are tied
"""

from collections.abc import Mapping, Sequence

import fem
from geometry import Interface
from workflows.thesis import HAMMER_TEST

STRUCK = "block:+x"  # the face that the chain leans on
TARGETS = tuple(fem.BodyMotion(HAMMER_TEST["body"], motion) for motion in HAMMER_TEST["motion"])


def full_tie(touching: Sequence[Interface], held: Sequence[str]) -> fem.Connections:
    """Every touching face is tied to its neighbour, over the whole face."""
    ties = [fem.Tie(t.slave, t.master) for t in touching]
    return fem.Connections(ties=ties, held=[fem.Held(face) for face in held])


def screw_tie(touching: Sequence[Interface], held: Sequence[str]) -> fem.Connections:
    """Bolted faces are tied to their neighbour under the washers, all others wholly."""
    pairs = [(face, t.master) for t in touching for face in (t.screws or (t.slave,))]
    ties = [fem.Tie(*pair) for pair in pairs]
    return fem.Connections(ties=ties, held=[fem.Held(face) for face in held])


def wires(
    touching: Sequence[Interface], held: Sequence[str], bushings: Mapping[str, fem.Bushing]
) -> fem.Connections:
    """Bolted faces are joined by screws with stiffnesses `bushings` by joint; others are tied."""
    plain = full_tie([t for t in touching if not len(t.halves)], held)
    # a screw joins its share of the sheet, which moves rigidly, to the mean motion of the face
    # below
    screws = []
    for t in touching:
        name = t.slave.split(":")[1]
        for share, centre in zip(t.halves, t.centres, strict=True):
            under = fem.Side(t.master, "mean", over=share)
            screws.append(fem.Joint(name, fem.Side(share), under, centre, bushings[name]))
    return plain._replace(joints=screws)
