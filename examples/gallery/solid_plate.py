"""A clamped plate by Mindlin's theory, and as a solid of finite elements struck at the same point.

You will see how near the theory comes to the solid in frequencies, static compliance and the first
reflected wave. The theory is that of the scene's [plate]; the solid is an assembly of one box whose
sides are held, run by the same stages as any scene.

Run it: python examples/gallery/solid_plate.py                         the scene plate, minutes
        python examples/gallery/solid_plate.py plate.thickness=4mm     with changes
"""

import sys
from pathlib import Path

import numpy as np

from beadwave import scene
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from observed import say

ERROR = 1e-3  # of the receptance, of both reductions
SCALE = 0.7  # of the solid's elements: coarse ones leave a percent in the modes
SHARED = ("chain", "striker", "contact", "leaf_springs", "preload", "time", "output", "damping")
COLUMNS = ("first_hz", "fifth_hz", "compliance_m_N", "contact_us", "tof_us", "arr")


def main(scale=SCALE, changes=()):
    """Numbers in order of COLUMNS, by Mindlin's theory and of the solid."""
    clamped = dict.fromkeys(("left", "right", "front", "back"), "clamped")
    reduction = {"modes": None, "cutoff": None, "error": ERROR}
    mindlin = scene("plate", changes).but(plate=clamped, reduction=reduction)
    models = {
        "Mindlin": pipeline_of(mindlin, quiet),
        "solid": pipeline_of(as_solid(mindlin, scale), quiet),
    }

    rows, lines = [], []
    for (theory, of), style in zip(models.items(), ("-", "--"), strict=True):
        hz, contact, wall = of("modes").omega / (2 * np.pi), of("waves").contact, of("wall")
        # static compliance at the contact: sum of (phi / omega)^2 over the elastic modes, and what
        # the residual has
        elastic = wall.omega > 0
        by_modes = np.sum((wall.phi[elastic] / wall.omega[elastic]) ** 2)
        rows.append((
            float(hz[0]), float(hz[4]), float(by_modes + wall.residual_compliance),
            1e6 * contact.contact_time.seconds, 1e6 * contact.tof, contact.arr,
        ))  # fmt: skip
        run, sphere = of("impact").trajectory, max(of.scene.output.spheres or (1,))
        lines.append(Line(theory, 1e3 * run.t, run.v[:, sphere - 1], style, len(lines), 1.2))

    theory, solid = np.array(rows)
    print(
        aligned_text(("theory", *COLUMNS), [(t, *row) for t, row in zip(models, rows, strict=True)])
    )
    off = dict(zip(COLUMNS, 100 * (theory / solid - 1), strict=True))
    say(f"""
        By Mindlin's theory the first reflected wave is {theory[4] - solid[4]:+.2f} µs and
        {off["arr"]:+.2f} % from the solid's in time of flight and amplitude ratio, the first and
        fifth frequencies {off["first_hz"]:+.2f} and {off["fifth_hz"]:+.2f} %, the static compliance
        at the contact {off["compliance_m_N"]:+.2f} %.
        """)
    if mindlin.time.dt is None:
        mesh = models["solid"]("mesh-error")
        say(f"The solid's mesh leaves an error of some {mesh:.2%} in its velocities.")
    figure = [Panel(f"sphere {sphere}", "time [ms]", "velocity [m/s]", lines)]
    Path("solid_plate.png").write_bytes(panels(figure, size=(8, 3.4)))
    return theory, solid


def as_solid(mindlin, scale):
    """The scene's plate as a body of its own, its sides held."""
    plate = mindlin.plate
    tables = {
        name: table.model_dump(exclude_none=True)
        for name in SHARED
        if (table := getattr(mindlin, name)) is not None
    }
    material = {"young": plate.young, "poisson": plate.poisson, "density": plate.density}
    return scene(tables | {
        "name": f"{mindlin.name}-solid",
        "wall": {"kind": "rom"},
        "assembly": {"held": [f"plate:{side}" for side in ("-x", "+x", "-y", "+y")],
                     "material": "its"},
        "materials": {"its": material},
        "bodies": {"plate": {"box": [plate.length, plate.width, plate.thickness]}},
        "strike": {"on": "plate:+z",
                   "at": [plate.at[0] - plate.length / 2, plate.at[1] - plate.width / 2]},
        "reduction": {"error": ERROR},
        "mesh": {"scale": scale},
    })  # fmt: skip


if __name__ == "__main__":
    main(changes=sys.argv[1:])
