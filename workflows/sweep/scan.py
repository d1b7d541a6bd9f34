"""A scan: the chain at many points of a plane face, on one basis of its structure.

The errors are those of the worst point. Of the reduction that is where the waves change most when
the modes below CRUDER of the highest frequency are taken alone: there they are compared with those
of a reduction of its own. Of the mesh it is the worst of some points spread over the face, by a
scan of them on a second mesh, see `workflows.pipeline.errors`.
"""

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import coupling
import dem
from coupling.sweep.rows import FAILED, REFUSED, Rows, measured, without_result
from workflows.files.run_folder import RunFolder
from workflows.pipeline.chain import Start
from workflows.pipeline.errors import MARGIN, SHORTER
from workflows.pipeline.face import Outline, Placed, StruckFace
from workflows.pipeline.rig import STRUCK
from workflows.scene import InvalidScene, RomWall, Scene
from workflows.sweep.cases import Base
from workflows.sweep.design import Design
from workflows.sweep.march import observed, saved
from workflows.sweep.store import About, Store
from workflows.sweep.tasks import CHUNK

CRUDER = 0.75
COMPARED = 49  # points on the second mesh
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
    counts = text.lower().split("x")
    if len(counts) != 2 or not all(n.strip().isdecimal() and int(n) > 0 for n in counts):
        raise InvalidScene(f"--grid {text!r} must be two whole numbers above 0, 20x20 for example.")
    found = Grid(*map(int, counts))
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


def scan(face: StruckFace, design: Design, folder: RunFolder, *, signals: bool, told: Told) -> None:
    """Fill the folder with the table of all points; one that is there already is kept."""
    scene, outline = face.scene, face.outline()
    name = scene.strike.on if scene.is_general else face.name
    about = About(dict.fromkeys(design.keys, "m"), {"name": name, **_plain(outline)})
    store = Store(folder, design, scene, signals, about)
    if store.whole():
        store.keep()
        told(design.n_cases, design.n_cases)
        return
    points = np.array(list(design.columns.values())).T
    placed = face.placed(points)
    refused = tuple(placed.refused)
    if refused:
        sentences = list(placed.refused.values())
        store.add(without_result(scene.output.spheres, refused, REFUSED, sentences))
    told(len(refused), design.n_cases)
    if placed.patches:
        for rows in _rows(face, placed, points, signals):
            store.add(rows)
    told(design.n_cases, design.n_cases)
    store.finish()


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


def _rows(face: StruckFace, placed: Placed, points: Array, signals: bool) -> list[Rows]:
    """Rows of the points with patches."""
    march = _March(face.scene, face.begun)
    at = np.array(list(placed.patches))
    walls = face.walls(list(placed.patches.values()))
    fine, crude = walls.all(), walls.all(CRUDER)
    bad = march.impossible(fine)
    cases, sentences = tuple(at[list(bad)].tolist()), list(bad.values())
    found = [without_result(face.scene.output.spheres, cases, FAILED, sentences)] if bad else []
    good, done, worst, seen = np.setdiff1d(np.arange(len(at)), list(bad)), [], [], []
    for part in np.split(good, range(CHUNK, len(good), CHUNK)):
        started = perf_counter()
        batch = march(_some(fine, part))
        change = march.apart(march(_some(crude, part), batch.dt).v, batch.v)
        j = int(change.argmax())
        worst.append((change[j], _Seen(part[j], batch.v[j].copy(), batch.dt)))
        seen += [_Seen(part[j], batch.v[j].copy(), batch.dt) for j in _spread(len(part))]
        seconds = (perf_counter() - started) / len(part)
        done.append(_table(march.scene, at[part], batch, seconds, signals))
    _, one = max(worst, key=lambda each: each[0])
    off = march.apart(march.alone(walls.finer(one.i), one.dt / SHORTER), one.v)
    errors = {"error_reduction": MARGIN * off, "error_mesh": _mesh_error(face, points[at], seen)}
    for rows in done:
        rows.columns.update({name: [float(e)] * len(rows.cases) for name, e in errors.items()})
    return found + done


def _spread(n: int) -> Array:
    """Places of up to COMPARED points among n."""
    return np.unique(np.linspace(0, n - 1, COMPARED).astype(int))


def _mesh_error(face: StruckFace, points: Array, seen: list[_Seen]) -> float:
    """The largest at some of the points; NaN for a mesh that no other one tells it of."""
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


def _table(scene: Scene, cases: Array, batch: dem.Batch, seconds: float, signals: bool) -> Rows:
    estimate = np.nan if batch.error_estimate is None else batch.error_estimate
    table = measured(
        scene.output.spheres, batch.t, batch.v, batch.wall_force,
        energy_error=batch.energy_error, error_time=estimate,
        dt_s=batch.dt, steps=batch.n_steps, seconds=seconds,
    )  # fmt: skip
    return Rows(tuple(cases.tolist()), table, saved(scene, batch) if signals else None)


def _some(wall: dem.Wall, rows: Array) -> dem.Wall:
    """Walls of arrays (p, k) at some of the points."""
    return dem.Wall(*(part[rows] for part in wall[:4]), wall.mobility)


def _one(wall: dem.Wall, i: int) -> dem.Wall:
    part = _some(wall, i)
    return part._replace(residual_compliance=float(part.residual_compliance))
