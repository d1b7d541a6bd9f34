"""A run as a film: frames of the impact beside its play head, and the same for ParaView.

The frames are drawn by `workflows.report.render_film` in a process of its own, from one file of
arrays: a render without a GL library kills its process alone.
"""

from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflows.files.child import child
from workflows.files.run_folder import RunFolder
from workflows.files.scene import scene as load
from workflows.report import page_data, plots
from workflows.report.plots import Line, Panel
from workflows.report.report import require_summary
from workflows.scene import InvalidScene, Scene

SECONDS, RATE = 8.0, 20  # of a film, frames a second
FRAMES = 100  # in files for ParaView
TIME_LIMIT = 900  # s
SHARE, SPHERES = 0.06, 0.9  # largest displacement drawn, of the assembly's size and of a radius
STRIP = (9.6, 1.7)  # inches of the velocities below the frames, at plots.png's 130 dots
ENDINGS = (".mp4", ".gif")


class Motion(NamedTuple):
    """What moves at some instants: spheres, and the outer nodes of an assembly or of a slab."""

    t: NDArray[np.float64]  # (f,) [s]
    x: NDArray[np.float64]  # (f, n) [m] from rest
    v: NDArray[np.float64]  # (f, n) [m/s]
    radius: NDArray[np.float64]  # (n,) [m]
    direction: NDArray[np.float64]  # (3,) of the chain's travel
    points: NDArray[np.float64]  # (m, 3) [m] from the contact
    faces: NDArray[np.int64]  # (k, 4)
    u: NDArray[np.float64]  # (f, m, 3) [m] from rest


def require_name(name: str) -> None:
    """Raise InvalidScene for the name of a film that cannot be made."""
    if Path(name).name != name:
        raise InvalidScene(f"--out {name} names a file in DIR; write no folder before it.")
    if Path(name).suffix not in ENDINGS:
        raise InvalidScene(f"--out {name} must end in {' or '.join(ENDINGS)}.")
    if name.endswith(".mp4") and not find_spec("imageio_ffmpeg"):
        raise InvalidScene(
            f"--out {name} needs imageio with ffmpeg (./install.sh film); name a .gif instead."
        )


def film(folder: RunFolder, name: str, *, seconds: float = SECONDS) -> list[Path]:
    """Write the film NAME, .mp4 or .gif, into a run folder; raises InvalidScene without a run."""
    moved, scene = motion(folder.path, round(seconds * RATE))
    strip, left, right = _strip(folder.path, scene)
    with TemporaryDirectory() as work:
        (Path(work) / "strip.png").write_bytes(strip)
        more = {"head": [left, right], "up": page_data.upwards(scene, moved.direction)}
        np.savez(Path(work) / "motion.npz", **moved._asdict(), **more, **_scales(moved))
        _rendered(work, name)
        return [folder.write(name, (Path(work) / name).read_bytes())]


def paraview(folder: RunFolder) -> list[Path]:
    """Write film.pvd and the surfaces and spheres of its instants; raises InvalidScene."""
    moved, _ = motion(folder.path, FRAMES)
    written = []
    for i in range(len(moved.t)):
        for part, grid in (("structure", _structure(moved, i)), ("spheres", _spheres(moved, i))):
            with folder.writing(f"film/{part}_{i:04d}.vtu") as path:
                grid.write(path, file_format="vtu")
    sets = "".join(
        f'<DataSet timestep="{t:.9g}" part="{number}" file="film/{part}_{i:04d}.vtu"/>\n'
        for i, t in enumerate(moved.t)
        for number, part in enumerate(("structure", "spheres"))
    )
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    written.append(folder.write("film.pvd", f"{head}{sets}</Collection>\n</VTKFile>\n"))
    return written


def motion(folder: Path, n: int) -> tuple[Motion, Scene]:
    """The run at n instants, and its scene; raises InvalidScene where there is no trajectory."""
    require_summary(folder)
    scene, run = load(folder / "scene.toml"), page_data.arrays(folder / "trajectory.npz")
    if not run:
        raise InvalidScene(
            f"{folder} has no trajectory.npz: its scene has no chain, nothing moves."
        )
    i = np.unique(np.linspace(0, len(run["t"]) - 1, n).round().astype(int))
    radius = np.broadcast_to(scene.chain.radius, run["x"].shape[1]).astype(float)
    body = _assembly(folder, scene, run, i) or _slab(radius[-1], scene, run, i)
    x = run["x"][i] - run["x"][0]
    return Motion(run["t"][i], x, run["v"][i], radius, *body), scene


def _assembly(folder: Path, scene: Scene, run: dict[str, NDArray], i: NDArray[np.int64]):
    reduced = page_data.reduced_model(folder, scene)
    if reduced is None or "wall_q" not in run:
        return None
    from coupling.surface_motion import wall_modes

    cutoff = getattr(scene.wall, "cutoff", None)
    modes = wall_modes(reduced, run["wall_omega"], run["wall_phi"], cutoff_hz=cutoff)
    u = np.tensordot(run["wall_q"][i] - run["wall_q"][0], modes.shape, 1)
    faces = reduced.surface.faces
    faces = np.pad(faces, [(0, 0), (0, 4 - faces.shape[1])], mode="edge")
    points = reduced.surface.points - np.array(reduced.contact.point)
    return np.array(reduced.contact.direction), points, faces, u


def _slab(R: float, scene: Scene, run: dict[str, NDArray], i: NDArray[np.int64]):
    """What stands for a wall without a shape; nothing of a free chain."""
    corner = np.array(np.meshgrid([0, 0.6], [-1.5, 1.5], [-1.5, 1.5], indexing="ij"))
    points = R * corner.reshape(3, -1).T
    faces = [[0, 2, 3, 1], [4, 6, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    u = np.zeros((len(i), 8, 3))
    u[:, :, 0] = (run["wall_x"][i] - run["wall_x"][0])[:, None]
    kept = slice(None) if scene.wall is not None else slice(0)
    return np.array([1.0, 0.0, 0.0]), points, np.array(faces)[kept], u


def _scales(moved: Motion) -> dict[str, float]:
    """Round factors that displacements are drawn by."""
    size = float(np.linalg.norm(np.ptp(moved.points, axis=0)))
    most_u, most_x = np.linalg.norm(moved.u, axis=2).max(), np.abs(moved.x).max()
    return {
        "scale_u": rounded(SHARE * size / most_u) if most_u else 1.0,
        "scale_x": rounded(SPHERES * moved.radius.min() / most_x) if most_x else 1.0,
    }


def rounded(value: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten."""
    scale = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1.0, 2.0, 5.0, 10.0])
    return float(scale * steps[np.abs(np.log(value / scale / steps)).argmin()])


def _strip(folder: Path, scene: Scene) -> tuple[bytes, float, float]:
    """Velocities of the observed spheres as a picture, and where its time begins and ends as
    shares of the width."""
    run = page_data.arrays(folder / "trajectory.npz")
    observed = scene.output.spheres or (1, run["v"].shape[1])
    lines = [Line(f"sphere {s}", 1e3 * run["t"], 1e3 * run["v"][:, s - 1], "-") for s in observed]
    panel = Panel("", "time [ms]", "velocity [mm/s]", lines)
    figure, (axis,) = plots.drawn([panel], size=STRIP)
    raw = plots.png(figure)
    ends = axis.transData.transform([(1e3 * run["t"][0], 0), (1e3 * run["t"][-1], 0)])[:, 0]
    left, right = ends / figure.bbox.width
    return raw, float(left), float(right)


def _rendered(work: str, name: str) -> None:
    done = child("workflows.report.render_film", work, name, seconds=TIME_LIMIT)
    if done.returncode != 0:
        raise ValueError(
            "the film could not be drawn; install an off-screen GL library (Debian: apt-get "
            "install libgl1 libosmesa6) and try again."
        )


def _structure(moved: Motion, i: int):
    from meshio import Mesh as Grid

    triangle = moved.faces[:, 2] == moved.faces[:, -1] if len(moved.faces) else np.zeros(0, bool)
    cells = [("quad", moved.faces[~triangle]), ("triangle", moved.faces[triangle][:, :3])]
    data = {"displacement": moved.u[i].astype(np.float32)}
    return Grid(moved.points, [(kind, each) for kind, each in cells if len(each)], data)


def _spheres(moved: Motion, i: int):
    from meshio import Mesh as Grid

    n = len(moved.radius)
    data = {
        "displacement": np.outer(moved.x[i], moved.direction).astype(np.float32),
        "velocity": moved.v[i].astype(np.float32),
        "radius": moved.radius.astype(np.float32),
    }
    return Grid(centres(moved.radius, moved.direction), [("vertex", np.arange(n)[:, None])], data)


def centres(radius: NDArray[np.float64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centres (n, 3) [m] at rest, from the contact: the last sphere touches it."""
    behind = np.cumsum(2 * radius[::-1])[::-1] - radius
    return -np.outer(behind, direction)
