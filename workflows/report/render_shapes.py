"""Measured and computed mode shapes, from `modes.vtu`; run as a child process.

    python -m beadwave.workflows.report.render_shapes modes.vtu shapes.json shapes.png

`shapes.json` is a list of `ModePair` as dictionaries, one for each mode of the file in its order.
"""

import json
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv

from beadwave.workflows.report.render import EDGE_ANGLE, EYE, IMPACT, MATT, bent_by, seen_from
from beadwave.workflows.report.render import white_plotter as plotter_of

VIEW = (520, 340)  # pixels of a view


class ModePair(NamedTuple):
    """A measured mode and the computed one that it is paired with."""

    measured: str  # what stands above the measured shape
    computed: str
    points: list[list[float]]  # (m, 3) [m]
    displacement: list[list[float]]  # (m, 3) in the sense of the computed mode


def shapes(
    grid: pv.DataSet, modes: list[ModePair], path: Path,
    ) -> None:  # fmt: skip
    """A pair of views for each mode: arrows at the points of the test on the outline at rest, and
    the computed mode; two pairs in a row where there are more than three."""
    names = [name for name in grid.point_data if name.startswith("mode ")]
    pairs = 2 if len(modes) > 3 else 1
    rows = -(-len(modes) // pairs)
    plotter = plotter_of((rows, 2 * pairs), (2 * pairs * VIEW[0], rows * VIEW[1]))
    skin = grid.extract_surface(algorithm=None)
    outline = skin.extract_feature_edges(EDGE_ANGLE)
    dot = 0.008  # radius of a point over the structure's size
    for i, (mode, name) in enumerate(zip(modes, names, strict=True)):
        row, pair = divmod(i, pairs)

        # the test: an arrow at each point that moves by more than the point is drawn large
        plotter.subplot(row, 2 * pair)
        points, u = np.array(mode.points), np.array(mode.displacement)
        # the longest arrow is 0.12 of the structure's size
        u = 0.12 * grid.length / np.linalg.norm(u, axis=1).max() * u
        plotter.add_mesh(skin, color="#dfe4e9", opacity=0.35, **MATT)
        plotter.add_mesh(outline, color="#909090", line_width=1.0)
        for point, along in zip(points, u, strict=True):
            plotter.add_mesh(pv.Sphere(dot * grid.length, center=point), color="#202020", **MATT)
            if (length := float(np.linalg.norm(along))) > 2 * dot * grid.length:
                arrow = pv.Arrow(
                    point, along, scale=length, shaft_radius=dot * grid.length / (2 * length),
                    tip_radius=1.5 * dot * grid.length / length,
                    tip_length=min(0.5, 4 * dot * grid.length / length),
                )  # fmt: skip
                plotter.add_mesh(arrow, color=IMPACT, **MATT)
        plotter.add_text(mode.measured, font_size=12, color="black")
        seen_from(plotter, np.array(EYE))

        # the computed mode next to it, from the same direction
        plotter.subplot(row, 2 * pair + 1)
        bent_by(plotter, grid, name)
        plotter.remove_scalar_bar(f"{name}: displacement")
        plotter.add_text(mode.computed, font_size=12, color="black")
        seen_from(plotter, np.array(EYE))
    plotter.screenshot(path)


def main(arguments: list[str]) -> None:
    """Render the picture that the command line names."""
    field, compared, image = map(Path, arguments)
    modes = [ModePair(**mode) for mode in json.loads(compared.read_text(encoding="utf-8"))]
    shapes(pv.read(field), modes, image)


if __name__ == "__main__":
    main(sys.argv[1:])
