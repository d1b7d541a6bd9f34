"""The thesis' rig in the words of `fem`: what joins its parts, what holds it, and the motions that
its modes are recognised by.

full tie:  every touching face follows its neighbour
screw tie: bolted faces follow their neighbour only under the washers
wires:     bolted faces are screws of six stiffnesses each, the rest is tied
"""

from collections.abc import Mapping, Sequence

import fem
from geometry import Interface
from workflows.thesis import HAMMER_TEST

STRUCK = "block:+x"  # the face that the chain leans on
TARGETS = tuple(fem.BodyMotion(HAMMER_TEST["body"], motion) for motion in HAMMER_TEST["motion"])


def full_tie(touching: Sequence[Interface], held: Sequence[str]) -> fem.Connections:
    """Every touching face follows its neighbour over the whole face."""
    ties = [fem.Tie(t.slave, t.master) for t in touching]
    return fem.Connections(ties=ties, held=[fem.Held(face) for face in held])


def screw_tie(touching: Sequence[Interface], held: Sequence[str]) -> fem.Connections:
    """Bolted faces follow their neighbour under the washers, the other faces wholly."""
    pairs = [(face, t.master) for t in touching for face in (t.screws or (t.slave,))]
    ties = [fem.Tie(*pair) for pair in pairs]
    return fem.Connections(ties=ties, held=[fem.Held(face) for face in held])


def wires(
    touching: Sequence[Interface], held: Sequence[str], bushings: Mapping[str, fem.Bushing]
) -> fem.Connections:
    """Bolted faces are held by screws, `bushings` by joint; the other faces are tied."""
    plain = full_tie([t for t in touching if not len(t.halves)], held)
    # of each screw a rigid share of the sheet, and the mean motion of what is under it
    screws = []
    for t in touching:
        name = t.slave.split(":")[1]
        for share, centre in zip(t.halves, t.centres, strict=True):
            under = fem.Side(t.master, "mean", over=share)
            screws.append(fem.Joint(name, fem.Side(share), under, centre, bushings[name]))
    return plain._replace(joints=screws)
