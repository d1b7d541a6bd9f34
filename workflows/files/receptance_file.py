"""A measured driving-point response as the wall: wall.receptance read, fitted, and what forbids it.

Responses in the units of velocity or of acceleration are divided by i omega or by -omega^2.
"""

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beadwave import rom
from beadwave.coupling.measured_wall import surface_compliance
from beadwave.rom.passive_fit import refitted
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.scene.tables.walls import RESPONSE_UNITS, MeasuredWall

# Error of a fit
N_DRAWS = 3  # fits of the response with its residuals at random phases
BAND_SHARE = 0.8  # of the highest frequency, up to which another fit reads


class FitAndErrors(NamedTuple):
    """The fit of a measured response and others that differ by its errors."""

    fit: rom.ModalFit
    by_noise: tuple[rom.ModalFit, ...]  # of the fit plus its residuals at random phases
    by_band: rom.ModalFit  # of the lower part of the band
    half_space: float  # [m/N] what Hertz' law holds of the response
    highest_hz: float


def fitted(wall: MeasuredWall) -> FitAndErrors:
    """The fit of wall.receptance, made again only where file or keys have changed; raises
    InvalidScene for a file that is no driving point's response."""
    status = Path(wall.receptance).stat()
    read = ("receptance", "unit", "response", "half_space", "sensor_distance", "young", "poisson")
    key = tuple((name, getattr(wall, name)) for name in read)
    return _fitted(key, (status.st_mtime_ns, status.st_size, status.st_ino))


@lru_cache(maxsize=4)
def _fitted(key: tuple, stamp: tuple[int, int, int]) -> FitAndErrors:
    """`fitted` of a wall with these keys, and of a file with this stamp."""
    wall = MeasuredWall(kind="measured", **dict(key))
    f, H = driving_point(wall)
    try:
        fit = rom.passive_fit(f, H, most_free=1)
        model = rom.modal_receptance(fit, f)[:, 0, 0]
        rng = np.random.default_rng(0)
        by_noise = tuple(
            refitted(f, model + (H - model) * np.exp(2j * np.pi * rng.random(len(f))), fit)
            for _ in range(N_DRAWS)
        )
        inside = f <= BAND_SHARE * f[-1]
        by_band = rom.passive_fit(f[inside], H[inside], most_free=1)
    except rom.ReductionError as error:
        raise InvalidScene(
            f"wall.receptance: {wall.receptance}, read in {wall.unit}: {error}."
        ) from None
    half_space = wall.half_space or 0.0
    if wall.sensor_distance is not None:
        half_space = surface_compliance(wall.young, wall.poisson, wall.sensor_distance)
    return FitAndErrors(fit, by_noise, by_band, half_space, float(f[-1]))


def driving_point(wall: MeasuredWall) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (k,) [Hz] above 0 and the receptance (k,) [m/N] of wall.receptance.

    Where the file names its points, the response is that of the first point that was hit itself, or
    of number wall.response; hit against its direction the sign is changed. Raises InvalidScene.
    """
    from beadwave.fem.identification.hit_records import node_and_axis
    from beadwave.workflows.files.hammer import measured_test

    path = Path(wall.receptance)
    measured = measured_test([path])
    # spectra of records without a force are passive as well: the fit of one is a wall of any size
    if records := measured.without_force:
        raise InvalidScene(
            f"wall.receptance: {path} has {records} without a force; give the response of the "
            "point of contact to hits on itself."
        )
    test = measured.responses

    # which of the responses (k,) is that of a point to a hit on itself
    pairs = [
        (point, reference, test.H[i, j])
        for i, point in enumerate(test.points)
        for j, reference in enumerate(test.references)
    ]
    if wall.response is not None and wall.response > len(pairs):
        raise InvalidScene(
            f"wall.response = {wall.response}, but {path} has {len(pairs)} responses; take 1 to "
            f"{len(pairs)}."
        )
    named = [tuple(map(node_and_axis, pair[:2])) for pair in pairs]
    of_point = [
        k for k, (a, b) in enumerate(named) if a and b and (a[0], abs(a[1])) == (b[0], abs(b[1]))
    ]
    if wall.response is not None:
        number = wall.response - 1
    elif of_point:
        number = of_point[0]
    elif len(pairs) == 1 and None in named[0]:
        number = 0
    else:
        names = ", ".join(f"{point} to {reference}" for point, reference, _ in pairs[:4])
        raise InvalidScene(
            f"wall.receptance: {path} names no response of a point to a hit on itself ({names}); "
            "measure the point of contact, or name its response by wall.response = 1 to "
            f"{len(pairs)}."
        )
    if None not in named[number] and number not in of_point:
        point, reference, _ = pairs[number]
        raise InvalidScene(
            f"wall.response = {number + 1} of {path} is the response of {point} to a hit on "
            f"{reference}, no driving point's; take that of a point to a hit on itself."
        )
    against = number in of_point and named[number][0][1] != named[number][1][1]

    # to a displacement over force, in SI units; the line at 0 Hz has none of a velocity
    order, factor = RESPONSE_UNITS[wall.unit]
    f = test.frequency_hz
    lines = (f > 0) & test.usable
    s = 2j * np.pi * f[lines]
    return f[lines], (-1 if against else 1) * factor * pairs[number][2][lines] / s**order
