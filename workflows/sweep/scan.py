"""A scan: the chain at many points of a plane face, on one basis of its structure.

The errors are those of the worst point. Of the reduction that is where the waves change most when
the modes below CRUDER of the highest frequency are taken alone: there they are compared with those
of a reduction of its own. Of the mesh it is the worst of some points spread over the face, by a
scan of them on a second mesh, see `workflows.pipeline.errors`.

Rows are kept PART by PART as they are marched, with that change in the place of the error.
"""

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
from coupling.many_contacts import Walls
from coupling.sweep.rows import DONE, FAILED, REFUSED, Rows, measured, without_result
from workflows.files.run_folder import RunFolder
from workflows.pipeline.chain import Start
from workflows.pipeline.errors import MARGIN, SHORTER
from workflows.pipeline.face import Outline, Placed, StruckFace
from workflows.pipeline.rig import STRUCK
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.sweep.cases import Base
from workflows.sweep.design import Design, counted
from workflows.sweep.inputs import Inputs, files_of_scene
from workflows.sweep.march import observed, saved, taken
from workflows.sweep.store import About, Store

CRUDER = 0.75
COMPARED = 49  # points on the second mesh
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
    placed = face.placed(points)
    refused = [i for i in missing if i in placed.refused]
    if refused:
        _refuse(store, scene, REFUSED, {int(i): placed.refused[i] for i in refused})
    errors = _marched(face, points, placed, missing, store, signals, told) if placed.patches else {}
    told(design.n_cases, design.n_cases)
    store.finish(errors)
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
            observed=self.observed, n_save=self.scene.output.samples - 1,
        )  # fmt: skip

    @property
    def observed(self) -> list[int]:
        return observed(self.scene)

    def alone(self, wall: dem.Wall, dt: float) -> Array:
        """Velocities (k, spheres) behind one wall [m/s]."""
        time, n_save = self.scene.time, self.scene.output.samples - 1
        run = dem.march(
            self.begun.chain, wall, self.begun.velocity, duration=time.duration, dt=dt,
            n_save=n_save,
        )  # fmt: skip
        return run.v[:, self.observed]

    def apart(self, one: Array, other: Array) -> Array:
        """Largest difference of velocities (..., k, spheres) over the largest initial speed."""
        return np.abs(one - other).max(axis=(-2, -1)) / np.abs(self.begun.velocity).max()

    def impossible(self, wall: dem.Wall) -> dict[int, str]:
        """Walls of arrays (m, k) that the chain cannot be marched behind, and why."""
        judged = [
            coupling.verdict(self.begun.chain, _one(wall, i), self.begun.velocity)
            for i in range(len(wall.phi))
        ]
        return {i: one.findings[0] for i, one in enumerate(judged) if not one.possible}


class _Seen(NamedTuple):
    """Velocities of a point (k, spheres) and the step [s] that they were marched by."""

    i: int
    v: Array
    dt: float


def _marched(
    face: StruckFace, points: Array, placed: Placed, missing: Array, store: Store, signals: bool,
    told: Told,
) -> dict[str, float]:  # fmt: skip
    """Add the rows of the missing points with patches; the errors of all."""
    march, at = _March(face.scene, face.begun), np.array(list(placed.patches))
    compared = at[_spread(len(at))]
    own = _own(face, placed, np.intersect1d(at, np.union1d(missing, compared)))
    at, fine, crude = own.at, own.walls.all(), own.walls.all(CRUDER)
    asked = np.flatnonzero(np.isin(at, missing))
    bad = march.impossible(_some(fine, asked))
    if bad:
        _refuse(store, face.scene, FAILED, {int(at[asked[i]]): says for i, says in bad.items()})
    good = np.delete(asked, list(bad))
    for first in range(0, len(good), PART):
        part, started = good[first : first + PART], perf_counter()
        batch = march(_some(fine, part))
        if batch.refused:
            refused = {int(at[part[i]]): says for i, says in batch.refused.items()}
            _refuse(store, face.scene, FAILED, refused)
            rest = [i for i in range(len(part)) if i not in batch.refused]
            part, batch = part[rest], taken(batch, rest)
        if not len(part):
            continue
        dt, cruder = np.broadcast_to(batch.dt, len(part)), np.empty_like(batch.v)
        for step in np.unique(dt):  # by the same steps, whose error cancels
            alike = dt == step
            cruder[alike] = march(_some(crude, part[alike]), float(step)).v
        change = march.apart(cruder, batch.v)
        seconds = (perf_counter() - started) / len(part)
        store.add(_table(march.scene, at[part], batch, change, seconds, signals))
        told(len(points) - len(good) + first + len(part), len(points))
    return _errors(face, points, placed, store, march, own, compared)


class _Own(NamedTuple):
    """Points with walls that this process has made."""

    at: Array
    walls: Walls


def _own(face: StruckFace, placed: Placed, at: Array) -> _Own:
    return _Own(at, face.walls([placed.patches[i] for i in at]))


def _errors(
    face: StruckFace, points: Array, placed: Placed, store: Store, march: _March, own: _Own,
    compared: Array,
) -> dict[str, float]:  # fmt: skip
    """Of the reduction at the worst of the points whose rows are there, of the mesh at those that
    are compared."""
    rows = store.rows("case", "status", "error_reduction", "dt_s")
    order = np.argsort(rows["case"])
    order = order[rows["status"][order] == DONE]
    if not len(order):
        return {}
    case, change, dt = (rows[name][order] for name in ("case", "error_reduction", "dt_s"))
    worst = case[[change.argmax()]]
    there = own if worst in own.at else _own(face, placed, worst)
    (one,) = _seen(march, there, worst, dt[case == worst])
    off = march.apart(march.alone(there.walls.finer(one.i), one.dt / SHORTER), one.v)
    picked = np.isin(case, compared)
    mesh = _mesh_error(face, points[own.at], _seen(march, own, case[picked], dt[picked]))
    return {"error_reduction": float(MARGIN * off), "error_mesh": float(mesh)}


def _seen(march: _March, of: _Own, cases: Array, dt: Array) -> list[_Seen]:
    """Points marched again by their steps (m,) [s], those of one step side by side."""
    found: dict[int, _Seen] = {}
    places, wall = np.searchsorted(of.at, cases), of.walls.all()
    for step in np.unique(dt):
        own = np.flatnonzero(dt == step)
        each = march(_some(wall, places[own]), float(step)).v
        found |= {j: _Seen(places[j], v, float(step)) for j, v in zip(own, each, strict=True)}
    return [found[j] for j in range(len(dt))]


def _spread(n: int) -> Array:
    """Places of up to COMPARED points among n."""
    return np.unique(np.linspace(0, n - 1, COMPARED).astype(int))


def _mesh_error(face: StruckFace, points: Array, seen: list[_Seen]) -> float:
    """The largest at some of the points; NaN for a mesh that no other one tells it of."""
    if not seen:
        return np.nan
    try:
        second, left = face.second()
    except ValueError:
        return np.nan
    march = _March(face.scene, face.begun)
    patches = second.placed(points[[one.i for one in seen]]).patches
    wall = second.walls(list(patches.values())).all()
    there = [seen[i] for i in patches]
    off = [march.apart(march.alone(_one(wall, j), s.dt), s.v) for j, s in enumerate(there)]
    return left * max(off, default=np.nan)


def _table(
    scene: Scene, cases: Array, batch: dem.Batch, change: Array, seconds: float, signals: bool
) -> Rows:
    estimate = np.nan if batch.error_estimate is None else batch.error_estimate
    table = measured(
        scene.output.spheres, batch.t, batch.v, batch.wall_force,
        energy_error=batch.energy_error, error_time=estimate, error_reduction=change,
        dt_s=batch.dt, steps=batch.n_steps, seconds=seconds,
    )  # fmt: skip
    return Rows(tuple(cases.tolist()), table, saved(scene, batch) if signals else None)


def _some(wall: dem.Wall, rows: Array) -> dem.Wall:
    """Walls of arrays (p, k) at some of the points."""
    return dem.Wall(*(part[rows] for part in wall[:4]), wall.mobility)


def _one(wall: dem.Wall, i: int) -> dem.Wall:
    part = _some(wall, i)
    return part._replace(residual_compliance=float(part.residual_compliance))
