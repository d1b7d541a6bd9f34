"""Ten walls before the rig's chain, and whether the thesis' statements about them hold.

Thesis, section 7.2, figures 7.13 to 7.16. The measured waveforms are not in its text, so walls are
compared with each other, by the distances of `workflows.evidence.thesis.wave_distance`.
"""

from collections.abc import Iterator
from itertools import combinations
from math import inf, isnan

import numpy as np

from beadwave import dem
from beadwave.workflows.evidence.study import rendered
from beadwave.workflows.evidence.thesis.observed_run import (
    Observed,
    RecordOptions,
    Setup,
    observed,
    record,
    wave_cells,
    wave_columns,
)
from beadwave.workflows.evidence.thesis.requirements import require_chain, require_echo, require_rig
from beadwave.workflows.evidence.thesis.wave_distance import (
    DependenceLimits,
    distance,
    overall,
    similarity,
    spread,
)
from beadwave.workflows.files.run_folder import Picture
from beadwave.workflows.files.scene import scene as built_in
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import matrix, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import HalfSpaceWall, RigidWall, Scene
from beadwave.workflows.stages.chain import chain, initial_velocity
from beadwave.workflows.stages.pipeline import pipeline_of
from beadwave.workflows.stages.progress import Progress

ONE_DOF_HZ = (269.0, 907.0, 8425.0, 700.0, 240.0)  # thesis, sections 7.2 and 7.3
ROMS = {"ROM 269": "rig-rom-269", "ROM 907": "rig-rom-907", "ROM all four": "rig-rom"}
SHARED = ("mesh", "patch", "reduction")  # tables that reduced walls take from the user's scene
HALF_SPACE, RIGID = "half-space", "rigid"
N_WAVES = 4  # reflected waves that the thesis speaks of
NUMBERS = range(1, N_WAVES + 1)  # of reflected waves
ALIKE = (("ROM 907", 907), ("ROM 269", 700), (HALF_SPACE, 8425))  # walls that the thesis compares


def one_dof(hz: float) -> str:
    """Name of a one-mass wall."""
    return f"1-DOF {hz:g}"


def rig_walls(scene: Scene, progress: Progress) -> Iterator[Setup]:
    """All walls before the scene's chain; one-mass walls as in rig-1dof, reduced ones built in."""
    plain = chain(scene.but(wall=HalfSpaceWall(kind="half-space")))
    yield Setup(HALF_SPACE, plain, dem.rigid_wall())
    yield Setup(RIGID, chain(scene.but(wall=RigidWall(kind="rigid"))), dem.rigid_wall())
    mass = built_in("rig-1dof").wall
    for hz in ONE_DOF_HZ:
        yield Setup(one_dof(hz), plain, dem.one_dof_wall(hz, mass.mass, mass.damping_ratio))
    for name, scene_name in ROMS.items():
        # a built-in scene with the mesh, patch and reduction of this one
        reduced = built_in(scene_name)
        tables = {key: getattr(scene, key) or getattr(reduced, key) for key in SHARED}
        with progress(name):
            yield Setup(name, plain, pipeline_of(reduced.but(**tables), progress)("wall"))


def impact_run(
    scene: Scene,
    standing: Setup,
    spheres: tuple[int, ...],
    options: RecordOptions = RecordOptions(),
) -> Observed:
    """The chain against one of the walls, for the scene's duration."""
    v0, duration = initial_velocity(scene), scene.time.duration
    return observed(standing, v0, duration=duration, spheres=spheres, options=options)


MOVING = tuple(map(one_dof, (269, 907, 700, 240)))  # one-mass walls that move within the contact
FIGURES = {
    "half-space (figure 7.13)": (HALF_SPACE, RIGID, one_dof(8425)),
    "one mass (figure 7.14)": (one_dof(269), one_dof(907), one_dof(240)),
    "ROM 269 (figure 7.15)": ("ROM 269", one_dof(269), one_dof(700)),
    "ROM 907 (figure 7.16)": ("ROM 907", one_dof(907), "ROM all four"),
}


def walls(
    scene: Scene, progress: Progress, limits: DependenceLimits = DependenceLimits()
) -> Finding:
    """Waves that ten walls send back, and how far they differ (thesis, figures 7.13 to 7.16)."""
    require_rig(scene)
    spheres = tuple(sorted(require_chain(scene)))
    runs: dict[str, Observed] = {}
    for standing in rig_walls(scene, progress):
        with progress(standing.name):
            runs[standing.name] = require_echo(scene, impact_run(scene, standing, spheres))

    # when each reflected wave is at a sphere and how fast; how far every two walls differ
    arrivals = tuple(
        (sphere, name, *wave_cells(run, sphere, NUMBERS))
        for sphere in spheres
        for name, run in runs.items()
    )
    distances, all_waves = [], np.zeros((len(runs), len(runs)))
    for (i, a), (j, b) in combinations(enumerate(runs.values()), 2):
        all_waves[i, j] = all_waves[j, i] = overall(a, b, spheres)
        of_waves = [distance(a, b, k, spheres) for k in NUMBERS]
        cells = (None if isnan(value) else value for value in (*of_waves, all_waves[i, j]))
        distances.append((a.name, b.name, *cells))
    columns = ("one", "other", *(f"D{k}" for k in NUMBERS), "all")
    tables = (
        Table("walls", ("sphere", "wall", *wave_columns(NUMBERS)), arrivals),
        Table("distances", columns, tuple(distances)),
    )

    # "ROM 907 behaves like 907 Hz": its fourth wave arrives with that of this one-mass wall
    def like(name: str, hz: float):
        """How near a wall's last wave is to that of a one-mass wall, among all of these."""
        masses = tuple(map(one_dof, ONE_DOF_HZ))
        return similarity(runs, name, one_dof(hz), masses=masses, number=N_WAVES, spheres=spheres)

    # the rigid wall has another surface, and so another contact: judged by itself
    same_surface = [run for name, run in runs.items() if name != RIGID]
    waves = {}
    for k in NUMBERS:
        at_each = {sphere: spread(same_surface, k, (sphere,)) for sphere in spheres}
        by_sphere = {sphere: value for sphere, value in at_each.items() if not isnan(value)}
        at_all = spread(same_surface, k, spheres)
        waves[k] = {"distance": None if isnan(at_all) else at_all, "by_sphere": by_sphere}
    bodies = [runs[name] for name in (*MOVING, *ROMS) if name in runs]
    early = [spread(bodies, k, spheres) for k in NUMBERS[:-1]]
    rigid = distance(runs[RIGID], runs[HALF_SPACE], 1, spheres)
    sentences = rendered(
        __file__,
        n_waves=N_WAVES,
        spheres=spheres,
        early=max([0.0, *(value for value in early if not isnan(value))]),
        similarities=[like(name, hz) for name, hz in ALIKE],
        unlike=like("ROM 269", 269),
        waves=waves,
        independent=[s for s in spheres if waves[1]["by_sphere"].get(s, inf) < limits.unmoved],
        rigid=None if isnan(rigid) else rigid,
        second_at=4,  # the sphere at which the thesis sees it most
        limits=limits,
    )

    records = [
        record(f"{title}, sphere {s}", [runs[name] for name in names if name in runs], s)
        for title, names in FIGURES.items()
        for s in spheres
    ]
    over_all = "distance over all reflected waves [-]"
    pictures = (
        Picture("study_walls", panels(records, columns=len(spheres), size=(4.6, 2.7))),
        Picture("study_walls_distances", matrix(all_waves, list(runs), over_all)),
    )
    return Finding(tables, sentences, pictures)
