"""Rendered pictures of the assembly and its modes, from `modes.vtu`; run as a child process.

    python -m workflows.report.render modes.vtu bodies strike assembly.png modes.png

`strike` is point and direction, six numbers between commas, or nothing.
A render without a GL library kills its process: the run that started it loses the pictures only.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv

from workflows.report.callouts import callouts

MEASURED = "measured"  # in the names of modes that are targets
EYE, UP = (1.0, -1.3, 0.55), (0.0, 0.0, 1.0)
SIZE = (1500, 1050)  # in pixels
GRIDS = {0: (1, 1), 1: (1, 1), 2: (2, 1), 3: (2, 2), 4: (2, 2)}  # rows and columns of modes
STEEL = (
    "#b8c4d0", "#d98c3f", "#d9c77a", "#5f86ad", "#8fb08f", "#b88fa8", "#7fc4c4", "#a86b4f",
    "#c9a0dc", "#6f7f3f", "#e0a8a0", "#3f6f6f", "#8c8cc8", "#b0b070",
)  # fmt: skip
IMPACT = "#c8371b"
RAMP = ("#cfd5db", "#f3c35f", "#e2622f", "#8b1a3a")  # of displacements, as in the report page
MATT = {"ambient": 0.35, "diffuse": 0.75, "specular": 0.0}
BAR = {
    "vertical": True, "n_labels": 3, "fmt": "%.1f", "width": 0.05, "height": 0.5,
    "position_x": 0.9, "position_y": 0.08, "label_font_size": 14, "title_font_size": 1,
    "color": "black",
}  # fmt: skip


class RenderSettings(NamedTuple):
    """How bodies and modes are drawn, chosen by eye."""

    split: int = 4  # of a triangle's sides, between the points that tell which body is in front
    arrow: float = 0.2  # length of the arrow of impact over the assembly's size
    largest_mode: float = 0.05  # largest displacement of a mode as drawn over the assembly's size
    edge_angle: float = 30.0  # [deg] between facets that makes an edge of an outline
    width: float = 0.87  # share of the view that a mode fills, beside its colour bar
    height: float = 0.85  # the same below its name


def assembly(
    grid: pv.DataSet,
    names: list[str],
    strike: list[float],
    path: Path,
    settings: RenderSettings = RenderSettings(),
) -> None:
    """The mesh, each body in a colour of its own, with its dimensions and the arrow of impact."""
    plotter, n = _plotter((1, 1)), settings.split
    shares = [(i / n, j / n, (n - i - j) / n) for i in range(n + 1) for j in range(n + 1 - i)]
    points = []
    for i in range(len(names)):
        body = grid.extract_cells(grid.cell_data["body"] == i).extract_surface(algorithm=None)
        colour = STEEL[i % len(STEEL)]
        plotter.add_mesh(body, color=colour, show_edges=True, edge_color="#404040", **MATT)

        # points close enough on every facet to hide what is behind it
        triangles = body.triangulate()
        corners = triangles.points[triangles.regular_faces]
        points.append(np.einsum("sc,tcx->stx", shares, corners).reshape(-1, 3))

    # names beside the assembly, each with a line to its body, a dot where that is visible
    labels = callouts(points, EYE, UP)
    for i, (name, label) in enumerate(zip(names, labels, strict=True)):
        dark = [0.7 * channel for channel in pv.Color(STEEL[i % len(STEEL)]).float_rgb]
        plotter.add_lines(np.array([label.anchor, label.text]), color=dark, width=2)
        plotter.add_point_labels(
            [label.text], [name if label.seen else f"{name} (hidden)"], font_size=20,
            text_color=dark, shape=None, always_visible=True, show_points=False,
            justification_vertical="center",
            justification_horizontal="right" if label.left else "left",
        )  # fmt: skip
    dots = [label.anchor for label in labels if label.seen]
    plotter.add_points(np.array(dots), color="black", point_size=7)

    if strike:
        tip, direction = np.array(strike[:3]), np.array(strike[3:])
        length = settings.arrow * grid.length
        start = tip - length * direction
        arrow = pv.Arrow(
            start=start, direction=direction, scale=float(length), shaft_radius=0.025,
            tip_radius=0.07,
        )  # fmt: skip
        plotter.add_mesh(arrow, color=IMPACT, **MATT)
        plotter.add_point_labels(
            [start - 0.3 * length * direction], ["impact"], font_size=22, text_color=IMPACT,
            shape=None, show_points=False, always_visible=True,
            justification_horizontal="center", justification_vertical="center",
        )  # fmt: skip

    millimetres = [1e3 * x for x in grid.bounds]
    axes = plotter.show_bounds(
        axes_ranges=millimetres, xtitle="x [mm]", ytitle="y [mm]", ztitle="z [mm]", n_xlabels=3,
        n_ylabels=3, n_zlabels=3, fmt="%.0f", font_size=11, location="outer", color="#505050",
    )  # fmt: skip
    axes.SetAxisLabels(1, pv.convert_array(np.array(["", *axes.y_labels[1:]])))  # x has that corner
    _view(plotter)
    plotter.screenshot(path)


def modes(grid: pv.DataSet, path: Path, settings: RenderSettings = RenderSettings()) -> None:
    """The measured modes, or the first ones, coloured by displacement, and the outline at rest."""
    names = [name for name in grid.point_data if name.startswith("mode ")]
    names = [name for name in names if MEASURED in name] or names
    rows, columns = GRIDS[min(len(names), 4)]
    plotter = _plotter((rows, columns))
    for i, name in enumerate(names[:4]):
        plotter.subplot(i // columns, i % columns)

        # the mode, exaggerated, on the outline at rest
        u = grid.point_data[name]
        size = np.linalg.norm(u, axis=1)
        bent = grid.copy()
        bent.points = grid.points + settings.largest_mode * grid.length / size.max() * u
        title = f"{name}: displacement"
        bent[title] = size / size.max()
        surface = bent.extract_surface(algorithm=None)
        plotter.add_mesh(
            surface, scalars=title, cmap=ramp(RAMP, 64), clim=(0, 1),
            scalar_bar_args={"title": title, **BAR}, **MATT,
        )  # fmt: skip
        edges = surface.extract_feature_edges(settings.edge_angle)
        at_rest = grid.extract_surface(algorithm=None).extract_feature_edges(settings.edge_angle)
        plotter.add_mesh(edges, color="#202020", line_width=1.5)
        plotter.add_mesh(at_rest, color="#909090", line_width=1.0)
        plotter.add_text(name, font_size=12, color="black")
        _view(plotter)

        # as large as the part of the view beside the colour bar and below the name allows
        camera = plotter.camera
        across = np.cross(camera.direction, camera.up)
        across = across / np.linalg.norm(across)
        axes = np.array([across, np.cross(across, camera.direction)])
        places = axes @ np.concatenate([grid.points, bent.points]).T
        low, high = places.min(axis=1), places.max(axis=1)
        shift = axes.T @ ((low + high) / 2 - axes @ camera.focal_point)
        camera.focal_point, camera.position = camera.focal_point + shift, camera.position + shift
        width, height = high - low
        window_width, window_height = plotter.renderer.GetSize()
        room = window_width / window_height * settings.width
        camera.parallel_scale = 0.55 * max(height / settings.height, width / room)
        camera.SetWindowCenter(1 - settings.width, 0.0)
        camera.reset_clipping_range()

    caption = "colour: displacement over the largest of the mode"
    plotter.add_text(caption, position="lower_left", font_size=8, color="black")
    plotter.screenshot(path)


def ramp(colours: tuple[str, ...], n: int) -> list[str]:
    """n colours, as hexadecimal texts, interpolated between the given ones."""
    ends = np.array([pv.Color(colour).float_rgb for colour in colours])
    places = np.linspace(0, len(colours) - 1, n)
    channels = [np.interp(places, np.arange(len(colours)), channel) for channel in ends.T]
    return [pv.Color(colour).hex_rgb for colour in np.transpose(channels).tolist()]


def _plotter(shape: tuple[int, int]) -> pv.Plotter:
    """A white picture of rows and columns of views."""
    plotter = pv.Plotter(off_screen=True, shape=shape, window_size=list(SIZE), border=False)
    plotter.set_background("white")
    return plotter


def _view(plotter: pv.Plotter) -> None:
    """Everything from the right, the front and above, in parallel projection."""
    plotter.view_vector(EYE, viewup=UP)
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.15)


def main(arguments: list[str]) -> None:
    """Render the pictures that the command line names."""
    field, names, strike, assembly_png, modes_png = arguments
    grid = pv.read(field)
    numbers = [float(number) for number in strike.split(",") if number]
    assembly(grid, names.split(","), numbers, Path(assembly_png))
    modes(grid, Path(modes_png))


if __name__ == "__main__":
    main(sys.argv[1:])
