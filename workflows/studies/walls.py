"""Ten walls before the rig's chain: what each of the thesis' statements about them is worth.

Thesis, section 7.2, figures 7.13 to 7.16. The measured waveforms are not in its text, so walls are
compared with each other, by the distances of `rig_walls`.
"""

from itertools import combinations

import numpy as np

from workflows.run_folder import Picture
from workflows.scene import Scene
from workflows.stages import Watch
from workflows.studies.observed import ERROR, Observed, require_chain
from workflows.studies.rig_walls import (
    HALF_SPACE,
    N_WAVES,
    ONE_DOF_HZ,
    RIGID,
    SLIGHT,
    STRONG,
    UNMOVED,
    distance,
    one_dof,
    overall,
    rig_walls,
    spread,
    struck,
)
from workflows.studies.schemes import require_rig
from workflows.study import Finding
from workflows.study_figures import Line, Panel, matrix, panels

ALIKE = 0.1  # distance over all that comes back, of walls that behave alike
NUMBERS = range(1, N_WAVES + 1)

Runs = dict[str, Observed]
Spheres = tuple[int, ...]


def walls(scene: Scene, watch: Watch) -> Finding:
    """Arrivals at every sphere watched, and the distance of every pair of walls."""
    require_rig(scene)
    spheres = require_chain(scene)
    runs: Runs = {}
    for standing in rig_walls(scene, watch):
        with watch(standing.name):
            runs[standing.name] = struck(scene, standing, spheres, ERROR)
    pictures = (
        Picture("study_walls", _records(runs, spheres)),
        Picture("study_walls_distances", _distances(runs, spheres)),
    )
    columns = ("quantity", "wall", *(f"reflected {k}" for k in NUMBERS), "all")
    rows = (*_arrivals(runs, spheres), *_pairs(runs, spheres))
    return Finding("walls", columns, rows, _sentences(runs, spheres), pictures)


def _arrivals(runs: Runs, spheres: Spheres):
    for sphere in spheres:
        for name, run in runs.items():
            found = [run.wave(sphere, "reflected", k) for k in NUMBERS]
            times = [label and 1e3 * label.arrival.time for label in found]
            peaks = [label and label.arrival.peak_velocity for label in found]
            yield f"time at sphere {sphere} [ms]", name, *times, None
            yield f"peak at sphere {sphere} [m/s]", name, *peaks, None


def _pairs(runs: Runs, spheres: Spheres):
    for one, other in combinations(runs.values(), 2):
        apart = [_or_none(distance(one, other, k, spheres)) for k in NUMBERS]
        whole = overall(one, other, spheres)
        yield "distance", f"{one.name} | {other.name}", *apart, whole


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else value


def _sentences(runs: Runs, spheres: Spheres) -> tuple[str, ...]:
    return (
        *_likenesses(runs, spheres),
        *_dependences(runs, spheres),
        "A distance is the rms difference of the velocities at the observed spheres over their "
        "rms, in the half width of the wave (all: from the first touch on); 0 is equal, 1.41 is "
        f"apart. Alike is below {ALIKE:g}, and a wave is independent of its wall below "
        f"{UNMOVED:g}, slightly dependent below {SLIGHT:g}, strongly above.",
        "Which wall is right this cannot say: the measured waves are not in the thesis' text.",
    )


def _likenesses(runs: Runs, spheres: Spheres):
    """The first three waves hardly know the wall, so the fourth's arrival says which are alike."""
    sphere = spheres[-1]
    fourth = {name: run.wave(sphere, "reflected", N_WAVES) for name, run in runs.items()}
    at = {name: label.arrival.time if label else np.inf for name, label in fourth.items()}

    def judged(one, other):
        nearest = min(map(one_dof, ONE_DOF_HZ), key=lambda name: abs(at[one] - at[name]))
        numbers = (
            f"distance {overall(runs[one], runs[other], spheres):.3f}; the fourth wave is at "
            f"sphere {sphere} at {1e3 * at[one]:.2f} and {1e3 * at[other]:.2f} ms, nearest is "
            f"{nearest} at {1e3 * at[nearest]:.2f} ms"
        )
        return nearest == other, numbers

    yield _answer("ROM 907 behaves like the 1-DOF wall at 907 Hz", *judged("ROM 907", one_dof(907)))
    yield _answer("ROM 269 behaves like the 1-DOF wall at 700 Hz", *judged("ROM 269", one_dof(700)))
    alike, numbers = judged("ROM 269", one_dof(269))
    yield _answer("ROM 269 differs from the 1-DOF wall at 269 Hz", not alike, numbers)
    plain = overall(runs[one_dof(8425)], runs[HALF_SPACE], spheres)
    yield _answer("8425 Hz is like the half-space", plain < ALIKE, f"distance {plain:.3f}")


def _dependences(runs: Runs, spheres: Spheres):
    moving = [run for name, run in runs.items() if name != RIGID]
    found = {k: spread(moving, k, spheres) for k in NUMBERS}
    rigid = distance(runs[RIGID], runs[HALF_SPACE], 1, spheres)
    where = [sphere for sphere in spheres if spread(moving, 1, (sphere,)) < UNMOVED]
    yield _answer(
        "The first reflected wave is independent of the wall",
        where == list(spheres),
        f"largest distance of two walls {_by_sphere(moving, 1, spheres)}: independent at "
        f"{', '.join(map(str, where)) or 'none'}, until the second catches up with it; from a "
        f"half-space to a rigid surface, a stiffer contact, it is {rigid:.3f}",
    )
    yield _answer(
        "The second depends slightly on it",
        UNMOVED <= found[2] < SLIGHT,
        f"largest distance {found[2]:.3f}",
    )
    yield _answer("and mainly at sphere 4", *_mainly(moving, 2, 4, spheres))
    for number, name in ((3, "third"), (4, "fourth")):
        yield _answer(
            f"The {name} depends strongly on it",
            found[number] > STRONG,
            f"largest distance {found[number]:.3f}",
        )


def _mainly(runs: list[Observed], number: int, sphere: int, spheres: Spheres) -> tuple[bool, str]:
    found = {at: np.nan_to_num(spread(runs, number, (at,))) for at in spheres}
    return max(found, key=found.get) == sphere, _by_sphere(runs, number, spheres)


def _by_sphere(runs: list[Observed], number: int, spheres: Spheres) -> str:
    found = {sphere: spread(runs, number, (sphere,)) for sphere in spheres}
    named = (f"{value:.3f} at sphere {at}" for at, value in found.items() if not np.isnan(value))
    return ", ".join(named)


def _answer(statement: str, holds: bool, numbers: str) -> str:
    return f'"{statement}": {"holds" if holds else "does not hold"}, {numbers}.'


def _records(runs: Runs, spheres: Spheres) -> bytes:
    sets = (
        ("half-space (7.13)", (HALF_SPACE, RIGID, one_dof(8425))),
        ("one mass (7.14)", (one_dof(269), one_dof(907), one_dof(240))),
        ("ROM 269 (7.15)", ("ROM 269", one_dof(269), one_dof(700))),
        ("ROM 907 (7.16)", ("ROM 907", one_dof(907), "ROM all four")),
    )
    sets_of_panels = [
        Panel(
            f"{title}, sphere {sphere}", "time [ms]", "velocity [m/s]",
            [Line(name, runs[name].milliseconds, runs[name].velocity(sphere), style)
             for name, style in zip(names, ("-", "--", ":"), strict=True)],
        )
        for title, names in sets for sphere in spheres
    ]  # fmt: skip
    return panels(sets_of_panels, columns=len(spheres), size=(4.6, 2.7))


def _distances(runs: Runs, spheres: Spheres) -> bytes:
    names = list(runs)
    apart = np.zeros((len(names), len(names)))
    for (i, one), (j, other) in combinations(enumerate(runs.values()), 2):
        apart[i, j] = apart[j, i] = overall(one, other, spheres)
    return matrix(apart, names, "distance over all that comes back")
