"""Ten walls before the rig's chain: what each of the thesis' statements about them is worth.

Thesis, section 7.2, figures 7.13 to 7.16. The measured waveforms are not in its text, so walls are
compared with each other, by the distances of `rig_walls`.
"""

from itertools import combinations

import numpy as np

from workflows.run_folder import Picture
from workflows.scene import Scene
from workflows.stages import Watch
from workflows.studies.observed import ERROR, Observed, require_chain, require_echo
from workflows.studies.rig_walls import (
    HALF_SPACE,
    N_WAVES,
    ONE_DOF_HZ,
    RIGID,
    ROMS,
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
from workflows.study import Finding, Table
from workflows.study_figures import Line, Panel, matrix, panels

NUMBERS = range(1, N_WAVES + 1)
FEW = tuple(map(one_dof, (269, 907, 700, 240)))  # one-mass walls that move within the contact

Runs = dict[str, Observed]
Spheres = tuple[int, ...]


def walls(scene: Scene, watch: Watch) -> Finding:
    """Arrivals at every sphere watched, and the distance of every pair of walls."""
    require_rig(scene)
    spheres = tuple(sorted(require_chain(scene)))
    runs: Runs = {}
    for standing in rig_walls(scene, watch):
        with watch(standing.name):
            runs[standing.name] = require_echo(scene, struck(scene, standing, spheres, ERROR))
    pictures = (
        Picture("study_walls", _records(runs, spheres)),
        Picture("study_walls_distances", _distances(runs, spheres)),
    )
    columns = ("sphere", "wall", *(f"{what}{k}" for k in NUMBERS for what in ("t_ms_", "v_m_s_")))
    beside = Table("distances", ("one", "other", *(f"D{k}" for k in NUMBERS), "all"),
                   tuple(_pairs(runs, spheres)))  # fmt: skip
    rows = tuple(_arrivals(runs, spheres))
    return Finding("walls", columns, rows, _sentences(runs, spheres), pictures, (beside,))


def _arrivals(runs: Runs, spheres: Spheres):
    """When each reflected wave is at a sphere, and how fast."""
    for sphere in spheres:
        for name, run in runs.items():
            found = (run.wave(sphere, "reflected", k) for k in NUMBERS)
            waves = [
                (None, None) if label is None
                else (1e3 * label.arrival.time, label.arrival.peak_velocity)
                for label in found
            ]  # fmt: skip
            yield sphere, name, *(value for wave in waves for value in wave)


def _pairs(runs: Runs, spheres: Spheres):
    for one, other in combinations(runs.values(), 2):
        apart = (distance(one, other, k, spheres) for k in NUMBERS)
        yield one.name, other.name, *map(_or_none, (*apart, overall(one, other, spheres)))


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else value


def _sentences(runs: Runs, spheres: Spheres) -> tuple[str, ...]:
    return (
        f"The table: time [ms] and peak velocity [m/s] of the reflected waves 1 to {N_WAVES}.",
        *_likenesses(runs, spheres),
        *_dependences(runs, spheres),
        "A distance is the rms difference of the velocities at the observed spheres over their "
        "rms, in the half width of the wave (all: from the first touch on); 0 is equal, 1.41 is "
        f"apart. A wave is independent of its wall below {UNMOVED:g}, slightly dependent below "
        f"{SLIGHT:g}, strongly above. walls_distances.csv has those of all pairs.",
        "Which wall is right this cannot say: the measured waves are not in the thesis' text.",
    )


def _likenesses(runs: Runs, spheres: Spheres):
    """The first three waves hardly know which wall of a body it is; the fourth's arrival does."""
    bodies = [runs[name] for name in (*FEW, *ROMS) if name in runs]
    early = max(0.0, *np.nan_to_num([spread(bodies, k, spheres) for k in NUMBERS[:-1]]))
    yield (
        "Two walls are alike, here, where no other one-mass wall's fourth reflected wave comes "
        f"nearer to that of the first, at sphere {spheres[-1]}: in the first three, and so over "
        f"all that comes back, the walls that move hardly differ (at most {early:.3f})."
    )
    for one, hz in (("ROM 907", 907), ("ROM 269", 700), (HALF_SPACE, 8425)):
        says = "behaves" if one in ROMS else "answers"
        statement = f"{_whose(one)} {says} like the 1-DOF wall at {hz} Hz"
        yield _answer(statement, *_alike(runs, one, one_dof(hz), spheres))
    alike, numbers = _alike(runs, "ROM 269", one_dof(269), spheres)
    differs = None if alike is None else not alike
    yield _answer("ROM 269 differs from the 1-DOF wall at 269 Hz", differs, numbers)


def _whose(name: str) -> str:
    return f"The {name}" if name == HALF_SPACE else name


def _alike(runs: Runs, one: str, other: str, spheres: Spheres) -> tuple[bool | None, str]:
    """Whether the one-mass wall `other` is the nearest to `one`, by the fourth wave's arrival."""
    at = _fourth(runs, spheres[-1])
    if one not in at or other not in at:
        missing = one if one not in at else other
        return None, f"{missing} sends no fourth wave to sphere {spheres[-1]}"
    away = {name: abs(at[one] - at[name]) for name in map(one_dof, ONE_DOF_HZ) if name in at}
    nearest, *_ = sorted(away, key=away.get)
    by_distance = {name: overall(runs[one], runs[name], spheres) for name in away}
    return nearest == other, (
        f"fourth waves at {1e3 * at[one]:.2f} and {1e3 * at[other]:.2f} ms, nearest is that of "
        f"{nearest} at {1e3 * at[nearest]:.2f} ms; {_by_distance(by_distance, other)}"
    )


def _fourth(runs: Runs, sphere: int) -> dict[str, float]:
    """When the fourth reflected wave is at the sphere [s], of the walls that send one."""
    found = {name: run.wave(sphere, "reflected", N_WAVES) for name, run in runs.items()}
    return {name: label.arrival.time for name, label in found.items() if label}


def _by_distance(found: dict[str, float], other: str) -> str:
    """What the distance over all that comes back says, and whether it can choose."""
    first, second, *_ = sorted(found, key=found.get)
    if found[first] < 0.5 * found[second]:
        return f"the distance over all, {found[other]:.3f}, says {first} (next {found[second]:.3f})"
    return (
        f"the distance over all, {found[other]:.3f}, does not choose ({first} "
        f"{found[first]:.3f}, {second} {found[second]:.3f})"
    )


def _dependences(runs: Runs, spheres: Spheres):
    moving = [run for name, run in runs.items() if name != RIGID]
    found = {k: spread(moving, k, spheres) for k in NUMBERS}
    rigid = distance(runs[RIGID], runs[HALF_SPACE], 1, spheres)
    where = [sphere for sphere in spheres if spread(moving, 1, (sphere,)) < UNMOVED]
    caught = "" if where == list(spheres) else ", elsewhere the second has caught up with it"
    surface = (
        ""
        if np.isnan(rigid)
        else (f"; from a half-space to a rigid surface, a stiffer contact, it is {rigid:.3f}")
    )
    yield _answer(
        "The first reflected wave is independent of the wall",
        _known(found[1], where == list(spheres)),
        f"largest distance of two walls {_by_sphere(moving, 1, spheres)}: independent at "
        f"{', '.join(map(str, where)) or 'none'}{caught}{surface}",
    )
    slight = UNMOVED <= found[2] < SLIGHT
    yield _answer("The second depends slightly on it", _known(found[2], slight), _largest(found[2]))
    yield _answer("and mainly at sphere 4", *_mainly(moving, 2, 4, spheres))
    for number, name in ((3, "third"), (4, "fourth")):
        strong = _known(found[number], found[number] > STRONG)
        yield _answer(f"The {name} depends strongly on it", strong, _largest(found[number]))


def _known(value: float, holds: bool) -> bool | None:
    return None if np.isnan(value) else holds


def _largest(value: float) -> str:
    return "no wall sends it" if np.isnan(value) else f"largest distance {value:.3f}"


def _mainly(
    runs: list[Observed], number: int, sphere: int, spheres: Spheres
) -> tuple[bool | None, str]:
    found = {at: spread(runs, number, (at,)) for at in spheres}
    seen = {at: value for at, value in found.items() if not np.isnan(value)}
    if sphere not in seen or len(seen) < 2:
        return None, f"the wave is watched at {', '.join(map(str, seen)) or 'no sphere'} only"
    return max(seen, key=seen.get) == sphere, _by_sphere(runs, number, spheres)


def _by_sphere(runs: list[Observed], number: int, spheres: Spheres) -> str:
    found = {sphere: spread(runs, number, (sphere,)) for sphere in spheres}
    named = (f"{value:.3f} at sphere {at}" for at, value in found.items() if not np.isnan(value))
    return ", ".join(named) or "unknown"


def _answer(statement: str, holds: bool | None, numbers: str) -> str:
    said = "cannot be judged" if holds is None else "holds" if holds else "does not hold"
    return f'"{statement}": {said}, {numbers}.'


def _records(runs: Runs, spheres: Spheres) -> bytes:
    sets = (
        ("half-space (figure 7.13)", (HALF_SPACE, RIGID, one_dof(8425))),
        ("one mass (figure 7.14)", (one_dof(269), one_dof(907), one_dof(240))),
        ("ROM 269 (figure 7.15)", ("ROM 269", one_dof(269), one_dof(700))),
        ("ROM 907 (figure 7.16)", ("ROM 907", one_dof(907), "ROM all four")),
    )
    sets_of_panels = [
        Panel(
            f"{title}, sphere {sphere}", "time [ms]", "velocity [m/s]",
            [Line(name, runs[name].milliseconds, runs[name].velocity(sphere))
             for name in names if name in runs],
        )
        for title, names in sets for sphere in spheres
    ]  # fmt: skip
    return panels(sets_of_panels, columns=len(spheres), size=(4.6, 2.7))


def _distances(runs: Runs, spheres: Spheres) -> bytes:
    names = list(runs)
    apart = np.zeros((len(names), len(names)))
    for (i, one), (j, other) in combinations(enumerate(runs.values()), 2):
        apart[i, j] = apart[j, i] = overall(one, other, spheres)
    return matrix(apart, names, "distance over all that comes back [-]")
