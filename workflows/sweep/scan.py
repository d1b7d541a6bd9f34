"""A scan: the chain at many points of a plane face, on one basis of its structure.

Every point has its own errors, measured as a run of it measures them (`workflows.stages.errors`):
that of the reduction against a wall with more oscillators of the point beyond the common modes, by
shorter steps; that of the mesh against the same point on a second mesh.

Rows are kept PART by PART as they are marched. Once all are there, the reflected waves are made one
wave over the face, see `workflows.sweep.core.continuity`.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
import fem
from dem.waves.arrivals import arrivals
from workflows.files.run_folder import RunFolder
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.scene.toml import undoes
from workflows.stages.chain import Start
from workflows.stages.errors import MARGIN, SHORTER
from workflows.stages.face import Outline, StruckFace, to_hz
from workflows.stages.rig import STRUCK
from workflows.sweep.cases import Base
from workflows.sweep.core.continuity import same_wave
from workflows.sweep.core.rows import (
    FAILED,
    LARGE_ERROR,
    REFUSED,
    Rows,
    measured,
    other_wave,
    without_result,
)
from workflows.sweep.design import Design, counted
from workflows.sweep.inputs import Inputs, files_of_scene
from workflows.sweep.march import observed, saved, taken
from workflows.sweep.store import About, Store

# Oscillators of a point beyond the common modes: with 1, 2, 3, 4 and 6 the velocities of spheres of
# 6 mm that strike a 4 mm plate are off by up to 3e-3, 1e-3, 5e-4, 1e-4 and 8e-5; those before
# `plate-on-bolts` by 2e-4 with any.
BEYOND, FINER = 3, 5
# Times the frequency that errors hold to, above which these are one. Without, blocks take 8 and
# plates up to 4 times the steps; errors are 1.2 times as large, or below 2e-5.
FAR = 4.0
WIDTH_ERROR, WIDTH_SAMPLES = 1e-3, 2000  # of the march that the width of a wave is read from
OF_REFLECTED = ("reflected_s", "reflected_m_s", "tof_s", "arr")
PART = 200  # points side by side, whose rows are kept together
MOST_POINTS = 10_000
Array = NDArray[np.float64]
Told = Callable[[int, int], None]  # points done, points in all


class Grid(NamedTuple):
    """Points of a scan over a face, along its two axes."""

    rows: int
    columns: int

    def design(self, struck: StruckFace) -> Design:
        """Even points whose patches lie between the edges of a face; raises InvalidScene for one
        that is too narrow."""
        face, radius = struck.outline(), struck.patch.radius
        room = face.upper - face.lower - 2 * radius
        if (room < 0).any():
            raise InvalidScene(
                f"the face is {np.ptp([face.lower, face.upper], axis=0).min():g} m wide, a patch "
                f"of radius = {radius:g} m takes {2 * radius:g}; take a smaller patch."
            )
        ends = np.stack([face.lower, face.upper]) + np.array([[radius], [-radius]])
        across = (_even(*ends[:, i], n) for i, n in enumerate(self))
        points = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1).reshape(-1, 2)
        columns = zip(face.axes, points.T.tolist(), strict=True)
        return Design("face", {axis: tuple(values) for axis, values in columns})


def _even(low: float, high: float, n: int) -> Array:
    """n points, mirrored about the middle to the last digit."""
    share = (2.0 * np.arange(n) - (n - 1)) / max(n - 1, 1)
    return (low + high) / 2 + share * (high - low) / 2


def grid(text: str) -> Grid:
    """The grid of "20x20"; raises InvalidScene."""
    counts = [counted(n, MOST_POINTS) for n in text.lower().split("x")]
    if len(counts) != 2 or None in counts:
        raise InvalidScene(
            f"--grid {text!r} must be two whole numbers from 1 to {MOST_POINTS}, 20x20 for example."
        )
    found = Grid(*counts)
    if found.rows * found.columns > MOST_POINTS:
        raise InvalidScene(
            f"--grid {text} has {found.rows * found.columns} points, allowed are {MOST_POINTS}; "
            "take fewer."
        )
    return found


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
    moved = ("strike.at", "strike.on")[: 1 + bool(face)] if scene.is_general else ("patch.point",)
    for key, given in product(moved, base.given):
        if undoes(key, given):
            raise InvalidScene(f"a scan sets {key} itself; drop --set {given}.")
    if scene.is_general:
        on = face or (scene.strike and scene.strike.on)
        return base.with_values(({"strike.on": on} if on else {}) | {"strike.at": [0.0, 0.0]})
    if face not in (None, STRUCK):
        raise InvalidScene(f"--face {face}: the rig is struck on {STRUCK}; leave it out.")
    return base.with_values({"patch.point": [0.0, 0.0]})


def scan(
    face: StruckFace, design: Design, folder: RunFolder, *, signals: bool, told: Told
) -> tuple[str, ...]:
    """Fill the folder with the table of all points; one that is there already is kept. What the
    user is to know, in sentences."""
    scene, outline = face.scene, face.outline()
    name = scene.strike.on if scene.is_general else face.name
    about = About(dict.fromkeys(design.keys, "m"), {"name": name, **_plain(outline)})
    store = Store(folder, design, scene, signals, Inputs(files_of_scene(scene), __name__), about)
    notes = store.notes()
    if store.whole():
        store.keep()
        told(design.n_cases, design.n_cases)
        return notes
    missing = np.array(store.missing(), int)
    told(design.n_cases - len(missing), design.n_cases)
    points = np.array(list(design.columns.values())).T
    placed = face.placed(points[missing])
    patches = {int(missing[i]): patch for i, patch in placed.patches.items()}
    refused = {int(missing[i]): sentence for i, sentence in placed.refused.items()}
    if refused:
        _refuse(store, scene, REFUSED, refused)
    if patches:
        _march_points(face, points, patches, store, signals, told)
    told(design.n_cases, design.n_cases)
    store.finish(_one_wave(face, points, store))
    return notes


def _refuse(store: Store, scene: Scene, status: str, sentences: dict[int, str]) -> None:
    cases = tuple(sentences)
    store.add(without_result(scene.output.spheres, cases, status, list(sentences.values())))


def _plain(outline: Outline) -> dict[str, Any]:
    return {"axes": outline.axes, "edges": outline.edges.tolist()}


class _March(NamedTuple):
    """Marches of one scene's chain behind many walls, and what is wanted of them."""

    scene: Scene
    begun: Start

    def __call__(self, wall: dem.Wall, dt: float | None = None) -> dem.Batch:
        """Behind walls of arrays (m, k), by steps of dt [s], else to the scene's error."""
        time = self.scene.time
        dt = time.dt if dt is None else dt
        return dem.march_batch(
            dem.Chains(self.begun.chain, wall, self.begun.velocity),
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

    def apart(self, one: Array, other: Array) -> Array:
        """Largest difference of velocities (m, k, spheres) over the largest initial speed, (m,)."""
        return np.abs(one - other).max(axis=(-2, -1)) / np.abs(self.begun.velocity).max()

    def impossible(self, wall: dem.Wall) -> dict[int, str]:
        """Walls of arrays (m, k) that the chain cannot be marched behind, and why."""
        judged = [
            coupling.verdict(self.begun.chain, _one(wall, i), self.begun.velocity)
            for i in range(len(wall.phi))
        ]
        return {i: one.findings[0] for i, one in enumerate(judged) if not one.possible}


def _march_points(
    face: StruckFace, points: Array, patches: dict[int, fem.ContactPatch], store: Store,
    signals: bool, told: Told,
) -> None:  # fmt: skip
    """Add the rows of the points that patches lie at."""
    march, cases = _March(face.scene, face.begun), np.array(list(patches))
    walls = face.walls(list(patches.values()), FINER)
    far_hz = FAR * to_hz(face.scene)
    wall, finer = walls.all(BEYOND, far_hz), walls.all(FINER)
    bad = march.impossible(wall)
    if bad:
        _refuse(store, face.scene, FAILED, {int(cases[i]): says for i, says in bad.items()})
    good = np.delete(np.arange(len(cases)), list(bad))
    second = _on_second_mesh(face, march, points[cases])
    for first in range(0, len(good), PART):
        part, started = good[first : first + PART], perf_counter()
        batch = march(_some(wall, part))
        if batch.refused:
            _refuse(
                store, face.scene, FAILED,
                {int(cases[part[i]]): says for i, says in batch.refused.items()},
            )  # fmt: skip
            met = [i for i in range(len(part)) if i not in batch.refused]
            part, batch = part[met], taken(batch, met)
        if not len(part):
            continue
        dt = np.broadcast_to(batch.dt, len(part))
        of_finer = march.by_steps(_some(finer, part), dt / SHORTER)
        errors = {
            "error_reduction": MARGIN * march.apart(of_finer, batch.v),
            "error_mesh": np.full(len(part), np.nan),
        }
        there = np.flatnonzero(second.row[part] >= 0)
        if len(there):
            other = march.by_steps(_some(second.wall, second.row[part[there]]), dt[there])
            errors["error_mesh"][there] = second.left * march.apart(other, batch.v[there])
        messages = [
            "; ".join([*large_errors(errors, i), *second.without.get(case, ())])
            for i, case in enumerate(part.tolist())
        ]
        seconds = (perf_counter() - started) / len(part)
        estimate = np.nan if batch.error_estimate is None else batch.error_estimate
        table = measured(
            march.scene.output.spheres, batch.t, batch.v, batch.wall_force,
            energy_error=batch.energy_error, error_time=estimate, **errors, dt_s=batch.dt,
            steps=batch.n_steps, seconds=seconds, message=messages,
        )  # fmt: skip
        kept = saved(march.scene, batch) if signals else None
        store.add(Rows(tuple(cases[part].tolist()), table, kept))
        told(len(points) - len(good) + first + len(part), len(points))


class _SecondMesh(NamedTuple):
    """Points on a second mesh.

    wall     of the points that have one there
    row      (p,) of each point in the wall's arrays, -1 for one that has none
    left     how much of the difference to it is the error of the scan's own mesh
    without  why points have none
    """

    wall: dem.Wall | None
    row: NDArray[np.int64]
    left: float
    without: dict[int, tuple[str]]


def _on_second_mesh(face: StruckFace, march: _March, points: Array) -> _SecondMesh:
    """Walls at points (p, 2) of the face on another mesh."""
    row = np.full(len(points), -1)
    try:
        second, left = face.second()
    except ValueError as reason:
        says = (f"error_mesh is not known: {reason}",)
        return _SecondMesh(None, row, np.nan, dict.fromkeys(range(len(points)), says))
    placed = second.placed(points)
    without = placed.refused
    wall = None
    if placed.patches:
        walls = second.walls(list(placed.patches.values()), BEYOND)
        wall = walls.all(BEYOND, FAR * to_hz(face.scene))
        bad, at = march.impossible(wall), np.array(list(placed.patches))
        without = without | {int(at[i]): says for i, says in bad.items()}
        row[at] = np.arange(len(at))
        row[at[list(bad)]] = -1
    sentences = {i: (f"error_mesh is not known: {says}",) for i, says in without.items()}
    return _SecondMesh(wall, row, left, sentences)


def large_errors(errors: Mapping[str, Array], i: int) -> Iterator[str]:
    """Of a row, in percent of the striker's speed."""
    for name, values in errors.items():
        if values[i] > LARGE_ERROR:
            of = name.removeprefix("error_")
            yield f"the error of the {of} is {100 * values[i]:.2g} % of the striker's speed"


def _some(wall: dem.Wall, rows: Array) -> dem.Wall:
    """Walls of arrays (p, k) at some of the points."""
    return dem.Wall(*(part[rows] for part in wall[:4]), wall.mobility)


def _one(wall: dem.Wall, i: int) -> dem.Wall:
    part = _some(wall, i)
    return part._replace(residual_compliance=float(part.residual_compliance))


def _one_wave(face: StruckFace, points: Array, store: Store) -> dict[str, Any]:
    """Columns (n_cases,) of the table in which each sphere has the same reflected wave at all
    points, or none, and the messages of points that have none for that."""
    spheres = face.scene.output.spheres
    names = {sphere: [f"sphere_{sphere}_{name}" for name in OF_REFLECTED] for sphere in spheres}
    read = store.rows("case", "message", *(name for each in names.values() for name in each))
    order = np.argsort(read.pop("case"))
    columns = {name: values[order] for name, values in read.items()}
    steps = np.column_stack([np.unique(axis, return_inverse=True)[1] for axis in points.T])
    widths = _incident_widths(face)
    for sphere, own in names.items():
        time = columns[own[0]]
        other = np.isfinite(time) & ~same_wave(steps, time, widths[sphere])
        for name in own:
            columns[name] = np.where(other, np.nan, columns[name])
        says = other_wave(sphere)
        columns["message"] = [
            "; ".join(filter(None, (message, says if blank else "")))
            for message, blank in zip(columns["message"], other, strict=True)
        ]
    return columns


def _incident_widths(face: StruckFace) -> dict[int, float]:
    """Full width at half maximum [s] of the first wave at each sphere, before a rigid wall: the
    incident one knows of no wall."""
    scene, begun = face.scene, face.begun
    run = dem.march_to_error(
        begun.chain, dem.rigid_wall(), begun.velocity, duration=scene.time.duration,
        error=WIDTH_ERROR, n_save=WIDTH_SAMPLES,
    ).trajectory  # fmt: skip
    # the striker has no incident wave: its width is that at the next sphere
    widths, width = {}, np.inf
    for sphere in range(scene.chain.count, 0, -1):
        waves = arrivals(run.t, run.v[:, sphere - 1])
        found = (wave.width for wave in waves if wave.peak_velocity > 0)
        width = next((own for own in found if np.isfinite(own)), width)
        widths[sphere] = width
    return widths
