"""Measured mode shapes from universal files: data sets 55, or the responses of data sets 58.

Points come from data set 15 or 2411, lengths in the unit of data set 164, else in metres. Of
responses the shape is the first left singular vector of those near the resonance (complex mode
indicator function: Shih et al., Mech. Syst. Signal Process. 2 (1988) 367).
"""

from collections.abc import Mapping, Sequence
from re import findall
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

POINTS, UNITS, SHAPE, RESPONSE = (15, 2411), 164, 55, 58
FREQUENCY_RESPONSE = 4  # type of a function in data set 58
HERTZ = r"([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*Hz\b"  # in a line of text
COMPLEX = (3, 7)  # analyses of data set 55 that state a complex eigenvalue
FEWEST = 3  # displacements of a shape: the MAC of fewer hardly tells shapes apart


class MeasuredShape(NamedTuple):
    """Displacements of one mode at m points, each along one direction."""

    points: NDArray[np.float64]  # (m, 3) [m]
    directions: NDArray[np.float64]  # (m, 3) unit vectors
    values: NDArray[np.complex128]  # (m,)


class RigidFit(NamedTuple):
    """The turn and the shift that bring points nearest to others: y = turn @ x + shift."""

    turn: NDArray[np.float64]  # (3, 3) a rotation
    shift: NDArray[np.float64]  # (3,) [m]
    misfit: NDArray[np.float64]  # (m,) [m] distances that are left
    mirrored: float  # [m] the largest that a mirror image would leave

    def moved(self, shape: MeasuredShape) -> MeasuredShape:
        """A shape with its points and directions brought over."""
        return shape._replace(
            points=shape.points @ self.turn.T + self.shift,
            directions=shape.directions @ self.turn.T,
        )


def rigid_fit(points: NDArray[np.float64], onto: NDArray[np.float64]) -> RigidFit:
    """The rotation R and shift t of the least sum of |R x + t - y|^2 over points x (m, 3) and their
    places y (m, 3), by the singular values of the covariance sum (y - y0)(x - x0)^T.

    Kabsch, Acta Cryst. A 32 (1976) 922; Arun, Huang and Blostein, IEEE Trans. Pattern Anal. Mach.
    Intell. 9 (1987) 698.
    """
    # R = U diag(1, 1, +-1) V^T: the sign of the smallest singular value makes it a rotation, the
    # other one a mirror image. Its misfit tells whether the points name one hand at all: those of a
    # plane fit as well by both
    x_0, y_0 = points.mean(axis=0), onto.mean(axis=0)
    U, _, Vt = np.linalg.svd((onto - y_0).T @ (points - x_0))
    sign = np.sign(np.linalg.det(U @ Vt))
    proper, mirrored = ((U * [1.0, 1.0, last]) @ Vt for last in (sign, -sign))
    misfits = [
        np.linalg.norm((points - x_0) @ R.T - (onto - y_0), axis=1) for R in (proper, mirrored)
    ]
    return RigidFit(proper, y_0 - proper @ x_0, misfits[0], float(misfits[1].max()))


class _Reading(NamedTuple):
    """Displacement of a node along an axis."""

    node: int
    axis: int  # 1, 2, 3, negative against it
    value: complex


def points_of_nodes(sets: Sequence[dict]) -> dict[int, NDArray[np.float64]]:
    """Points (3,) [m] of the nodes in data sets, by number; raises ValueError for local axes."""
    unit = next((float(s["length"]) for s in sets if s["type"] == UNITS), 1.0)
    points: dict[int, NDArray[np.float64]] = {}
    for s in (s for s in sets if s["type"] in POINTS):
        if np.any(np.asarray(s["disp_cs"]) > 0):
            raise ValueError("its displacements are in local axes, write them in global ones")
        x = np.column_stack([np.atleast_1d(s[axis]) for axis in "xyz"]) / unit
        points |= dict(zip(np.atleast_1d(s["node_nums"]).astype(int).tolist(), x, strict=True))
    if points and not np.isfinite(list(points.values())).all():
        raise ValueError("a point is no number")
    return points


def along_directions(
    points: Mapping[int, NDArray[np.float64]],
    ends: Sequence[tuple[int, int] | None],
    values: NDArray[np.complex128],
) -> MeasuredShape | None:
    """The shape with these values (m,) at ends (node, axis), axis 1 to 3 and negative against it;
    None where an end has no point, or there are too few to tell modes apart."""
    if len(ends) < FEWEST or any(end is None or end[0] not in points for end in ends):
        return None
    nodes, axes = np.array(ends).T
    directions = np.sign(axes)[:, None] * np.eye(3)[np.abs(axes) - 1]
    return MeasuredShape(np.array([points[node] for node in nodes.tolist()]), directions, values)


def measured_shape(sets: Sequence[dict], hz: float) -> MeasuredShape:
    """The shape of the mode at `hz` in the data sets of a file.

    Raises ValueError where they have none, KeyError, TypeError or IndexError for damaged ones.
    """
    points = points_of_nodes(sets)
    if not points:
        raise ValueError("it has no points, which data set 15 or 2411 holds")

    shapes = [s for s in sets if s["type"] == SHAPE]
    readings = _of_shapes(shapes, hz) if shapes else _of_responses(sets, hz)
    unknown = sorted({r.node for r in readings} - points.keys())
    if unknown:
        raise ValueError(f"node {unknown[0]} has no point in data set 15 or 2411, add it")
    if len(readings) < FEWEST:
        raise ValueError(
            f"it has {len(readings)} measured displacements at {hz:g} Hz, at least {FEWEST} tell "
            "modes apart; measure more points"
        )
    values = np.array([r.value for r in readings])
    if not (np.isfinite(values).all() and values.any()):  # the MAC would be 0 / 0
        raise ValueError(f"the displacements at {hz:g} Hz are zero or no numbers")
    axes = np.array([r.axis for r in readings])
    directions = np.sign(axes)[:, None] * np.eye(3)[np.abs(axes) - 1]
    return MeasuredShape(np.array([points[r.node] for r in readings]), directions, values)


def _of_shapes(shapes: list[dict], hz: float, *, farthest: float = 1.05) -> list[_Reading]:
    """Displacements of the data set 55 whose frequency is nearest to `hz`, within the factor
    `farthest`."""
    frequencies = frequencies_hz(shapes).tolist()
    i = int(np.argmin(np.abs(np.log(np.maximum(frequencies, 1e-9)) - np.log(hz))))
    if not 1 / farthest < frequencies[i] / hz < farthest:
        listed = ", ".join(f"{f:g}" for f in frequencies)
        is_complex = any(s["analysis_type"] in COMPLEX for s in shapes)
        unit = ", eigenvalues being in rad/s unless modal A, B or a title say Hz"
        raise ValueError(
            f"it has no shape near {hz:g} Hz, there are {listed} Hz{unit if is_complex else ''}"
        )

    # a direction that is zero in every shape at these nodes was not measured
    nodes, measured = np.atleast_1d(shapes[i]["node_nums"]), 0
    for s in shapes:
        if np.array_equal(np.atleast_1d(s["node_nums"]), nodes):
            measured = measured + np.abs(_components(s))
    values = _components(shapes[i])
    return [
        _Reading(int(nodes[n]), int(axis) + 1, complex(values[axis, n]))
        for axis, n in zip(*np.nonzero(measured > 0), strict=True)
    ]


def frequencies_hz(shapes: Sequence[dict], *, within: float = 0.01) -> NDArray[np.float64]:
    """Frequencies (n,) [Hz] of n data sets 55.

    Eigenvalues lambda are in rad/s by the standard, which some programs write in Hz: in a file
    where modal A = 2 i Im lambda, modal B = -lambda A, or a frequency in Hz in the lines of text,
    holds `within` a share for 2 pi lambda in all sets that have it, and not for lambda.
    """
    eigenvalue = np.array(
        [complex(s["eig"]) if s["analysis_type"] in COMPLEX else np.nan for s in shapes]
    )

    # |lambda| in rad/s over that which is written, by each of the three; nan where a set lacks it
    A, B = (np.array([complex(s.get(key, 0.0)) for s in shapes]) for key in ("modal_a", "modal_b"))
    texts = [" ".join(str(s.get(f"id{i}", "")) for i in range(1, 6)) for s in shapes]
    stated = np.array([float(hz[0]) if (hz := findall(HERTZ, t)) else np.nan for t in texts])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = (
            np.where(A != 0, np.abs(A) / (2 * np.abs(eigenvalue.imag)), np.nan),
            np.where((A != 0) & (B != 0), np.abs(B / A) / np.abs(eigenvalue), np.nan),
            2 * np.pi * stated / np.abs(eigenvalue),
        )
    # the later ones count more: A alone depends on how shapes are scaled
    unit = 1.0
    for ratio in ratios:
        ratio = ratio[np.isfinite(ratio)]
        for factor in (1.0, 2 * np.pi):
            if ratio.size and np.all(np.abs(ratio / factor - 1) < within):
                unit = factor

    of_complex = unit * np.abs(eigenvalue) / (2 * np.pi)
    return np.array(
        [
            of_complex[i] if s["analysis_type"] in COMPLEX else float(s["freq"])
            for i, s in enumerate(shapes)
        ]
    )


def _components(s: dict) -> NDArray[np.complex128]:
    """Displacements (3, n) along x, y and z of a data set 55."""
    return np.array([np.atleast_1d(s[key]) for key in ("r1", "r2", "r3")], dtype=complex)


def _of_responses(sets: Sequence[dict], hz: float, *, band: float = 0.02) -> list[_Reading]:
    """Displacements by frequency responses at many points to hits at one point, or at one point to
    a roving hammer; from the lines within a share `band` of the frequency, at least the nearest."""
    sets = [s for s in sets if s["type"] == RESPONSE and s["func_type"] == FREQUENCY_RESPONSE]
    if not sets:
        raise ValueError("it has neither shapes (data set 55) nor frequency responses (58)")

    # by reciprocity a roving hammer with one accelerometer measures the same shape
    response, reference = (
        [(int(s[f"{end}_node"]), int(s[f"{end}_dir"])) for s in sets] for end in ("rsp", "ref")
    )
    roving = len(set(response)) == 1 < len(set(reference))
    if not roving and len(set(reference)) > 1:
        raise ValueError("its responses are to hammers at several points, keep those of one")

    f = np.asarray(sets[0]["x"], dtype=float)
    if any(len(s["x"]) != len(f) for s in sets):
        raise ValueError("its responses have different numbers of lines")
    if not f.min() <= hz <= f.max():
        raise ValueError(f"its responses from {f.min():g} to {f.max():g} Hz do not hold {hz:g} Hz")

    # near a resonance H ~ phi phi_ref^* / (..): one shape at all lines, the first singular vector
    lines = np.flatnonzero(np.abs(f / hz - 1) <= band)
    lines = lines if len(lines) else [int(np.abs(f - hz).argmin())]
    H = np.array([np.asarray(s["data"], dtype=complex)[lines] for s in sets])
    shape = np.linalg.svd(H, full_matrices=False)[0][:, 0]

    readings = []
    for (node, axis), value in zip(reference if roving else response, shape, strict=True):
        if not 1 <= abs(axis) <= 3:
            raise ValueError(f"the response at node {node} has direction {axis}, no x, y or z")
        readings.append(_Reading(node, axis, complex(value)))
    return readings
