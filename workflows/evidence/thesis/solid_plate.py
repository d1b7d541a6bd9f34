"""A clamped plate by Mindlin's theory, and as a solid of finite elements struck at the same point.

The scene's own [plate] with clamped edges, and an assembly of one box whose sides are held.
"""

from typing import NamedTuple

import numpy as np

from beadwave.workflows.evidence.study import concluded
from beadwave.workflows.evidence.thesis import bent
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.pipeline import pipeline_of
from beadwave.workflows.stages.progress import Progress

SCENE = "plate"
EDGES = ("left", "right", "front", "back")
SIDES = ("-x", "+x", "-y", "+y")
SHARED = ("chain", "striker", "contact", "leaf_springs", "preload", "time", "output", "damping")
COLUMNS = ("theory", "first_hz", "fifth_hz", "compliance_m_N", "contact_us", "tof_us", "arr")


class SolidPlateOptions(NamedTuple):
    """How both plates are solved; not varied."""

    error: float = 1e-3  # of the receptance
    scale: float = 0.7  # of the solid's elements: coarse ones leave a percent in the modes


def solid_plate(
    scene: Scene, progress: Progress, options: SolidPlateOptions = SolidPlateOptions()
) -> Finding:
    """Waves of a clamped plate by Mindlin's theory beside those of the solid."""
    bent.require(scene, "plate")
    if any(scene.plate.loads.values()):
        raise InvalidScene(
            f"the scene {scene.name} has a plate under forces in its plane; set plate.in_plane_x "
            "and in_plane_y to 0."
        )
    clamped = dict.fromkeys(EDGES, "clamped")
    reduction = {"modes": None, "cutoff": None, "error": options.error}
    mindlin = scene.but(plate=clamped, reduction=reduction)
    models = {
        "Mindlin": pipeline_of(mindlin, progress),
        "solid": pipeline_of(as_solid(mindlin, options), progress),
    }

    rows, lines = [], []
    for (theory, of), style in zip(models.items(), ("-", "--"), strict=True):
        hz = of("modes").omega / (2 * np.pi)
        contact_us = 1e6 * of("waves").contact.contact_time.seconds
        tof, arr = bent.tof_and_arr(of("waves").contact)

        # static compliance at the contact, sum of (phi / omega)^2 over the elastic modes and what
        # the residual has
        wall = of("wall")
        elastic = wall.omega > 0
        compliance = float(
            np.sum((wall.phi[elastic] / wall.omega[elastic]) ** 2) + wall.residual_compliance
        )
        rows.append((theory, float(hz[0]), float(hz[4]), compliance, contact_us, 1e6 * tof, arr))

        run, sphere = of("impact").trajectory, max(of.scene.output.spheres or (1,))
        lines.append(Line(theory, 1e3 * run.t, run.v[:, sphere - 1], style, len(lines), 1.2))

    # relative differences of the theory to the solid; of the time of flight that in us
    theory, solid = (dict(zip(COLUMNS, row, strict=True)) for row in rows)
    off = {name: theory[name] / solid[name] - 1 for name in COLUMNS[1:]}
    off["tof_us"] = theory["tof_us"] - solid["tof_us"]
    mesh = models["solid"]("mesh-error") if scene.time.dt is None else None

    figure = [Panel(f"sphere {sphere}", "time [ms]", "velocity [m/s]", lines)]
    return concluded(
        __file__, COLUMNS, tuple(rows), panels(figure, size=(8, 3.4)), off=off, mesh=mesh,
    )  # fmt: skip


def as_solid(scene: Scene, options: SolidPlateOptions) -> Scene:
    """The scene's plate as a body of its own, its sides held."""
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
        "reduction": {"error": options.error},
        "mesh": {"scale": options.scale},
    }
    return resolved(tables, tables["name"])
