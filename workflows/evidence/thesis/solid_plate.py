"""A clamped plate by Mindlin's theory, and as a solid of finite elements struck at the same point.

The scene's own [plate] with clamped edges, and an assembly of one box whose sides are held.
"""

import numpy as np

from workflows.evidence.prose import rendered
from workflows.evidence.thesis import bent
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import InvalidScene, Scene
from workflows.scene.toml import resolved
from workflows.stages.pipeline import Pipeline, Progress, pipeline_of

SCENE = "plate"
EDGES = ("left", "right", "front", "back")
SIDES = ("-x", "+x", "-y", "+y")
ERROR = 1e-3  # of the receptance
SCALE = 0.7  # of the solid's elements
SHARED = ("chain", "striker", "contact", "leaf_springs", "preload", "time", "output", "damping")
COLUMNS = ("theory", "first_hz", "fifth_hz", "compliance_m_N", "contact_us", "tof_us", "arr")


def solid_plate(scene: Scene, progress: Progress) -> Finding:
    """Waves of a clamped plate by Mindlin's theory beside those of the solid."""
    bent.require(scene, "plate")
    if any(scene.plate.loads.values()):
        raise InvalidScene(
            f"the scene {scene.name} has a plate under forces in its plane; set plate.in_plane_x "
            "and in_plane_y to 0."
        )
    clamped = dict.fromkeys(EDGES, "clamped")
    thin = scene.but(plate=clamped, reduction={"modes": None, "cutoff": None, "error": ERROR})
    both = [pipeline_of(one, progress) for one in (thin, drawn(thin))]
    rows = tuple(_row(*named) for named in zip(("Mindlin", "solid"), both, strict=True))
    theory, solid = (dict(zip(COLUMNS, row, strict=True)) for row in rows)
    off = {name: theory[name] / solid[name] - 1 for name in COLUMNS[1:]}
    off["tof_us"] = theory["tof_us"] - solid["tof_us"]
    picture = Picture("study_solid_plate", _picture(both))
    mesh = both[1]("mesh-error") if scene.time.dt is None else None
    found = rendered(__file__, off=off, mesh=mesh)
    return Finding((Table("solid-plate", COLUMNS, rows),), found, (picture,))


def drawn(scene: Scene) -> Scene:
    """The same plate as a body, its sides held."""
    plate = scene.plate
    middle = (plate.length / 2, plate.width / 2)
    shared = {name: getattr(scene, name) for name in SHARED}
    tables = {name: t.model_dump(exclude_none=True) for name, t in shared.items() if t is not None}
    tables |= {
        "name": f"{scene.name}-solid",
        "wall": {"kind": "rom"},
        "assembly": {"held": [f"plate:{side}" for side in SIDES], "material": "its"},
        "materials": {
            "its": {"young": plate.young, "poisson": plate.poisson, "density": plate.density}
        },
        "bodies": {"plate": {"box": [plate.length, plate.width, plate.thickness]}},
        "strike": {"on": "plate:+z", "at": [x - m for x, m in zip(plate.at, middle, strict=True)]},
        "reduction": {"error": ERROR},
        "mesh": {"scale": SCALE},
    }
    return resolved(tables, tables["name"])


def _row(theory: str, found: Pipeline) -> tuple:
    hz = found("modes").omega / (2 * np.pi)
    wall, contact = found("wall"), found("waves").contact
    elastic = wall.omega > 0
    compliance = np.sum((wall.phi[elastic] / wall.omega[elastic]) ** 2) + wall.residual_compliance
    nan = float("nan")
    tof, arr = (nan if x is None else x for x in (contact.tof, contact.arr))
    seconds = contact.contact_time.seconds
    return theory, float(hz[0]), float(hz[4]), float(compliance), 1e6 * seconds, 1e6 * tof, arr


def _picture(both: list[Pipeline]) -> bytes:
    lines = []
    for theory, found, style in zip(("Mindlin", "solid"), both, ("-", "--"), strict=True):
        run, sphere = found("impact").trajectory, max(found.scene.output.spheres or (1,))
        lines.append(Line(theory, 1e3 * run.t, run.v[:, sphere - 1], style, len(lines), 1.2))
    return panels([Panel(f"sphere {sphere}", "time [ms]", "velocity [m/s]", lines)], size=(8, 3.4))
