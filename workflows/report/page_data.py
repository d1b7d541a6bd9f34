"""What the page draws and computes with, from the files of a run folder.

The assembly moves as X + s sum_k q_k(t) phi_k(X): outer nodes X and shapes phi_k of the wall's
modes from `rom.npz`, their coordinates q_k from `trajectory.npz`, in 16 bits, as far as they show;
u_w has all modes. Of a surface with more nodes than fit those are left that show its form.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflows.files.scene import scene as load
from workflows.report.packing import floats, quantised, whole
from workflows.report.summary import Summary
from workflows.scene import RomWall, Scene

MOST_FRAMES = 3001  # instants that the page holds
MOST_VALUES = 600_000  # of a chain's positions and velocities
MOST_DRAWN = 300  # spheres, those next to the wall
BYTES = 1_300_000  # of all shapes: in 8 bits where 16 take more, of fewer nodes where 8 do
LEDGER = {
    "energy_kinetic": "spheres, kinetic",
    "energy_contact": "contacts",
    "energy_leaf": "leaf springs",
    "energy_wall": "wall, modes",
    "energy_residual": "wall, residual compliance",
    "dissipated_contact": "lost in contacts",
    "dissipated_wall": "lost in the wall",
    "dissipated_guides": "lost in the guides",
    "work_preload": "less work of the preload",
    "work_gravity": "less work of the weight",
}


def page_data(folder: Path, summary: Summary) -> dict[str, Any]:
    """Everything that the page's scripts read, as JSON takes it."""
    scene = load(str(folder / "scene.toml"))
    run = arrays(folder / "trajectory.npz")
    data: dict[str, Any] = {"scene": scene.name, "wall": wall_words(scene)}
    if run:
        data |= {
            "chain": _chain(scene, run),
            "curves": _curves(scene, run),
            "waves": _waves(summary),
        }
    if scene.output.sensors and (file := folder / "signals.csv").is_file():
        data["signals"] = _signals(scene, np.loadtxt(file, delimiter=",", skiprows=2, ndmin=2))
    if reduced := reduced_model(folder, scene):
        data["assembly"] = _assembly(reduced, scene, run, summary)
    if response := arrays(folder / "response.npz"):
        data["response"] = _response(response)
    direction = reduced.contact.direction if reduced else (1.0, 0.0, 0.0)
    return data | {"direction": direction, "up": upwards(scene, direction)}


def upwards(scene: Scene, direction: Sequence[float]) -> list[float]:
    """(3,) against the weight of spheres that move along `direction`; z where they have none."""
    d, z = np.asarray(direction), np.array([0.0, 0.0, 1.0])
    if scene.gravity is None:
        return z.tolist()
    level = z - (z @ d) * d  # across the chain, as near to z as there is
    if np.linalg.norm(level) < 1e-6:
        level = np.array([1.0, 0.0, 0.0])
    angle = np.radians(scene.gravity.inclination)
    return (np.cos(angle) * level / np.linalg.norm(level) - np.sin(angle) * d).tolist()


def arrays(path: Path) -> dict[str, NDArray]:
    """The arrays of a file, none where there is no file."""
    if not path.is_file():
        return {}
    with np.load(path) as file:
        return {name: file[name] for name in file.files}


def wall_words(scene: Scene) -> str | None:
    """The kind of the wall; None for a free chain."""
    return None if scene.wall is None else scene.wall.kind


def _every(n: int, width: int) -> int:
    """Take each so many of n instants of so many values."""
    return max(1, -(-n // MOST_FRAMES), -(-n * width // MOST_VALUES))


def _chain(scene: Scene, run: dict[str, NDArray]) -> dict[str, Any]:
    """Positions and velocities of the spheres next to the wall, from the first drawn on."""
    k, n = run["x"].shape
    first = max(0, n - MOST_DRAWN)
    every = _every(k, n - first)
    radius = np.broadcast_to(scene.chain.radius, n)[first:]
    return {
        "first": first + 1,
        "radius": radius.tolist(),
        "dt": float(every * (run["t"][1] - run["t"][0])),
        "x": quantised(run["x"][::every, first:] - run["x"][0, first:]),
        "v": quantised(run["v"][::every, first:]),
        "wall_x": quantised(run["wall_x"][::every, None] - run["wall_x"][0]),
    }


def _curves(scene: Scene, run: dict[str, NDArray]) -> dict[str, Any]:
    """Time histories in single precision: name, unit and values of each curve by plot."""
    n = run["v"].shape[1]
    observed = scene.output.spheres or (1, n)
    plots = {"velocity": [(f"sphere {s}", "m/s", run["v"][:, s - 1]) for s in observed]}
    if scene.wall is not None:
        plots["force"] = [("force at the wall", "N", run["contact_force"][:, -1])]
        moved = run["wall_x"] - run["wall_x"][0]
        plots["wall"] = [("displacement at the contact", "m", moved)] if moved.any() else []
    plots["energy"] = [(words, "J", values) for words, values in ledger(run)]
    return _sampled(run["t"], plots)


def _signals(scene: Scene, rows: NDArray[np.float64]) -> dict[str, Any]:
    """Those of the sensors (k, 1 + m) after their instants; a plot for each unit."""
    plots: dict[str, list] = {}
    for sensor, y in zip(scene.output.sensors, rows.T[1:], strict=True):
        plots.setdefault(f"signals {sensor.unit}", []).append((sensor.label, sensor.unit, y))
    return _sampled(rows[:, 0], plots)


def _sampled(t: NDArray[np.float64], plots: dict[str, list]) -> dict[str, Any]:
    """Curves (name, unit, values at t) by plot, at as many instants as the page holds."""
    every = max(1, -(-len(t) // MOST_FRAMES))
    return {
        "dt": float(every * (t[1] - t[0])),
        "plots": {
            name: [{"name": w, "unit": u, "values": floats(v[::every])} for w, u, v in curves]
            for name, curves in plots.items()
            if curves
        },
    }


def ledger(run: dict[str, NDArray]) -> list[tuple[str, NDArray]]:
    """Energies [J] by name, changes since the start but for the kinetic one, and their sum."""
    found = []
    for name, words in LEDGER.items():
        if name not in run:  # of a folder that an earlier version wrote
            continue
        sign = -1.0 if name.startswith("work") else 1.0
        change = sign * (run[name] - (0.0 if name == "energy_kinetic" else run[name][0]))
        if np.any(change):
            found.append((words, change))
    return [*found, ("sum", sum(values for _, values in found))]


def _waves(summary: Summary) -> dict[str, Any]:
    contact = summary.wall_contact
    tracks = [track.model_dump() for track in contact.trains] if contact else []
    marks = {
        sphere: [arrival.model_dump() for arrival in waves.arrivals]
        for sphere, waves in summary.waves.items()
    }
    return {"tracks": tracks, "marks": marks}


def reduced_model(folder: Path, scene: Scene):
    """The reduced model behind the wall with its outer nodes, None where there is none."""
    path = folder / "rom.npz"
    if not path.is_file():
        file = scene.wall.file if isinstance(scene.wall, RomWall) else None
        path = Path(file) if file and file.endswith(".npz") else path
    if not path.is_file():
        return None
    import rom  # only a scene with a reduced model pays for it

    try:
        reduced = rom.load_npz(path)
    except rom.ReductionError:
        return None
    return reduced if reduced.surface is not None and reduced.contact.point else None


def _assembly(reduced, scene: Scene, run: dict[str, NDArray], summary: Summary) -> dict[str, Any]:
    from coupling.surface_motion import Moved, shown_shapes

    surface, point = reduced.surface, np.array(reduced.contact.point)
    moved = None
    if "wall_q" in run:
        cutoff = getattr(scene.wall, "cutoff", None)
        moved = Moved(run["wall_omega"], run["wall_phi"], run["wall_q"], cutoff)
    shapes = shown_shapes(reduced, [mode.frequency_hz for mode in summary.modes], moved)
    k, n = shapes.shape.shape[:2]
    body = np.zeros(n, int) if surface.body is None else surface.body
    nodes, faces = _drawn(surface, BYTES // (3 * max(k, 1)))
    kind = "i2" if 6 * k * len(nodes) <= BYTES else "i1"
    return {
        "n_nodes": n,
        "points": quantised(surface.points[nodes] - point),
        "faces": whole(faces),
        "body": whole(body[nodes]),
        "bodies": surface.bodies or ("assembly",),
        "origin": point.tolist(),
        "shapes": quantised(shapes.shape[:, nodes].reshape(k, -1).T, kind),
        "of_mode": shapes.of_mode,
        "of_wall": shapes.of_wall,
        **_wall_motion(run),
    }


def _drawn(surface, most: int) -> tuple[NDArray, NDArray]:
    """Nodes that the page draws, and the faces around them."""
    if len(surface.points) <= most:
        return np.arange(len(surface.points)), surface.faces
    from geometry import thinned  # only a large surface pays for it

    return thinned(surface.points, surface.faces, most)


def _wall_motion(run: dict[str, NDArray]) -> dict[str, Any]:
    """The coordinates of the wall's modes over time, from rest."""
    if "wall_q" not in run:
        return {}
    every = max(1, -(-len(run["t"]) // MOST_FRAMES))
    return {
        "phi": run["wall_phi"].tolist(),
        "frequency_hz": (run["wall_omega"] / (2 * np.pi)).tolist(),
        "q": quantised((run["wall_q"] - run["wall_q"][0])[::every]),
        "dt": float(every * (run["t"][1] - run["t"][0])),
    }


def _response(found: dict[str, NDArray]) -> dict[str, Any]:
    return {
        "frequency_hz": floats(found["frequency_hz"]),
        "reduced": floats(np.abs(found["reduced"])),
        "finer": floats(np.abs(found["finer"])),
        "checked_hz": found["checked_hz"].tolist(),
        "full": np.abs(found["full"]).tolist(),
    }
