"""A scan: the chain at many points of a plane face, on one basis of its structure.

Every point has its own errors, measured as a run of it measures them
(`workflows.stages.errors.better_walls`): that of the reduction against a wall with more oscillators
of the point beyond the common modes, by shorter steps; that of the mesh against the same point
without the strain energy that the mesh misses, of a mesh of few elements against the same point on
one whose every element is split.

Rows are stored PART by PART as they are marched. Once all are stored, later reflected waves are
blanked, so that one wave is left over the face, see `workflows.sweep.core.continuity`.
"""

from collections.abc import Callable
from itertools import product
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave import coupling, dem
from beadwave.dem.waves.arrivals import arrivals
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.scene import InvalidScene, RomWall, Scene
from beadwave.workflows.scene.rig import STRUCK, RigScene
from beadwave.workflows.scene.toml import undoes
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.walls import require_support
from beadwave.workflows.stages.errors.better_walls import MARGIN, SHORTER
from beadwave.workflows.stages.structure.face import StruckFace, to_hz
from beadwave.workflows.sweep.cases import Base, watched
from beadwave.workflows.sweep.core.case_row import (
    FAILED,
    LARGE_ERROR,
    REFUSED,
    Rows,
    measured,
    other_wave,
    without_result,
)
from beadwave.workflows.sweep.core.continuity import same_wave
from beadwave.workflows.sweep.design_words import Design, counted
from beadwave.workflows.sweep.inputs import Inputs, files_of_scene
from beadwave.workflows.sweep.marched_group import observed, saved, taken
from beadwave.workflows.sweep.store import About, Store

OF_REFLECTED = ("reflected_s", "reflected_m_s", "echo_delay_s", "echo_ratio")
PART = 200  # points side by side, whose rows are stored together: what a stopped scan loses
MOST_POINTS = 10_000
Array = NDArray[np.float64]
Progress = Callable[[int, int], None]  # points done, points in all


# Reduction of the walls of a scan, and its waves
# oscillators of a point beyond the common modes: with 1, 2, 3, 4 and 6 the velocities of
# spheres of 6 mm that strike a 4 mm plate are off by up to 3e-3, 1e-3, 5e-4, 1e-4 and 8e-5;
# those before `plate-on-bolts` by 2e-4 with any
N_BEYOND = 3
N_FINER = 5  # the same, of the wall that the error of the reduction is measured against
# times the frequency that errors hold to, above which these are one: without, blocks take 8 and
# plates up to 4 times the steps; errors are 1.2 times as large, or below 2e-5
FAR_FREQUENCY = 4.0
# of the march that the width of a wave is read from: a bound of the error of velocities, and
# samples; not varied
WIDTH_ERROR = 1e-3
WIDTH_SAMPLES = 2000


class Grid(NamedTuple):
    """Points of a scan over a face, along its two axes."""

    rows: int
    columns: int

    def design(self, struck: StruckFace) -> Design:
        """Even points whose patches lie between the edges of a face; raises InvalidScene for one
        that is too narrow."""
        face, radius = struck.outline(), struck.scene.strike.radius
        room = face.upper - face.lower - 2 * radius
        if (room < 0).any():
            raise InvalidScene(
                f"the face is {np.ptp([face.lower, face.upper], axis=0).min():g} m wide, a patch "
                f"of radius = {radius:g} m takes {2 * radius:g}; take a smaller patch."
            )
        ends = np.stack([face.lower, face.upper]) + np.array([[radius], [-radius]])
        # mirrored about the middle to the last digit
        across = []
        for (low, high), n in zip(ends.T, self, strict=True):
            share = (2.0 * np.arange(n) - (n - 1)) / max(n - 1, 1)
            across.append((low + high) / 2 + share * (high - low) / 2)
        points = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1).reshape(-1, 2)
        columns = zip(face.axes, points.T.tolist(), strict=True)
        return Design("face", {axis: tuple(values) for axis, values in columns})


def grid(text: str) -> Grid:
    """The grid of "20x20"; raises InvalidScene."""
    counts = [counted(n, MOST_POINTS) for n in text.lower().split("x")]
    if len(counts) != 2 or None in counts:
        raise InvalidScene(
            f"--grid {text!r} must be two whole numbers from 1 to {MOST_POINTS}, 20x20 for example."
        )
    rows, columns = counts
    if rows * columns > MOST_POINTS:
        raise InvalidScene(
            f"--grid {text} has {rows * columns} points, allowed are {MOST_POINTS}; take fewer."
        )
    return Grid(rows, columns)


def struck_scene(base: Base, face: str | None) -> Scene:
    """The scene with a face struck in its middle; raises InvalidScene where no scan can be."""
    scene = base.with_values({})
    reduced = isinstance(scene.wall, RomWall) and scene.wall.file is None
    if not (scene.chain and scene.assembly and reduced):
        raise InvalidScene(
            f'{scene.name}: a scan moves the chain over an assembly; take wall.kind = "rom" '
            "with [assembly] and no wall.file."
        )
    if scene.time.duration > scene.time.horizon:
        raise InvalidScene(
            f"{scene.name}: time.duration = {scene.time.duration:g} s goes beyond time.horizon = "
            f"{scene.time.horizon:g} s, up to which waves have an error; scan up to there."
        )
    rig = isinstance(scene, RigScene)
    moved = ("patch.point",) if rig else ("strike.at", "strike.on")[: 1 + bool(face)]
    for key, changed_key in product(moved, base.given):
        if undoes(key, changed_key):
            raise InvalidScene(f"a scan sets {key} itself; drop --set {changed_key}.")
    if not rig:
        on = face or (scene.strike and scene.strike.on)
        return base.with_values(({"strike.on": on} if on else {}) | {"strike.at": [0.0, 0.0]})
    if face not in (None, STRUCK):
        raise InvalidScene(f"--face {face}: the rig is struck on {STRUCK}; leave it out.")
    return base.with_values({"patch.point": [0.0, 0.0]})


def scan(
    face: StruckFace, design: Design, folder: RunFolder, *, signals: bool, progress: Progress,
    ) -> tuple[str, ...]:  # fmt: skip
    """Fill the folder with the table of all points and return notes for the user, in sentences;
    rows of an earlier scan of these points stay.

    Raises InvalidScene where the structure floats under a steady force, ValueError where a file
    changes meanwhile.
    """
    scene, outline = face.scene, face.outline()
    of_rows = watched(scene)
    name = scene.strike.on
    plain = {"name": name, "axes": outline.axes, "edges": outline.edges.tolist()}
    about = About(dict.fromkeys(design.keys, "m"), plain)
    store = Store(folder, design, scene, signals, Inputs(files_of_scene(scene)), about)
    notes = store.notes()
    if store.finished():
        store.keep()
        progress(design.n_cases, design.n_cases)
        return notes
    missing = np.array(store.missing(), int)
    progress(design.n_cases - len(missing), design.n_cases)

    # a patch at every missing point; those that leave the face are rows with their sentence
    points = np.array(list(design.columns.values())).T
    placed, refused = face.placed(points[missing])
    patches = {int(missing[i]): patch for i, patch in placed.items()}
    if refused:
        cases = tuple(int(missing[i]) for i in refused)
        store.add(without_result(of_rows, cases, REFUSED, list(refused.values())))

    if patches:
        # all walls at once: they share the modes of the structure
        march, cases = _March(scene, face.begun), np.array(list(patches))
        walls = face.walls(list(patches.values()), N_FINER)
        wall = walls.all(N_BEYOND, FAR_FREQUENCY * to_hz(scene))
        require_support(scene, wall)
        finer = walls.all(N_FINER)
        impossible = march.impossible(wall)
        if impossible:
            failed = tuple(cases[list(impossible)].tolist())
            store.add(without_result(of_rows, failed, FAILED, list(impossible.values())))
        possible = np.delete(np.arange(len(cases)), list(impossible))
        if face.few_elements:
            other = _on_split_mesh(face, march, points[cases])
        else:
            softer = face.without_missed_energy(wall, list(patches.values()))
            other = _OtherWalls(softer, np.arange(len(cases)), 1.0, {})

    # part by part: march, errors, rows on disk, so that a scan that is stopped goes on from there
    for first in range(0, len(possible) if patches else 0, PART):
        part, started = possible[first : first + PART], perf_counter()
        batch = march(_some(wall, part))
        if batch.refused:
            failed = tuple(cases[part[list(batch.refused)]].tolist())
            store.add(without_result(of_rows, failed, FAILED, list(batch.refused.values())))
            marched = [i for i in range(len(part)) if i not in batch.refused]
            part, batch = part[marched], taken(batch, marched)
        if not len(part):
            continue

        # the error of the reduction by a wall of more oscillators and shorter steps, that of the
        # mesh by the other wall of the same point
        dt = np.broadcast_to(batch.dt, len(part))
        v_finer = march.by_steps(_some(finer, part), dt / SHORTER)
        error_reduction = MARGIN * march.difference(v_finer, batch.v)
        error_mesh = np.full(len(part), np.nan)
        known = np.flatnonzero(other.row[part] >= 0)
        if len(known):
            v = march.by_steps(_some(other.wall, other.row[part[known]]), dt[known])
            error_mesh[known] = other.share * march.difference(v, batch.v[known])

        # a row with what is doubtful about it
        messages = []
        for case, *errors in zip(part.tolist(), error_reduction, error_mesh, strict=True):
            sentences = [
                f"the error of the {source} is {100 * error:.2g} % of the striker's speed"
                for source, error in zip(("reduction", "mesh"), errors, strict=True)
                if error > LARGE_ERROR
            ]
            messages.append("; ".join([*sentences, *other.without.get(case, ())]))
        table = measured(
            of_rows, batch.t, batch.v, batch.wall_force[:, :, None],
            energy_error=batch.energy_error,
            error_time=np.nan if batch.error_estimate is None else batch.error_estimate,
            error_reduction=error_reduction, error_mesh=error_mesh, dt_s=batch.dt,
            steps=batch.n_steps, seconds=(perf_counter() - started) / len(part), message=messages,
        )  # fmt: skip
        series = saved(scene, batch) if signals else None
        store.add(Rows(tuple(cases[part].tolist()), table, series))
        progress(len(points) - len(possible) + first + len(part), len(points))

    progress(design.n_cases, design.n_cases)
    store.finish(_one_reflected_wave(face, points, store))
    return notes


class _March(NamedTuple):
    """Marches of one scene's chain behind many walls."""

    scene: Scene
    at_rest: Start

    def __call__(self, wall: dem.Wall, dt: float | None = None) -> dem.Batch:
        """Behind walls of arrays (m, k), by steps of dt [s], else to the scene's error."""
        time = self.scene.time
        dt = time.dt if dt is None else dt
        return dem.march_batch(
            dem.Chains(self.at_rest.chain, wall, self.at_rest.velocity),
            duration=time.duration, dt=dt, error=time.error if dt is None else None,
            observed=observed(self.scene), n_save=self.scene.output.samples - 1,
        )  # fmt: skip

    def by_steps(self, wall: dem.Wall, dt: Array) -> Array:
        """Velocities (m, k, spheres) behind walls of arrays (m, k), each by its own dt (m,) [s];
        those of equal steps side by side."""
        v = np.empty((len(dt), self.scene.output.samples, len(observed(self.scene))))
        for step in np.unique(dt):
            alike = np.flatnonzero(dt == step)
            v[alike] = self(_some(wall, alike), float(step)).v
        return v

    def difference(self, v: Array, reference: Array) -> Array:
        """Largest difference of velocities (m, k, spheres) over the largest initial speed, (m,)."""
        return np.abs(v - reference).max(axis=(-2, -1)) / np.abs(self.at_rest.velocity).max()

    def impossible(self, walls: dem.Wall) -> dict[int, str]:
        """Walls of arrays (m, k) that the chain cannot be marched behind, and why."""
        reasons = {}
        for i in range(len(walls.phi)):
            wall = _some(walls, i)
            wall = wall._replace(residual_compliance=float(wall.residual_compliance))
            verdict = coupling.verdict(self.at_rest.chain, wall, self.at_rest.velocity)
            if not verdict.possible:
                reasons[i] = verdict.findings[0]
        return reasons


class _OtherWalls(NamedTuple):
    """Walls that show what the mesh does to those of the scan.

    wall     of the points that have one
    row      (p,) of each point in the wall's arrays, -1 for one that has none
    share    of the difference to it that is the error of the scan's own mesh
    without  why points have none
    """

    wall: dem.Wall | None
    row: NDArray[np.int64]
    share: float
    without: dict[int, tuple[str]]


def _on_split_mesh(face: StruckFace, march: _March, points: Array) -> _OtherWalls:
    """Walls at points (p, 2) of the face on a mesh whose every element is split."""
    row = np.full(len(points), -1)
    split, share = face.split()
    patches, without = split.placed(points)
    wall = None
    if patches:
        walls = split.walls(list(patches.values()), N_BEYOND)
        wall = walls.all(N_BEYOND, FAR_FREQUENCY * to_hz(face.scene))
        impossible, at = march.impossible(wall), np.array(list(patches))
        without = without | {int(at[i]): reason for i, reason in impossible.items()}
        row[at] = np.arange(len(at))
        row[at[list(impossible)]] = -1
    messages = {i: (f"error_mesh is not known: {reason}",) for i, reason in without.items()}
    return _OtherWalls(wall, row, share, messages)


def _some(wall: dem.Wall, rows: Array | int) -> dem.Wall:
    """Walls of arrays (p, k) at these rows."""
    return dem.Wall(*(array[rows] for array in wall[:4]), wall.mobility)


def _one_reflected_wave(face: StruckFace, points: Array, store: Store) -> dict[str, Any]:
    """Columns (n_cases,) of the table in which each sphere has the same reflected wave at all
    points, or none, and the messages of points that have none for that."""
    spheres = face.scene.output.spheres
    names = {sphere: [f"sphere_{sphere}_{name}" for name in OF_REFLECTED] for sphere in spheres}
    rows = store.rows("case", "message", *(name for group in names.values() for name in group))
    order = np.argsort(rows.pop("case"))
    columns = {name: values[order] for name, values in rows.items()}

    # counted along the grid, not in metres: neighbours are a step apart in both directions
    steps = np.column_stack([np.unique(axis, return_inverse=True)[1] for axis in points.T])

    # full width at half maximum [s] of the first wave at each sphere, before a rigid wall: the
    # incident wave does not depend on the wall. The striker has none: its width is that at the next
    # sphere
    scene, at_rest = face.scene, face.begun
    run = dem.march_to_error(
        at_rest.chain, dem.rigid_wall(), at_rest.velocity, duration=scene.time.duration,
        error=WIDTH_ERROR, n_save=WIDTH_SAMPLES,
    ).trajectory  # fmt: skip
    widths, width = {}, np.inf
    for sphere in range(scene.chain.count, 0, -1):
        waves = arrivals(run.t, run.v[:, sphere - 1])
        of_incident = (wave.width for wave in waves if wave.peak_velocity > 0)
        width = next((value for value in of_incident if np.isfinite(value)), width)
        widths[sphere] = width

    for sphere, of_wave in names.items():
        time = columns[of_wave[0]]
        blank = np.isfinite(time) & ~same_wave(steps, time, widths[sphere])
        for name in of_wave:
            columns[name] = np.where(blank, np.nan, columns[name])
        reason = other_wave(sphere)
        columns["message"] = [
            "; ".join(filter(None, (message, reason if is_blank else "")))
            for message, is_blank in zip(columns["message"], blank, strict=True)
        ]
    return columns
