"""A test's responses on a model: where its points are, which lines are read, their noise."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import fem
from beadwave.fem.identification.hit_records import node_and_axis
from beadwave.fem.identification.hits import FrequencyResponses
from beadwave.fem.identification.measured_shapes import MeasuredShape
from beadwave.fem.modes.mac import Shape
from beadwave.fem.updating.response_fit import (
    MeasuredResponses,
    noise_of_coherence,
    noise_of_neighbours,
)
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages.structure.targets import placed
from beadwave.workflows.structure.hammer import (
    IdentifiedTest,
    points_without_place,
)

# Lines of a test that a fit uses
MAX_LINES = 600  # of the band, at most; those near resonances first
NEAR_BANDWIDTHS = 6.0  # half bandwidths around a resonance that half of the lines may come from
MAX_LOADS = 40  # points and references whose static shapes are added, at most; else references
PROJECTION_REACH = 1.5  # the projection's modes reach this factor beyond the band
MAX_MODES = 96  # computed for it
FULL_MODEL_REACH = 1.3  # the full model's modes reach this factor beyond the lines
CLEAR_OF_NOISE = 10.0  # times its noise, from which on a response judges the projection
LASTING_AMPLITUDE = 0.02  # of a mode's amplitude at the record's end, from which its height is off
OPPOSITE_CORRELATION = -0.7  # correlation of measured with computed residues of a reversed sensor
SIGNIFICANT_RISE = 4.0  # rise of -2 ln(likelihood) that a value explains: two deviations


class Places(NamedTuple):
    """A test on a model."""

    points: Shape  # its points, in the order of `used`
    references: Shape
    used: NDArray[np.int64]  # points of the test that have a place


def test_places(scene: Scene, model: fem.Model, test: IdentifiedTest) -> Places:
    """Places of the points and references of a test on the model; raises InvalidScene if hammer or
    sensors have no place."""
    responses, nodes = test.test.responses, test.test.nodes
    missing = set(points_without_place(test.test))
    used = [i for i in range(len(responses.points)) if i not in missing]
    ends = [node_and_axis(name) for name in responses.references]
    lost = [
        name
        for name, end in zip(responses.references, ends, strict=True)
        if end is None or end[0] not in nodes
    ]
    if lost or not used:
        name = lost[0] if lost else responses.points[0]
        raise InvalidScene(
            f"{test.report.file}: {name} has no place on the structure, and responses are fitted "
            "where force and sensor are; name points by node and direction, as 12+z, and give the "
            "nodes in the file or with --points."
        )

    def on_model(names: Sequence[str]) -> Shape:
        """Points by their names, as functionals of the model: a shape of ones."""
        at = [node_and_axis(name) for name in names]
        directions = np.array([np.sign(a) * np.eye(3)[abs(a) - 1] for _, a in at])
        points = np.array([nodes[n] for n, _ in at])
        shape = MeasuredShape(points, directions, np.ones(len(at), complex))
        return placed(scene, model, test.test.places, shape, 1.0)

    return Places(
        on_model([responses.points[i] for i in used]), on_model(responses.references),
        np.array(used),
    )  # fmt: skip


def resonances_chosen(
    test: IdentifiedTest, band_hz: tuple[float, float], match: Sequence[int] | None
) -> NDArray[np.bool_]:
    """True for identified resonances (n,) that are fitted; raises InvalidScene for unknown numbers,
    and if none is left."""
    hz = test.modes.frequency_hz
    numbers = np.arange(1, len(hz) + 1)
    if match is not None:
        unknown = sorted(set(match) - set(numbers.tolist()))
        if unknown or len(set(match)) < len(match) or not len(match):
            what = unknown[0] if unknown else ",".join(map(str, match)) or "without a number"
            raise InvalidScene(
                f"--match {what} must name resonances 1 to {len(hz)} of {test.report.file}, each "
                "once, as in 1,2,4."
            )
    chosen = (hz >= band_hz[0]) & (hz <= band_hz[1])
    if match is not None:
        chosen &= np.isin(numbers, list(match))
    if not chosen.any():
        listed = ", ".join(f"{n}: {f:.5g} Hz" for n, f in zip(numbers, hz, strict=True))
        raise InvalidScene(
            f"{test.report.file}: no resonance to fit within --band and --match; there are "
            f"{listed}."
        )
    return chosen


def measured_lines(
    test: IdentifiedTest,
    places: Places,
    band_hz: tuple[float, float],
    chosen: NDArray[np.bool_],
) -> tuple[MeasuredResponses, int]:
    """The responses that are fitted, with their noise, and how many lines there were: those near
    resonances and evenly chosen others.

    `chosen` (n,) resonances are fitted; of more lines than `options.lines` up to half are taken
    within `options.near` half bandwidths zeta f of a resonance, where damping shows.
    """
    responses = test.test.responses
    f = responses.frequency_hz
    within = (f > 0) & (f >= band_hz[0]) & (f <= band_hz[1]) & responses.usable
    hz, zeta = test.modes.frequency_hz, test.modes.zeta
    group = np.abs(np.log(np.maximum(f, 1e-9)[:, None] / hz)).argmin(axis=1)
    # a line belongs to the nearest resonance; those of resonances not fitted are not read
    lines = np.flatnonzero(within & chosen[group])
    n_lines = len(lines)
    if n_lines > MAX_LINES:
        distance = np.abs(f[lines, None] - hz[chosen]) / (hz[chosen] * zeta[chosen])
        near = distance.min(axis=1) < NEAR_BANDWIDTHS
        close, far = lines[near], lines[~near]
        half = MAX_LINES // 2
        close = close[:: max(1, -(-len(close) // half))]
        far = far[:: max(1, -(-len(far) // max(MAX_LINES - len(close), 1)))]
        lines = np.sort(np.concatenate([close, far]))
    H, noise = responses.H, noise_of(responses)
    used = places.used
    return MeasuredResponses(
        f[lines], H[np.ix_(used, range(H.shape[1]), lines)],
        noise[np.ix_(used, range(H.shape[1]), lines)], group[lines],
    ), n_lines  # fmt: skip


def noise_of(responses: FrequencyResponses) -> NDArray[np.float64]:
    """Standard deviation (p, m, f) of real and imaginary parts: by coherence and the number of hits
    where there is one, else by the scatter from line to line."""
    noise = noise_of_neighbours(responses.H)
    if responses.coherence is None:
        return noise
    by_coherence = noise_of_coherence(
        responses.H, responses.coherence, np.maximum(averages(responses), 2.0)
    )
    hit_once = averages(responses) < 2
    return np.where(hit_once[:, None, None], noise, by_coherence)


def averages(responses: FrequencyResponses) -> NDArray[np.float64]:
    """Number (p,) of hits behind each point's responses."""
    count = np.ones(len(responses.points))
    for one in responses.deletions:
        count[one.points] = len(one.change)
    return count
