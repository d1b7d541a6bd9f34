"""Ten walls before the rig's chain: what each of the thesis' statements about them is worth.

Thesis, section 7.2, figures 7.13 to 7.16. The measured waveforms are not in its text, so walls are
compared with each other, by the distances of `workflows.evidence.thesis.wave_distance`.
"""

from functools import partial
from itertools import combinations
from math import inf, isnan
from typing import Any

import numpy as np

from workflows.evidence.prose import rendered
from workflows.evidence.thesis.observed_run import ERROR, Observed
from workflows.evidence.thesis.records import record, wave_cells, wave_columns
from workflows.evidence.thesis.requirements import require_chain, require_echo, require_rig
from workflows.evidence.thesis.rig_walls import (
    HALF_SPACE,
    N_WAVES,
    ONE_DOF_HZ,
    RIGID,
    ROMS,
    SLIGHT,
    STRONG,
    UNMOVED,
    impact_run,
    one_dof,
    rig_walls,
)
from workflows.evidence.thesis.wave_distance import (
    dependence,
    distance,
    overall,
    similarity,
    spread,
)
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import matrix, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages.pipeline import Progress

NUMBERS = range(1, N_WAVES + 1)
ALIKE = (("ROM 907", 907), ("ROM 269", 700), (HALF_SPACE, 8425))  # walls that the thesis compares
FEW = tuple(map(one_dof, (269, 907, 700, 240)))  # one-mass walls that move within the contact

Runs = dict[str, Observed]
Spheres = tuple[int, ...]


def walls(scene: Scene, progress: Progress) -> Finding:
    """Waves that ten walls send back, and how far they differ (thesis, figures 7.13 to 7.16)."""
    require_rig(scene)
    spheres = tuple(sorted(require_chain(scene)))
    runs: Runs = {}
    for standing in rig_walls(scene, progress):
        with progress(standing.name):
            runs[standing.name] = require_echo(scene, impact_run(scene, standing, spheres, ERROR))
    pictures = (
        Picture("study_walls", _records(runs, spheres)),
        Picture("study_walls_distances", _distances(runs, spheres)),
    )
    columns = ("sphere", "wall", *wave_columns(NUMBERS))
    beside = Table("distances", ("one", "other", *(f"D{k}" for k in NUMBERS), "all"),
                   tuple(_pairs(runs, spheres)))  # fmt: skip
    rows = tuple(_arrivals(runs, spheres))
    sentences = rendered(__file__, **_numbers(runs, spheres))
    return Finding((Table("walls", columns, rows), beside), sentences, pictures)


def _arrivals(runs: Runs, spheres: Spheres):
    """When each reflected wave is at a sphere, and how fast."""
    for sphere in spheres:
        for name, run in runs.items():
            yield sphere, name, *wave_cells(run, sphere, NUMBERS)


def _pairs(runs: Runs, spheres: Spheres):
    for one, other in combinations(runs.values(), 2):
        apart = (distance(one, other, k, spheres) for k in NUMBERS)
        yield one.name, other.name, *map(_or_none, (*apart, overall(one, other, spheres)))


def _or_none(value: float) -> float | None:
    return None if isnan(value) else value


def _numbers(runs: Runs, spheres: Spheres) -> dict[str, Any]:
    bodies = [runs[name] for name in (*FEW, *ROMS) if name in runs]
    moving = [run for name, run in runs.items() if name != RIGID]
    waves = {k: dependence(moving, k, spheres) for k in NUMBERS}
    masses = tuple(map(one_dof, ONE_DOF_HZ))
    near = partial(similarity, runs, masses=masses, number=N_WAVES, spheres=spheres)
    early = [spread(bodies, k, spheres) for k in NUMBERS[:-1]]
    return {
        "n_waves": N_WAVES,
        "spheres": spheres,
        "early": max([0.0, *(value for value in early if not isnan(value))]),
        "similarities": [near(one, one_dof(hz)) for one, hz in ALIKE],
        "unlike": near("ROM 269", one_dof(269)),
        "waves": waves,
        "independent": [s for s in spheres if waves[1].by_sphere.get(s, inf) < UNMOVED],
        "rigid": _or_none(distance(runs[RIGID], runs[HALF_SPACE], 1, spheres)),
        "second_at": 4,  # the sphere at which the thesis sees it most
        "unmoved": UNMOVED,
        "slight": SLIGHT,
        "strong": STRONG,
    }


def _records(runs: Runs, spheres: Spheres) -> bytes:
    sets = (
        ("half-space (figure 7.13)", (HALF_SPACE, RIGID, one_dof(8425))),
        ("one mass (figure 7.14)", (one_dof(269), one_dof(907), one_dof(240))),
        ("ROM 269 (figure 7.15)", ("ROM 269", one_dof(269), one_dof(700))),
        ("ROM 907 (figure 7.16)", ("ROM 907", one_dof(907), "ROM all four")),
    )
    drawn = [
        record(f"{title}, sphere {s}", [runs[name] for name in names if name in runs], s)
        for title, names in sets
        for s in spheres
    ]
    return panels(drawn, columns=len(spheres), size=(4.6, 2.7))


def _distances(runs: Runs, spheres: Spheres) -> bytes:
    names = list(runs)
    apart = np.zeros((len(names), len(names)))
    for (i, one), (j, other) in combinations(enumerate(runs.values()), 2):
        apart[i, j] = apart[j, i] = overall(one, other, spheres)
    return matrix(apart, names, "distance over all reflected waves [-]")
