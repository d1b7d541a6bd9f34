"""Measured mode shapes from universal files: data sets 55, or the responses of data sets 58.

Points come from data set 15 or 2411, lengths in the unit of data set 164, else in metres. Of
responses the shape is the first left singular vector of those near the resonance (complex mode
indicator function: Shih et al., Mech. Syst. Signal Process. 2 (1988) 367).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

POINTS, UNITS, SHAPE, RESPONSE = (15, 2411), 164, 55, 58
FREQUENCY_RESPONSE = 4  # type of a function in data set 58
COMPLEX = (3, 7)  # analyses of data set 55 that tell a complex eigenvalue
FARTHEST = 1.05  # frequency of a shape over that of its target
BAND = 0.02  # of the frequency, to either side: lines that tell a shape
FEWEST = 3  # displacements that tell shapes apart


class MeasuredShape(NamedTuple):
    """Displacements of one mode."""

    points: NDArray[np.float64]  # (m, 3) [m]
    directions: NDArray[np.float64]  # (m, 3) unit vectors
    values: NDArray[np.complex128]  # (m,)


class _Reading(NamedTuple):
    """What one data set says of a node: which, along which axis, how much."""

    node: int
    axis: int  # 1, 2, 3, negative against it
    value: complex


def has_shapes(sets: Sequence[dict]) -> bool:
    """Whether data sets have points, which tell where their responses were measured."""
    types = [s["type"] for s in sets]
    return bool({*types} & {*POINTS}) and types.count(RESPONSE) >= FEWEST


def measured_shape(sets: Sequence[dict], hz: float) -> MeasuredShape:
    """The shape of the mode at `hz` in the data sets of a file.

    Raises ValueError where they have none, KeyError, TypeError or IndexError for damaged ones.
    """
    places = _places(sets)
    shapes = [s for s in sets if s["type"] == SHAPE]
    readings = list(_of_shapes(shapes, hz) if shapes else _of_responses(sets, hz))
    unknown = sorted({r.node for r in readings} - places.keys())
    if unknown:
        raise ValueError(f"node {unknown[0]} has no point in data set 15 or 2411, add it")
    if len(readings) < FEWEST:
        raise ValueError(
            f"it has {len(readings)} measured displacements at {hz:g} Hz, at least {FEWEST} tell "
            "modes apart; measure more points"
        )
    values = np.array([r.value for r in readings])
    if not (np.isfinite(values).all() and values.any()):
        raise ValueError(f"the displacements at {hz:g} Hz are zero or no numbers")
    axes = np.array([r.axis for r in readings])
    directions = np.sign(axes)[:, None] * np.eye(3)[np.abs(axes) - 1]
    return MeasuredShape(np.array([places[r.node] for r in readings]), directions, values)


def _places(sets: Sequence[dict]) -> dict[int, NDArray[np.float64]]:
    """Points of the nodes [m]."""
    factor = next((float(s["length"]) for s in sets if s["type"] == UNITS), 1.0)
    found = {}
    for s in (s for s in sets if s["type"] in POINTS):
        if np.any(np.asarray(s["disp_cs"]) > 0):
            raise ValueError("its displacements are in local axes, write them in global ones")
        points = np.column_stack([np.atleast_1d(s[axis]) for axis in "xyz"]) / factor
        found |= dict(zip(np.atleast_1d(s["node_nums"]).astype(int).tolist(), points, strict=True))
    if not found:
        raise ValueError("it has no points, which data set 15 or 2411 holds")
    if not np.isfinite(list(found.values())).all():
        raise ValueError("a point is no number")
    return found


def _of_shapes(shapes: list[dict], hz: float) -> Iterator[_Reading]:
    """Of the data set 55 nearest to a frequency."""
    found = [_frequency(s) for s in shapes]
    nearest = int(np.argmin(np.abs(np.log(np.maximum(found, 1e-9)) - np.log(hz))))
    if not 1 / FARTHEST < found[nearest] / hz < FARTHEST:
        there = ", ".join(f"{f:g}" for f in found)
        raise ValueError(f"it has no shape near {hz:g} Hz, there are {there} Hz")
    # a direction that is zero in every shape was not measured
    measured = sum(np.abs(_components(s)) for s in shapes if _alike(s, shapes[nearest])) > 0
    values, nodes = _components(shapes[nearest]), np.atleast_1d(shapes[nearest]["node_nums"])
    for axis, i in zip(*np.nonzero(measured), strict=True):
        yield _Reading(int(nodes[i]), int(axis) + 1, complex(values[axis, i]))


def _alike(one: dict, other: dict) -> bool:
    return np.array_equal(np.atleast_1d(one["node_nums"]), np.atleast_1d(other["node_nums"]))


def _frequency(s: dict) -> float:
    if s["analysis_type"] in COMPLEX:
        return float(abs(s["eig"]) / (2 * np.pi))
    return float(s["freq"])


def _components(s: dict) -> NDArray[np.complex128]:
    """(3, n)"""
    return np.array([np.atleast_1d(s[key]) for key in ("r1", "r2", "r3")], dtype=complex)


def _of_responses(sets: Sequence[dict], hz: float) -> Iterator[_Reading]:
    """Of frequency responses at many points to one hammer, or at one point to a roving hammer."""
    sets = [s for s in sets if s["type"] == RESPONSE and s["func_type"] == FREQUENCY_RESPONSE]
    if not sets:
        raise ValueError("it has neither shapes (data set 55) nor frequency responses (58)")
    ends = [[(int(s[f"{end}_node"]), int(s[f"{end}_dir"])) for s in sets] for end in ("rsp", "ref")]
    roving = len(set(ends[0])) == 1 < len(set(ends[1]))
    if not roving and len(set(ends[1])) > 1:
        raise ValueError("its responses are to hammers at several points, keep those of one")
    H = _near(sets, hz)
    U = np.linalg.svd(H, full_matrices=False)[0][:, 0]
    for (node, axis), value in zip(ends[1] if roving else ends[0], U, strict=True):
        if not 1 <= abs(axis) <= 3:
            raise ValueError(f"the response at node {node} has direction {axis}, no x, y or z")
        yield _Reading(node, axis, complex(value))


def _near(sets: list[dict], hz: float) -> NDArray[np.complex128]:
    """Responses (m, k) at the lines near a frequency, the nearest at least."""
    f = np.asarray(sets[0]["x"], dtype=float)
    if any(len(s["x"]) != len(f) for s in sets):
        raise ValueError("its responses have different numbers of lines")
    if not f.min() <= hz <= f.max():
        raise ValueError(f"its responses from {f.min():g} to {f.max():g} Hz do not hold {hz:g} Hz")
    lines = np.flatnonzero(np.abs(f / hz - 1) <= BAND)
    lines = lines if len(lines) else [int(np.abs(f - hz).argmin())]
    return np.array([np.asarray(s["data"], dtype=complex)[lines] for s in sets])
