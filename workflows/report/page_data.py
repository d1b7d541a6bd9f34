"""Data of the report page's scripts, from the files of a run folder.

The assembly moves as X + s sum_k q_k(t) phi_k(X): outer nodes X and shapes phi_k of the wall's
modes from `rom.npz`, their coordinates q_k from `trajectory.npz`, in 16 bits, as far as they show;
u_w has all modes. Of a surface with more nodes than fit those are left that show its form.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.workflows.files.scene import scene as load
from beadwave.workflows.report.packing import TOP, floats, packed_integers, quantised, whole
from beadwave.workflows.report.summary import Summary
from beadwave.workflows.scene import RomWall, Scene

LEDGER = {
    "energy_kinetic": "spheres, kinetic",
    "energy_contact": "contacts",
    "energy_wall_contact": "contacts with walls",
    "energy_leaf": "leaf springs",
    "energy_wall": "wall, modes",
    "energy_residual": "wall, residual compliance",
    "dissipated_contact": "lost in contacts",
    "dissipated_wall": "lost in the wall",
    "dissipated_guides": "lost in the guides",
    "energy_spin": "spheres, spin",
    "energy_shear": "contacts, tangential",
    "energy_lateral": "last sphere, kinetic across",
    "energy_rotation": "last sphere, rotation",
    "energy_arm": "arm, across",
    "energy_tangential": "contact at the wall, tangential",
    "dissipated_friction": "heat of friction",
    "work_drive": "less work of the drive",
    "work_shaker": "less work of the shakers",
    "work_preload": "less work of the preload",
    "work_gravity": "less work of the weight",
}


KINETIC = ("energy_kinetic", "energy_spin", "energy_lateral", "energy_rotation")


class PageLimits(NamedTuple):
    """Amount of a run on the page, for a page of 3 MB at most."""

    frames: int = 3001  # instants
    values: int = 600_000  # of a chain's positions and velocities
    spheres: int = 300  # those next to the wall
    # of all shapes: in 8 bits where 16 take more, of fewer nodes where 8 do
    bytes: int = 1_300_000
    # of a crystal's motion, four bytes a sphere and instant: 150 instants of 20,000 spheres
    motion: int = 12_000_000
    instants: int = 601


def page_data(folder: Path, summary: Summary, limits: PageLimits = PageLimits()) -> dict[str, Any]:
    """Everything that the page's scripts read, as JSON takes it, of what the folder has: a part
    that is not there is left out. Arrays are thinned to the limits, and packed as integers."""
    scene = load(str(folder / "scene.toml"))
    run = arrays(folder / "trajectory.npz")
    data: dict[str, Any] = {
        "scene": scene.name, "wall": None if scene.wall is None else scene.wall.kind
    }  # fmt: skip

    if "chain" in run:
        data |= _chains(scene, run, summary, limits)
    elif "x" in run:
        # positions and velocities of the spheres next to the wall, from the first drawn on
        t, (k, n) = run["t"], run["x"].shape
        first = max(0, n - limits.spheres)
        step = max(1, -(-k // limits.frames), -(-k * (n - first) // limits.values))
        data["chain"] = {
            "first": first + 1,
            "radius": np.broadcast_to(scene.chain.radius, n)[first:].tolist(),
            "dt": float(step * (t[1] - t[0])),
            "x": quantised(run["x"][::step, first:] - run["x"][0, first:]),
            "v": quantised(run["v"][::step, first:]),
            "wall_x": quantised(run["wall_x"][::step, None] - run["wall_x"][0]),
        }

        # time histories: name, unit and values of each curve by plot
        observed = scene.output.spheres or (1, n)
        plots = {"velocity": [(f"sphere {s}", "m/s", run["v"][:, s - 1]) for s in observed]}
        if scene.wall is not None:
            plots["force"] = [("force at the wall", "N", run["contact_force"][:, -1])]
            moved = run["wall_x"] - run["wall_x"][0]
            plots["wall"] = [("displacement at the contact", "m", moved)] if moved.any() else []
        plots["energy"] = [(words, "J", values) for words, values in ledger(run)]
        data["curves"] = _sampled(t, plots, limits)

        if "friction_force" in run:
            data["friction"] = friction_of(scene, run, limits)

        # waves that were followed, and those that pass the observed spheres
        contact = summary.wall_contact
        data["waves"] = {
            "tracks": [track.model_dump() for track in contact.trains] if contact else [],
            "marks": {
                sphere: [arrival.model_dump() for arrival in waves.arrivals]
                for sphere, waves in summary.waves.items()
            },
        }

    if "displacement" in run:
        data["crystal"] = _crystal(run, limits)

    # signals of the sensors behind their instants, a plot for each unit
    if scene.output and scene.output.sensors and (file := folder / "signals.csv").is_file():
        columns = np.loadtxt(file, delimiter=",", skiprows=2, ndmin=2).T
        plots = {}
        for sensor, y in zip(scene.output.sensors, columns[1:], strict=True):
            plot = plots.setdefault(f"signals {sensor.unit}", [])
            plot.append((sensor.label, sensor.unit, y))
        data["signals"] = _sampled(columns[0], plots, limits)

    reduced = reduced_model(folder, scene)
    if reduced and scene.crystal is None:  # the view of a crystal moves its spheres alone
        data["assembly"] = _moving_surface(reduced, scene, run, summary, limits)
    if response := arrays(folder / "response.npz"):
        data["response"] = {
            "frequency_hz": floats(response["frequency_hz"]),
            "reduced": floats(np.abs(response["reduced"])),
            "finer": floats(np.abs(response["finer"])),
            "checked_hz": response["checked_hz"].tolist(),
            "full": np.abs(response["full"]).tolist(),
        }
    direction = reduced.contact.direction if reduced else (1.0, 0.0, 0.0)
    return data | {"direction": direction, "up": upwards(scene, direction)}


def _chains(
    scene: Scene, run: dict[str, NDArray], summary: Summary, limits: PageLimits
) -> dict[str, Any]:
    """Several chains: their spheres in space, curves of each, and their waves, whose contacts are
    numbered through all chains as the spheres are."""
    t, (k, n), of_chain = run["t"], run["x"].shape, run["chain"]
    origin = run["rest"][of_chain == 0][-1] + run["radius"][of_chain == 0][-1] * run["direction"][0]
    step = max(1, -(-k // limits.frames), -(-k * n // limits.values))
    chain = {
        "first": 1,
        "radius": run["radius"].tolist(),
        "dt": float(step * (t[1] - t[0])),
        "x": quantised(run["x"][::step]),
        "v": quantised(run["v"][::step]),
        "wall_x": quantised(run["wall_x"][::step, :1]),
        "rest": (run["rest"] - origin).ravel().tolist(),
        "along": run["direction"].ravel().tolist(),
    }
    curves: dict[str, list] = {"velocity": [], "force": [], "wall": []}
    tracks, marks = [], {}
    for i, (row, (name, numbers)) in enumerate(
        zip(scene.chains, summary.chains.items(), strict=True)
    ):
        columns = np.flatnonzero(of_chain == i)
        spheres = row.output.spheres if row.output else scene.output.spheres
        for s in [s for s in spheres if s <= row.count] or (1, row.count):
            curves["velocity"].append((f"{name}: sphere {s}", "m/s", run["v"][:, columns[s - 1]]))
        curves["force"].append((name, "N", run["contact_force"][:, columns[-1]]))
        if i in run.get("rubbing", ()):
            friction = run["friction_force"][:, int(np.searchsorted(run["rubbing"], i))]
            axis = int(np.ptp(friction, axis=0).argmax())
            curves["force"].append((f"{name}: friction along t{axis + 1}", "N", friction[:, axis]))
        curves["wall"].append((name, "m", run["wall_x"][:, i]))
        marks |= {
            f"{name}: {sphere}": [arrival.model_dump() for arrival in waves.arrivals]
            for sphere, waves in numbers.waves.items()
        }
        for track in numbers.wall_contact.trains if numbers.wall_contact else ():
            shift = {key: getattr(track, key) + int(columns[0])
                     for key in ("from_contact", "to_contact")}  # fmt: skip
            tracks.append(track.model_dump() | shift)
    curves["energy"] = [(words, "J", values) for words, values in ledger(run)]
    return {
        "chain": chain,
        "curves": _sampled(t, curves, limits),
        "waves": {"tracks": tracks, "marks": marks},
    }


def _crystal(run: dict[str, NDArray], limits: PageLimits) -> dict[str, Any]:
    """A crystal's spheres at rest and their motion in 8 bits, at thinned instants; of more spheres
    than fit at two instants the first ones."""
    k, n = run["displacement"].shape[:2]
    shown = min(n, limits.motion // 8)
    most = max(2, min(limits.instants, limits.motion // (4 * shown)))
    step = max(1, -(-(k - 1) // (most - 1)))
    u = run["displacement"][::step, :shown]
    speed = np.sqrt(np.einsum("ksx,ksx->ks", *2 * (run["velocity"][::step, :shown],)))
    # 8 bits up to what all but a few spheres reach: a struck one may fly a thousand times as far
    parts, reached = {}, {}
    for name, values, size in (
        ("u", u.reshape(len(u), -1), np.sqrt(np.einsum("ksx,ksx->ks", u, u))),
        ("v", speed, speed),
    ):
        largest = np.sort(size.max(axis=0))
        reached[name] = float(largest[int(0.98 * (shown - 1))]) or float(largest[-1]) or 1.0
        scale = reached[name] / TOP["i1"]
        steps = np.clip(np.rint(values / scale), -TOP["i1"], TOP["i1"])
        parts |= {name: packed_integers(steps, "i1"), f"{name}_scale": scale}
    return parts | {
        "rest": floats((run["rest"] - run["rest"].mean(axis=0))[:shown].ravel()),
        "radius": floats(run["radius"][:shown]),
        "dt": float(step * (run["t"][1] - run["t"][0])),
        "most": reached["u"],
        "shown_speed": reached["v"],
        "n_spheres": n,
        "n_instants": k,
    }


def friction_of(scene: Scene, run: dict[str, NDArray], limits: PageLimits) -> dict[str, Any]:
    """The motion of the last contact along t1 or t2, whichever it is more, at thinned instants (k,)
    of a run's arrays: slip U [m], force T [N], its bound mu F [N], share of the area that sticks,
    radius a = sqrt(R d) [m] of the overlap d; and U and T of the cycle before the striker."""
    step = max(1, -(-len(run["t"]) // limits.frames))
    axis = int(np.ptp(run["slip"], axis=0).argmax())
    normal = np.maximum(run["contact_force"][::step, -1], 0.0)
    overlap = np.maximum((run["x"][:, -1] - run["wall_x"])[::step], 0.0)
    radius = float(np.atleast_1d(scene.chain.radius)[-1])
    data = {
        "dt": float(step * (run["t"][1] - run["t"][0])),
        "axis": ("t1", "t2")[axis],
        "slip": floats(run["slip"][::step, axis]),
        "force": floats(run["friction_force"][::step, axis]),
        "bound": floats(scene.friction.coefficient * normal),
        "stick": floats(run["stick_share"][::step]),
        "radius": floats(np.sqrt(radius * overlap)),
    }
    if "cycle_slip" in run:
        data["cycle"] = {
            "slip": floats(run["cycle_slip"][:, axis]),
            "force": floats(run["cycle_friction_force"][:, axis]),
        }
    return data


def _sampled(t: NDArray[np.float64], plots: dict[str, list], limits: PageLimits) -> dict[str, Any]:
    """Curves (name, unit, values at t) by plot, at as many instants as the page holds, in single
    precision."""
    step = max(1, -(-len(t) // limits.frames))
    return {
        "dt": float(step * (t[1] - t[0])),
        "plots": {
            plot: [
                {"name": name, "unit": unit, "values": floats(values[::step])}
                for name, unit, values in curves
            ]
            for plot, curves in plots.items()
            if curves
        },
    }


def _moving_surface(
    reduced, scene: Scene, run: dict[str, NDArray], summary: Summary, limits: PageLimits
) -> dict[str, Any]:
    """The assembly's outer nodes X, the shapes phi_k of modes and wall, and the wall's q_k(t).

    The page adds up u(X, t) = sum_k q_k(t) phi_k(X) from rest; shapes take most of its size.
    """
    from beadwave.coupling.surface_motion import SurfaceMotion, shown_shapes

    moved = None
    if "wall_q" in run:
        cutoff = getattr(scene.wall, "cutoff", None)
        moved = SurfaceMotion(run["wall_omega"], run["wall_phi"], run["wall_q"], cutoff)
    shapes = shown_shapes(reduced, [mode.frequency_hz for mode in summary.modes], moved)
    k, n = shapes.shape.shape[:2]

    # as many nodes as fit in 8 bits a coordinate, in 16 where these fit as well
    surface, point = reduced.surface, np.array(reduced.contact.point)
    nodes, faces = np.arange(len(surface.points)), surface.faces
    most_nodes = limits.bytes // (3 * max(k, 1))
    if len(nodes) > most_nodes:
        from beadwave.geometry import thinned  # only a large surface pays for it

        nodes, faces = thinned(surface.points, surface.faces, most_nodes)
    bits = "i2" if 6 * k * len(nodes) <= limits.bytes else "i1"
    body = np.zeros(n, int) if surface.body is None else surface.body
    data = {
        "n_nodes": n,
        "points": quantised(surface.points[nodes] - point),
        "faces": whole(faces),
        "body": whole(body[nodes]),
        "bodies": surface.bodies or ("assembly",),
        "origin": point.tolist(),
        "shapes": quantised(shapes.shape[:, nodes].reshape(k, -1).T, bits),
        "of_mode": shapes.of_mode,
        "of_wall": shapes.of_wall,
    }
    if moved is None:
        return data

    # the coordinates of the wall's modes over time, from rest
    step = max(1, -(-len(run["t"]) // limits.frames))
    return data | {
        "phi": np.atleast_2d(run["wall_phi"])[0].tolist(),
        "frequency_hz": (run["wall_omega"] / (2 * np.pi)).tolist(),
        "q": quantised((run["wall_q"] - run["wall_q"][0])[::step]),
        "dt": float(step * (run["t"][1] - run["t"][0])),
    }


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


def ledger(run: dict[str, NDArray]) -> list[tuple[str, NDArray]]:
    """Energies (k,) [J] of a run's arrays (k,) by name, changes since the start but for kinetic
    ones, and their sum, which stays where it is as far as the ledger closes. Work that the run was
    given counts as negative."""
    changes = []
    for name, words in LEDGER.items():
        if name not in run:  # of a folder that an earlier version wrote
            continue
        sign = -1.0 if name.startswith("work") else 1.0
        change = sign * (run[name] - (0.0 if name in KINETIC else run[name][0]))
        if np.any(change):
            changes.append((words, change))
    return [*changes, ("sum", sum(values for _, values in changes))]


def arrays(path: Path) -> dict[str, NDArray]:
    """The arrays of a .npz file by name, as it holds them; none where there is no file."""
    if not path.is_file():
        return {}
    with np.load(path) as file:
        return {name: file[name] for name in file.files}


def reduced_model(folder: Path, scene: Scene):
    """The reduced model behind the wall with its outer nodes, None where there is none."""
    path = folder / "rom.npz"
    if not path.is_file():
        file = scene.wall.file if isinstance(scene.wall, RomWall) else None
        path = Path(file) if file and file.endswith(".npz") else path
    if not path.is_file():
        return None
    from beadwave import rom  # only a scene with a reduced model pays for it

    try:
        reduced = rom.load_npz(path)
    except rom.ReductionError:
        return None
    return reduced if reduced.surface is not None and reduced.contact.point else None
