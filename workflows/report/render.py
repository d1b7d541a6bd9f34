"""Rendered pictures of the assembly and its modes, from `modes.vtu`; run as a process of its own.

    python -m workflows.report.render modes.vtu bodies strike assembly.png modes.png

`strike` is point and direction, six numbers between commas, or nothing.
A render without a GL library kills its process: the run that started it loses the pictures only.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

from workflows.report.callouts import callouts

MEASURED = "measured"  # in the names of modes that are targets

EYE, UP = (1.0, -1.3, 0.55), (0.0, 0.0, 1.0)
STEEL = (
    "#b8c4d0", "#d98c3f", "#d9c77a", "#5f86ad", "#8fb08f", "#b88fa8", "#7fc4c4", "#a86b4f",
    "#c9a0dc", "#6f7f3f", "#e0a8a0", "#3f6f6f", "#8c8cc8", "#b0b070",
)  # fmt: skip
SIZE = (1500, 1050)
GRIDS = {0: (1, 1), 1: (1, 1), 2: (2, 1), 3: (2, 2), 4: (2, 2)}  # rows and columns of modes
CAPTION = "colour: displacement over the largest of the mode"
IMPACT = "#c8371b"
RAMP = ("#cfd5db", "#f3c35f", "#e2622f", "#8b1a3a")  # of displacements, as in the report page
EXAGGERATED = 0.05  # of the assembly's size: the largest displacement as drawn
BAR = {
    "vertical": True, "n_labels": 3, "fmt": "%.1f", "width": 0.05, "height": 0.5,
    "position_x": 0.9, "position_y": 0.08, "label_font_size": 14, "title_font_size": 1,
    "color": "black",
}  # fmt: skip
SPLIT = 4  # of the sides of a triangle, between points that tell which body is in front
BESIDE_BAR, BELOW_NAME = 0.87, 0.85  # shares of the view that a mode fills
MATT = {"ambient": 0.35, "diffuse": 0.75, "specular": 0.0}


def assembly(grid: pv.DataSet, names: list[str], strike: list[float], path: Path) -> None:
    """The mesh, each body in a colour of its own, with its dimensions and the arrow of impact."""
    plotter = _plotter((1, 1), SIZE)
    surfaces = []
    for i in range(len(names)):
        body = grid.extract_cells(grid.cell_data["body"] == i).extract_surface(algorithm=None)
        colour = STEEL[i % len(STEEL)]
        plotter.add_mesh(body, color=colour, show_edges=True, edge_color="#404040", **MATT)
        surfaces.append(body)
    _names(plotter, names, [_points(body) for body in surfaces])
    if strike:
        _arrow(plotter, np.array(strike[:3]), np.array(strike[3:]), 0.2 * grid.length)
    millimetres = [1e3 * x for x in grid.bounds]
    axes = plotter.show_bounds(
        axes_ranges=millimetres, xtitle="x [mm]", ytitle="y [mm]", ztitle="z [mm]", n_xlabels=3,
        n_ylabels=3, n_zlabels=3, fmt="%.0f", font_size=11, location="outer", color="#505050",
    )  # fmt: skip
    axes.SetAxisLabels(1, pv.convert_array(np.array(["", *axes.y_labels[1:]])))  # x has that corner
    _view(plotter)
    plotter.screenshot(path)


def _names(plotter: pv.Plotter, names: list[str], points: list[np.ndarray]) -> None:
    """Beside the assembly, each with a line to its body."""
    found = callouts(points, EYE, UP)
    for i, (name, callout) in enumerate(zip(names, found, strict=True)):
        colour = _dark(STEEL[i % len(STEEL)])
        text = name if callout.seen else f"{name} (hidden)"
        plotter.add_lines(np.array([callout.anchor, callout.text]), color=colour, width=2)
        plotter.add_point_labels(
            [callout.text], [text], font_size=20, text_color=colour, shape=None,
            always_visible=True, show_points=False, justification_vertical="center",
            justification_horizontal="right" if callout.left else "left",
        )  # fmt: skip
    dots = [callout.anchor for callout in found if callout.seen]
    plotter.add_points(np.array(dots), color="black", point_size=7)


def _points(body: pv.PolyData) -> np.ndarray:
    """Close enough on every facet to hide what is behind it."""
    triangles = body.triangulate()
    corners = triangles.points[triangles.regular_faces]
    shares = [(i, j, SPLIT - i - j) for i in range(SPLIT + 1) for j in range(SPLIT + 1 - i)]
    return np.einsum("sc,tcx->stx", np.array(shares) / SPLIT, corners).reshape(-1, 3)


def _arrow(plotter: pv.Plotter, tip: np.ndarray, along: np.ndarray, length: float) -> None:
    start = tip - length * along
    arrow = pv.Arrow(
        start=start, direction=along, scale=float(length), shaft_radius=0.025, tip_radius=0.07
    )
    plotter.add_mesh(arrow, color=IMPACT, **MATT)
    plotter.add_point_labels(
        [start - 0.3 * length * along], ["impact"], font_size=22, text_color=IMPACT, shape=None,
        show_points=False, always_visible=True, justification_horizontal="center",
        justification_vertical="center",
    )  # fmt: skip


def modes(grid: pv.DataSet, path: Path) -> None:
    """The measured modes, or the first ones, coloured by displacement, and the outline at rest."""
    names = [name for name in grid.point_data if name.startswith("mode ")]
    names = [name for name in names if MEASURED in name] or names
    rows, columns = GRIDS[min(len(names), 4)]
    plotter = _plotter((rows, columns), SIZE)
    for i, name in enumerate(names[:4]):
        plotter.subplot(i // columns, i % columns)
        _mode(plotter, grid, name)
    plotter.add_text(CAPTION, position="lower_left", font_size=8, color="black")
    plotter.screenshot(path)


def _mode(plotter: pv.Plotter, grid: pv.DataSet, name: str) -> None:
    u = grid.point_data[name]
    size = np.linalg.norm(u, axis=1)
    bent = grid.copy()
    bent.points = grid.points + EXAGGERATED * grid.length / size.max() * u
    bent[f"{name}: displacement"] = size / size.max()
    outline = grid.extract_surface(algorithm=None).extract_feature_edges(30)
    plotter.add_mesh(
        bent.extract_surface(algorithm=None),
        scalars=f"{name}: displacement",
        cmap=ramp(RAMP, 64),
        clim=(0, 1),
        scalar_bar_args={"title": f"{name}: displacement", **BAR},
        **MATT,
    )
    edges = bent.extract_surface(algorithm=None).extract_feature_edges(30)
    plotter.add_mesh(edges, color="#202020", line_width=1.5)
    plotter.add_mesh(outline, color="#909090", line_width=1.0)
    plotter.add_text(name, font_size=12, color="black")
    _view(plotter)
    _fill(plotter, np.concatenate([grid.points, bent.points]))


def ramp(colours: tuple[str, ...], n: int) -> list[str]:
    """n colours between these."""
    ends = np.array([pv.Color(colour).float_rgb for colour in colours])
    places = np.linspace(0, len(colours) - 1, n)
    channels = [np.interp(places, np.arange(len(colours)), channel) for channel in ends.T]
    return [pv.Color(colour).hex_rgb for colour in np.transpose(channels).tolist()]


def _dark(colour: str) -> list[float]:
    return [0.7 * share for share in pv.Color(colour).float_rgb]


def _plotter(shape: tuple[int, int], size: tuple[int, int]) -> pv.Plotter:
    plotter = pv.Plotter(off_screen=True, shape=shape, window_size=list(size), border=False)
    plotter.set_background("white")
    return plotter


def _view(plotter: pv.Plotter) -> None:
    plotter.view_vector(EYE, viewup=UP)
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.15)


def _fill(plotter: pv.Plotter, points: np.ndarray) -> None:
    """Show points (n, 3) as large as the part of the view beside the colour bar allows."""
    camera = plotter.camera
    towards = camera.direction
    across = np.cross(towards, camera.up) / np.linalg.norm(np.cross(towards, camera.up))
    axes = np.array([across, np.cross(across, towards)])
    low, high = (axes @ points.T).min(axis=1), (axes @ points.T).max(axis=1)
    width, height = high - low
    wide, tall = plotter.renderer.GetSize()
    room = wide / tall * BESIDE_BAR
    shift = axes.T @ ((low + high) / 2 - axes @ camera.focal_point)
    camera.focal_point, camera.position = camera.focal_point + shift, camera.position + shift
    camera.parallel_scale = 0.55 * max(height / BELOW_NAME, width / room)
    camera.SetWindowCenter(1 - BESIDE_BAR, 0.0)
    camera.reset_clipping_range()


def main(arguments: list[str]) -> None:
    field, names, strike, assembly_png, modes_png = arguments
    grid = pv.read(field)
    numbers = [float(number) for number in strike.split(",") if number]
    assembly(grid, names.split(","), numbers, Path(assembly_png))
    modes(grid, Path(modes_png))


if __name__ == "__main__":
    main(sys.argv[1:])
