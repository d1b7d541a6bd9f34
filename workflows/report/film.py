"""A run as a film: frames of the impact above its play head, and the same for ParaView.

The frames are drawn by `workflows.report.render_film` in a process of its own, from one file of
arrays: a render without a GL library kills its process alone.
"""

from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beadwave.system import adding
from beadwave.workflows.files.child import child
from beadwave.workflows.files.run_folder import RunFolder
from beadwave.workflows.files.scene import scene as load
from beadwave.workflows.report import page_data, plots
from beadwave.workflows.report.plots import Line, Panel
from beadwave.workflows.report.report import require_summary
from beadwave.workflows.scene import InvalidScene, Scene

ENDINGS = (".mp4", ".gif")
PVD = """<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1">
<Collection>
{}</Collection>
</VTKFile>
"""


# Looks of a film, chosen by eye, and the time that its frames may take
FRAME_RATE = 20  # frames a second
N_PARAVIEW_FRAMES = 100  # instants in files for ParaView
STRUCTURE_AMPLITUDE = 0.06  # largest displacement as drawn over the assembly's size
SPHERE_AMPLITUDE = 0.9  # the same over the smallest radius: spheres keep their order
# velocities below the frames: at the 130 dots an inch of `plots.png` as wide as the frames
STRIP_INCHES = (9.6, 1.7)
MAX_SECONDS = 900  # for all frames


class Frames(NamedTuple):
    """Motion at f instants: n spheres, and the m outer nodes of an assembly or of a slab."""

    t: NDArray[np.float64]  # (f,) [s]
    x: NDArray[np.float64]  # (f, n) [m] displacements of the spheres from rest
    v: NDArray[np.float64]  # (f, n) [m/s]
    radius: NDArray[np.float64]  # (n,) [m]
    direction: NDArray[np.float64]  # (3,) of the chain's travel
    points: NDArray[np.float64]  # (m, 3) [m] from the contact
    faces: NDArray[np.int64]  # (k, 4), a triangle's last corner twice
    u: NDArray[np.float64]  # (f, m, 3) [m] displacements of the points from rest


def require_name(name: str) -> None:
    """Raise InvalidScene for the name of a film that cannot be made."""
    if Path(name).name != name:
        raise InvalidScene(f"--out {name} names a file in DIR; write no folder before it.")
    if Path(name).suffix not in ENDINGS:
        raise InvalidScene(f"--out {name} must end in {' or '.join(ENDINGS)}.")
    if name.endswith(".mp4") and not find_spec("imageio_ffmpeg"):
        raise InvalidScene(
            f"--out {name} needs imageio with ffmpeg ({adding('film')}); name a .gif instead."
        )


def film(folder: RunFolder, name: str, *, seconds: float) -> list[Path]:
    """Write the film NAME, .mp4 or .gif, into a run folder; raises InvalidScene without a run."""
    run, scene = frames(folder.path, round(seconds * FRAME_RATE))

    # displacements are drawn by round factors, 1 where nothing moves
    size = float(np.linalg.norm(np.ptp(run.points, axis=0)))
    largest_u, largest_x = np.linalg.norm(run.u, axis=2).max(), np.abs(run.x).max()
    scale_u = rounded(STRUCTURE_AMPLITUDE * size / largest_u) if largest_u else 1.0
    scale_x = rounded(SPHERE_AMPLITUDE * run.radius.min() / largest_x) if largest_x else 1.0

    # velocities of the observed spheres, and where their time starts and ends in the picture
    trajectory = page_data.arrays(folder.path / "trajectory.npz")
    t, v = 1e3 * trajectory["t"], 1e3 * trajectory["v"]
    observed = scene.output.spheres or (1, v.shape[1])
    lines = [Line(f"sphere {s}", t, v[:, s - 1], "-") for s in observed]
    panel = Panel("", "time [ms]", "velocity [mm/s]", lines)
    figure, (axis,) = plots.drawn([panel], size=STRIP_INCHES)
    strip = plots.png(figure)  # lays out the axes
    head = axis.transData.transform([(t[0], 0), (t[-1], 0)])[:, 0] / figure.bbox.width

    with TemporaryDirectory() as work:
        (Path(work) / "strip.png").write_bytes(strip)
        np.savez(
            Path(work) / "film.npz", **run._asdict(), scale_u=scale_u, scale_x=scale_x,
            up=page_data.upwards(scene, run.direction), head=head, rate=FRAME_RATE,
        )  # fmt: skip
        drawing = child("beadwave.workflows.report.render_film", work, name, seconds=MAX_SECONDS)
        if drawing.returncode != 0:
            raise ValueError(
                "the film could not be drawn; install an off-screen GL library (Debian: apt-get "
                "install libgl1 libosmesa6) and try again."
            )
        return [folder.write(name, (Path(work) / name).read_bytes())]


def paraview(folder: RunFolder) -> list[Path]:
    """Write film.pvd and the surfaces and spheres of its instants; raises InvalidScene without a
    run that moves."""
    from meshio import Mesh as Grid

    # quadrilaterals of a surface, and triangles, whose last corner is named twice
    run, _ = frames(folder.path, N_PARAVIEW_FRAMES)
    triangle = run.faces[:, 2] == run.faces[:, -1] if len(run.faces) else np.zeros(0, bool)
    faces = (("quad", run.faces[~triangle]), ("triangle", run.faces[triangle][:, :3]))
    faces = [(kind, corners) for kind, corners in faces if len(corners)]
    spheres = [("vertex", np.arange(len(run.radius))[:, None])]
    at_rest = centres(run.radius, run.direction)

    # a file of each part at each instant, listed with its time in film.pvd
    entries = []
    for i, t in enumerate(run.t):
        of_structure = {"displacement": run.u[i].astype(np.float32)}
        of_spheres = {
            "displacement": np.outer(run.x[i], run.direction).astype(np.float32),
            "velocity": run.v[i].astype(np.float32),
            "radius": run.radius.astype(np.float32),
        }
        grids = {
            "structure": Grid(run.points, faces, of_structure),
            "spheres": Grid(at_rest, spheres, of_spheres),
        }
        for number, (part, grid) in enumerate(grids.items()):
            file = f"film/{part}_{i:04d}.vtu"
            with folder.writing(file) as path:
                grid.write(path, file_format="vtu")
            entries.append(f'<DataSet timestep="{t:.9g}" part="{number}" file="{file}"/>\n')
    return [folder.write("film.pvd", PVD.format("".join(entries)))]


def frames(folder: Path, n: int) -> tuple[Frames, Scene]:
    """The run at n even instants, or at all of fewer, and its scene; raises InvalidScene where
    there is no trajectory. Displacements are from rest, places [m] from the contact."""
    require_summary(folder)
    scene, run = load(folder / "scene.toml"), page_data.arrays(folder / "trajectory.npz")
    if not run:
        raise InvalidScene(
            f"{folder} has no trajectory.npz: its scene has no chain, nothing moves."
        )
    if scene.crystal or scene.chains:
        of = "a crystal" if scene.crystal else "several chains"
        raise InvalidScene(
            f"{folder} is the run of {of}, of which there is no film; open its report.html, "
            "which moves the spheres."
        )
    i = np.unique(np.linspace(0, len(run["t"]) - 1, n).round().astype(int))
    radius = np.broadcast_to(scene.chain.radius, run["x"].shape[1]).astype(float)

    reduced = page_data.reduced_model(folder, scene)
    if reduced is not None and "wall_q" in run:
        # the assembly: u = sum_k q_k(t) phi_k at its outer nodes
        from beadwave.coupling.surface_motion import wall_modes

        cutoff = getattr(scene.wall, "cutoff", None)
        modes = wall_modes(reduced, run["wall_omega"], run["wall_phi"], cutoff_hz=cutoff)
        u = np.tensordot(run["wall_q"][i] - run["wall_q"][0], modes.shape, 1)
        faces = reduced.surface.faces
        faces = np.pad(faces, [(0, 0), (0, 4 - faces.shape[1])], mode="edge")
        points = reduced.surface.points - np.array(reduced.contact.point)
        direction = np.array(reduced.contact.direction)
    else:
        # a slab stands for a wall without a shape, and has no faces behind a free chain
        corners = np.array(np.meshgrid([0, 0.6], [-1.5, 1.5], [-1.5, 1.5], indexing="ij"))
        points = radius[-1] * corners.reshape(3, -1).T
        sides = [(0, 2, 3, 1), (4, 6, 7, 5), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
        faces = np.array(sides)[: None if scene.wall is not None else 0]
        u = np.zeros((len(i), 8, 3))
        u[:, :, 0] = (run["wall_x"][i] - run["wall_x"][0])[:, None]
        direction = np.array([1.0, 0.0, 0.0])

    x = run["x"][i] - run["x"][0]
    return Frames(run["t"][i], x, run["v"][i], radius, direction, points, faces, u), scene


def rounded(value: float) -> float:
    """The nearest of 1, 2 and 5 times a power of ten."""
    scale = 10.0 ** np.floor(np.log10(value))
    steps = np.array([1.0, 2.0, 5.0, 10.0])
    return float(scale * steps[np.abs(np.log(value / scale / steps)).argmin()])


def centres(radius: NDArray[np.float64], direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centres (n, 3) [m] at rest, from the contact: the last sphere touches it."""
    from_contact = np.cumsum(2 * radius[::-1])[::-1] - radius
    return -np.outer(from_contact, direction)
