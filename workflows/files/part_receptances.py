"""[[measured]]: receptances between the points of a part, as they are read, and what forbids it.

Responses in the units of velocity or of acceleration are divided by i omega or by -omega^2.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.fem.identification.hit_records import node_and_axis
from beadwave.workflows.files.hammer import measured_test
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.tables.measured import MeasuredTable
from beadwave.workflows.scene.tables.walls import RESPONSE_UNITS

UNITS = {"accelerations": "m/s^2/N", "velocities": "m/s/N", "displacements": "m/N"}
AXES = "xyz"


class PartReceptances(NamedTuple):
    """Receptances of a part at m motions of its points."""

    frequency_hz: NDArray[np.float64]  # (f,) above 0
    H: NDArray[np.complex128]  # (f, m, m) [m/N] of displacements along positive axes
    node: tuple[int, ...]  # (m,)
    axis: tuple[int, ...]  # (m,) 0, 1, 2
    place: dict[int, NDArray[np.float64]]  # (3,) [m] of nodes in the axes of the test
    title: str

    @property
    def synthetic(self) -> bool:
        """True if the file says that its responses were computed."""
        return "SYNTHETIC" in self.title.upper()


def receptances(table: MeasuredTable) -> PartReceptances:
    """The receptances of the points that are joined, of the file; raises InvalidScene."""
    key_of, path = f"measured.{table.name}", Path(table.receptance)
    test = measured_test([path])
    named = f"{key_of}.receptance = {table.receptance!r}"
    if records := test.without_force:
        raise InvalidScene(
            f"{named} has {records} without a force; give responses of all points to hits on all "
            "of them."
        )
    unit = table.unit or UNITS.get(test.quantity)
    if unit is None:
        raise InvalidScene(
            f"{named} does not say what its responses are; add unit, as {key_of}.unit = "
            '"m/s^2/N" for accelerations.'
        )
    order, factor = RESPONSE_UNITS[unit]
    if test.quantity and RESPONSE_UNITS[UNITS[test.quantity]][0] != order:
        raise InvalidScene(
            f'{key_of}.unit = "{unit}" is none of {test.quantity}, which {path} says to hold; '
            f'take "{UNITS[test.quantity]}", or drop unit.'
        )

    # which motions: nodes and axes, with the sign in which they were measured
    responses = test.responses
    names = (responses.points, responses.references)
    ends = [[node_and_axis(name) for name in side] for side in names]
    for name, end in zip((*names[0], *names[1]), (*ends[0], *ends[1]), strict=True):
        if end is None or not 1 <= abs(end[1]) <= 3:
            raise InvalidScene(
                f"{named}: {name!r} names no node and direction along x, y or z; name points as "
                "12+z, or leave it out."
            )

    # those that the keys choose, in the order of the nodes as they are given
    motions = sorted({(node, abs(axis) - 1) for side in ends for node, axis in side})
    nodes = sorted({node for node, _ in motions})
    for node in table.points or ():
        if node not in nodes:
            listed = ", ".join(map(str, nodes))
            raise InvalidScene(
                f"{key_of}.points has node {node}, of which {path} has no response; there are "
                f"{listed}."
            )
    wanted = table.directions or AXES
    chosen = table.points or tuple(nodes)
    motions = [(n, a) for n in chosen for a in range(3) if (n, a) in motions and AXES[a] in wanted]
    if not motions:
        raise InvalidScene(
            f'{key_of}.directions = "{wanted}" has none of those measured; change it.'
        )

    # H (m, m, f) along positive axes: a sensor and a hit against their axes each turn the sign
    H = np.full((len(motions), len(motions), len(responses.frequency_hz)), np.nan, complex)
    for i, (node, axis) in enumerate(ends[0]):
        for j, (hit, along) in enumerate(ends[1]):
            a, b = (node, abs(axis) - 1), (hit, abs(along) - 1)
            if a in motions and b in motions:
                H[motions.index(a), motions.index(b)] = (
                    np.sign(axis) * np.sign(along) * responses.H[i, j]
                )
    if np.isnan(H).any():
        a, b = (f"{motions[i][0]}{AXES[motions[i][1]]}" for i in np.argwhere(np.isnan(H))[0][:2])
        what = f"of {a} to a hit on itself" if a == b else f"of {a} to a hit on {b}"
        raise InvalidScene(
            f"{named} has no response {what}; joining a part needs those between all of its "
            f"points: measure it, or choose others by {key_of}.points and directions."
        )

    f = responses.frequency_hz
    within = (
        responses.usable & (f > 0) & (f >= (table.lowest or 0)) & (f <= (table.highest or np.inf))
    )
    if np.count_nonzero(within) < 40:
        raise InvalidScene(
            f"{named} has {np.count_nonzero(within)} lines above 0 Hz"
            + (f" and from {key_of}.lowest = {table.lowest:g} Hz" if table.lowest else "")
            + (f" and up to {key_of}.highest = {table.highest:g} Hz" if table.highest else "")
            + "; a fit needs 40."
        )

    # to displacements over force; an exponential window exp(-shift t) moves the line to
    # s = i omega + shift, by which derivatives in time count then
    s = 2j * np.pi * f[within] + responses.shift
    H = np.moveaxis(factor * H[:, :, within] / s**order, 2, 0)
    node, axis = zip(*motions, strict=True)
    return PartReceptances(f[within], H, node, axis, test.nodes, test.title)
