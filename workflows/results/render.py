"""Rendered pictures of the assembly and its modes, from `modes.vtu`; run as a process of its own.

    python -m workflows.results.render modes.vtu bodies assembly.png modes.png

A render without a GL library kills its process: the run that started it loses the pictures only.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista as pv

STEEL = ("#b8c4d0", "#d98c3f", "#d9c77a", "#5f86ad", "#8fb08f", "#b88fa8")
SIZE = (1500, 1050)
GRIDS = {0: (1, 1), 1: (1, 1), 2: (2, 1), 3: (2, 2), 4: (2, 2)}  # rows and columns of modes
MATT = {"ambient": 0.35, "diffuse": 0.75, "specular": 0.0}


def assembly(grid: pv.DataSet, names: list[str], path: Path) -> None:
    """The mesh, each body in a colour of its own."""
    plotter = _plotter((1, 1), SIZE)
    for i, name in enumerate(names):
        body = grid.extract_cells(grid.cell_data["body"] == i).extract_surface(algorithm=None)
        colour = STEEL[i % len(STEEL)]
        plotter.add_mesh(body, color=colour, show_edges=True, edge_color="#404040", **MATT)
        plotter.add_text(
            name, position=(0.82, 0.93 - 0.04 * i), viewport=True, font_size=12, color=_dark(colour)
        )
    plotter.add_axes(line_width=3)
    _view(plotter)
    plotter.screenshot(path)


def modes(grid: pv.DataSet, path: Path) -> None:
    """The modes, coloured by displacement, beside the undeformed outline."""
    names = [name for name in grid.point_data if name.startswith("mode ")]
    rows, columns = GRIDS[min(len(names), 4)]
    plotter = _plotter((rows, columns), SIZE)
    for i, name in enumerate(names[:4]):
        plotter.subplot(i // columns, i % columns)
        _mode(plotter, grid, name)
    plotter.screenshot(path)


def _mode(plotter: pv.Plotter, grid: pv.DataSet, name: str) -> None:
    u = grid.point_data[name]
    size = np.linalg.norm(u, axis=1)
    factor = 0.08 * grid.length / size.max()
    bent = grid.copy()
    bent.points = grid.points + factor * u
    bent["displacement"] = size / size.max()
    plotter.add_mesh(
        bent.extract_surface(algorithm=None),
        scalars="displacement",
        cmap="viridis",
        show_scalar_bar=False,
        **MATT,
    )
    outline = grid.extract_surface(algorithm=None).extract_feature_edges(30)
    plotter.add_mesh(outline, color="#606060", line_width=1.5)
    plotter.add_text(name, font_size=12, color="black")
    _view(plotter)


def _dark(colour: str) -> list[float]:
    return [0.7 * share for share in pv.Color(colour).float_rgb]


def _plotter(shape: tuple[int, int], size: tuple[int, int]) -> pv.Plotter:
    plotter = pv.Plotter(off_screen=True, shape=shape, window_size=list(size), border=False)
    plotter.set_background("white")
    return plotter


def _view(plotter: pv.Plotter) -> None:
    plotter.view_vector((1.0, -1.3, 0.55), viewup=(0, 0, 1))
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.15)


def main(arguments: list[str]) -> None:
    field, names, assembly_png, modes_png = arguments
    grid = pv.read(field)
    assembly(grid, names.split(","), Path(assembly_png))
    modes(grid, Path(modes_png))


if __name__ == "__main__":
    main(sys.argv[1:])
