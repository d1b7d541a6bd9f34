"""Rendered pictures of the assembly and its modes, from `modes.vtu`; run as a child process.

    python -m beadwave.workflows.report.render modes.vtu fixtures.json assembly.png modes.png \
        [mesh-error.png]

`fixtures.json` is a `Fixtures` as a dictionary.
A render without a GL library kills its process: the run that started it loses the pictures only.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from beadwave.workflows.report.callouts import callouts

MEASURED = "measured"  # in the names of modes that are targets
EYE, UP = (1.0, -1.3, 0.55), (0.0, 0.0, 1.0)  # towards the eye where nothing is struck
SIZE = (1500, 1050)  # in pixels
GRIDS = {0: (1, 1), 1: (1, 1), 2: (2, 1), 3: (2, 2), 4: (2, 2)}  # rows and columns of modes
STEEL = (
    "#b8c4d0", "#d98c3f", "#d9c77a", "#5f86ad", "#8fb08f", "#b88fa8", "#7fc4c4", "#a86b4f",
    "#c9a0dc", "#6f7f3f", "#e0a8a0", "#3f6f6f", "#8c8cc8", "#b0b070",
)  # fmt: skip
IMPACT, SPHERE, HELD, BOLT = "#c8371b", "#9aa7b4", "#1f5fbf", "#202020"
GREY = "#505050"  # of dimensions
SPRING, MASS, PART = "#2f7d4f", "#7a3f9d", "#a3195b"
RAMP = ("#cfd5db", "#f3c35f", "#e2622f", "#8b1a3a")  # of displacements, as in the report page
MATT = {"ambient": 0.35, "diffuse": 0.75, "specular": 0.0}
BAR = {
    "vertical": True, "n_labels": 3, "fmt": "%.1f", "width": 0.05, "height": 0.5,
    "position_x": 0.9, "position_y": 0.08, "label_font_size": 14, "title_font_size": 1,
    "color": "black",
}  # fmt: skip


# Looks of bodies and modes, chosen by eye
SPLIT = 4  # of a triangle's sides, between the points that tell which body is in front
CHAIN_LENGTH = 1.3  # most length of the chain that is drawn over the assembly's size
# length of the pin at a joint over the assembly's size: longer than most covers are thick
PIN_LENGTH = 0.09
PIN_RADIUS = 0.1  # radius of that pin over its length
SHORT_SIDE = 0.12  # side of the assembly over its size that has no room for three numbers
FLAT = 0.05  # height of the assembly over its size that has no room for two lines of text
TICK = 0.01  # length of the marks of heights over the assembly's size
# of a spring to the ground over the assembly's size, and of any coil: turns, radius and wire
# over the assembly's size
SPRING_LENGTH = 0.16
N_TURNS = 7
PIN_OPACITY = 0.4  # opacity of a pin that is behind a face
COIL = (0.013, 0.003)
MIN_MASS_RADIUS = 0.012  # radius of a mass as drawn over the assembly's size
VIEW_SLANT = 52.0  # [deg] of the view from the direction of the impact, about the vertical
EYE_HEIGHT = 0.55  # height of the eye over its distance along the ground
DECADES = 3  # of energies, that colours tell apart
MODE_AMPLITUDE = 0.05  # largest displacement of a mode as drawn over the assembly's size
EDGE_ANGLE = 30.0  # [deg] between facets that makes an edge of an outline
MODE_VIEW = (0.87, 0.85)  # shares of the view's width and height that it fills
ASSEMBLY_VIEW = (0.95, 0.8)  # the same, with labels and below the legend
LETTER_WIDTH = 0.0085  # width of a letter of a label over the view's, about


class Fixtures(NamedTuple):
    """Things that a picture shows besides the meshes."""

    bodies: list[str]
    elements: bool = True  # whether the cells of bodies are elements
    strike: list[float] | None = None  # point struck and direction of the force (6,)
    spheres: Sequence[float] = ()  # radii [m], from the wall on
    # the same two of further chains
    further: Sequence[tuple[list[float], Sequence[float]]] = ()
    joints: Sequence[tuple[str, list[float], list[float]]] = ()  # name, centre (3,), axis (3,)
    held: Sequence[list[list[float]]] = ()  # facets of held faces, corners (n, 3) each
    # name, point (3,), the other end (3,), or of one to the ground the direction (3,) to it
    springs: Sequence[tuple[str, list[float], list[float], bool]] = ()
    masses: Sequence[tuple[str, list[float], list[float], float]] = ()  # name, point, out, radius
    parts: Sequence[tuple[str, list[float], list[float]]] = ()  # measured: name, point, out
    missed: Sequence[float] = ()  # energy that the mesh misses in each element


def eye_of(strike: list[float] | None) -> NDArray[np.float64]:
    """Direction (3,) towards the eye: from the side that is struck, and from above, or from below
    where the impact comes from there."""
    if strike is None:
        return np.array(EYE)
    outward = -np.array(strike[3:])
    along = outward[:2] if np.hypot(*outward[:2]) > 0.3 else np.array([1.0, 0.0])
    angle = np.arctan2(along[1], along[0]) - np.radians(VIEW_SLANT)
    above = -EYE_HEIGHT if outward[2] < -0.7 else EYE_HEIGHT
    return np.array([np.cos(angle), np.sin(angle), above])


def round_the_edge(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """The corners (n, 3) of a convex facet in the order of its edges."""
    away = corners - corners.mean(axis=0)
    x = away[0] / np.linalg.norm(away[0])
    beside = [a - (a @ x) * x for a in away]
    y = max(beside, key=np.linalg.norm)
    return corners[np.argsort(np.arctan2(away @ y / np.linalg.norm(y), away @ x))]


def coil(
    start: NDArray[np.float64], end: NDArray[np.float64], radius: float, turns: int
) -> NDArray[np.float64]:
    """Points (n, 3) of a helical spring from start to end (3,), straight at both ends."""
    axis = end - start
    length = np.linalg.norm(axis)
    axis = axis / length
    across = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    across = across / np.linalg.norm(across)
    beside = np.cross(axis, across)
    t = np.linspace(0.0, 1.0, 40 * turns)
    swing = radius * np.clip(np.minimum(t, 1 - t) / 0.12, 0.0, 1.0)[:, None]
    angle = 2 * np.pi * turns * t[:, None]
    around = np.cos(angle) * across + np.sin(angle) * beside
    return start + t[:, None] * length * axis + swing * around


def held_faces(plotter: pv.Plotter, fixtures: Fixtures) -> list[tuple[str, str]]:
    """Held faces outlined; what the legend says of them."""
    if not fixtures.held:
        return []
    facets = [round_the_edge(np.array(facet)) for facet in fixtures.held]
    first = np.cumsum([0, *(len(facet) for facet in facets)]).tolist()
    cells = [[b - a, *range(a, b)] for a, b in pairwise(first)]
    faces = pv.PolyData(np.concatenate(facets), np.concatenate(cells)).clean()
    outline = faces.extract_feature_edges(EDGE_ANGLE, manifold_edges=False, feature_edges=False)
    plotter.add_mesh(outline, color=HELD, line_width=7, render_lines_as_tubes=True)
    return [("held face", HELD)]


def bolts(plotter: pv.Plotter, fixtures: Fixtures, size: float) -> list[tuple[str, str]]:
    """A pin at each joint, also seen through the bodies around it; what the legend says."""
    if not fixtures.joints:
        return []
    for _, centre, axis in fixtures.joints:
        length = PIN_LENGTH * size
        pin = pv.Cylinder(center=centre, direction=axis, radius=PIN_RADIUS * length, height=length)
        plotter.add_mesh(pin, color=BOLT, **MATT)
        # also seen through the bodies around it
        shade = plotter.add_mesh(pin, color=BOLT, opacity=PIN_OPACITY, lighting=False).mapper
        shade.SetResolveCoincidentTopologyToPolygonOffset()
        shade.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, -1e5)
    return [(f"joints: {_numbered(name for name, *_ in fixtures.joints)}", BOLT)]


def springs(plotter: pv.Plotter, fixtures: Fixtures, size: float) -> list[tuple[str, str]]:
    """A coil for each spring, with a plate where it stands on the ground; what the legend says."""
    if not fixtures.springs:
        return []
    for _, start, other, grounded in fixtures.springs:
        radius, wire = (share * size for share in COIL)
        end = np.array(start) + SPRING_LENGTH * size * np.array(other)
        end = end if grounded else np.array(other)
        path_of_wire = pv.lines_from_points(coil(np.array(start), end, radius, N_TURNS))
        plotter.add_mesh(path_of_wire.tube(radius=wire), color=SPRING, **MATT)
        if grounded:
            plate = pv.Cylinder(center=end, direction=other, radius=1.6 * radius, height=2 * wire)
            plotter.add_mesh(plate, color=SPRING, **MATT)
    return [(f"springs: {_numbered(name for name, *_ in fixtures.springs)}", SPRING)]


def measured_parts(plotter: pv.Plotter, fixtures: Fixtures, size: float) -> list[tuple[str, str]]:
    """A rod that ends in a ball at each point of a measured part; what the legend says."""
    if not fixtures.parts:
        return []
    for _, point, out in fixtures.parts:
        # a rod that ends in a ball: what is behind it is known by its responses alone
        length, radius = (share * size for share in (0.6 * SPRING_LENGTH, COIL[0]))
        end = np.array(point) + length * np.array(out)
        rod = pv.Cylinder(
            center=0.5 * (np.array(point) + end), direction=out, radius=0.4 * radius, height=length
        )
        plotter.add_mesh(rod, color=PART, **MATT)
        plotter.add_mesh(pv.Sphere(radius=1.3 * radius, center=end), color=PART, **MATT)
    named = _numbered(name for name, *_ in fixtures.parts)
    return [(f"points of measured parts: {named}", PART)]


def masses(plotter: pv.Plotter, fixtures: Fixtures, size: float) -> list[tuple[str, str]]:
    """A disc for each mass on a face; what the legend says."""
    if not fixtures.masses:
        return []
    for _, point, out, radius in fixtures.masses:
        radius = max(radius, MIN_MASS_RADIUS * size)
        body = pv.Cylinder(
            center=np.array(point) + 0.5 * radius * np.array(out), direction=out, radius=radius,
            height=radius,
        )  # fmt: skip
        plotter.add_mesh(body, color=MASS, **MATT)
    return [(f"masses: {_numbered(name for name, *_ in fixtures.masses)}", MASS)]


def struck(plotter: pv.Plotter, fixtures: Fixtures, size: float) -> list[tuple[str, str]]:
    """The spheres of each chain, as far as there is room, and an arrow along its impact; what the
    legend says."""
    if not fixtures.strike:
        return []
    counts, drawn = [], 0
    for strike, radii in ((fixtures.strike, fixtures.spheres), *fixtures.further):
        point, direction, depth = np.array(strike[:3]), np.array(strike[3:]), 0.0
        for radius in radii:
            if depth and depth + 2 * radius > CHAIN_LENGTH * size:
                break
            drawn += 1
            sphere = pv.Sphere(radius=radius, center=point - (depth + radius) * direction)
            plotter.add_mesh(sphere, color=SPHERE, smooth_shading=True, **MATT)
            depth += 2 * radius
        arrow = pv.Arrow(
            start=point - (depth + 0.1 * size) * direction, direction=direction,
            scale=0.09 * size, shaft_radius=0.05, tip_radius=0.14, tip_length=0.4,
        )  # fmt: skip
        plotter.add_mesh(arrow, color=IMPACT, **MATT)
        counts.append(len(radii))
    several = len(counts) > 1
    if not any(counts):
        return [("impacts" if several else "impact", IMPACT)]
    chains = "impacts of chains of" if several else "impact of a chain of"
    all_drawn = "" if drawn == sum(counts) else f", {drawn} drawn"
    return [(f"{chains} {' and '.join(map(str, counts))}{all_drawn}", IMPACT)]


def dimensions(
    plotter: pv.Plotter, grid: pv.DataSet, eye: NDArray[np.float64], on_left: bool
) -> None:
    """Axes in mm around the assembly: three numbers along a side, or both ends of a short one; of
    heights three on the left, both ends on the right, where the chain may pass in between."""
    # to a micrometre: an end at -1e-17 m is 0, not -0
    millimetres = [round(1e3 * x, 3) + 0.0 for x in grid.bounds]
    sides = np.diff(np.reshape(grid.bounds, (3, 2)), axis=1)[:, 0]
    numbers = np.where(sides > SHORT_SIDE * grid.length, 3, 2).tolist()
    axes = plotter.show_bounds(
        bounds=grid.bounds, axes_ranges=millimetres, xtitle="x [mm]", ytitle="y [mm]",
        ztitle="", show_zlabels=False, n_xlabels=numbers[0], n_ylabels=numbers[1],
        fmt="%.0f", font_size=11, location="outer", color=GREY,
    )  # fmt: skip
    axes.SetAxisLabels(1, pv.convert_array(np.array(["", *axes.y_labels[1:]])))  # x has that corner
    axes.SetZAxisVisibility(False)

    # the upright edge of the box that is outermost in the picture
    right = np.cross(UP, eye)
    right /= np.linalg.norm(right)
    outward = -right if on_left else right
    corners = np.array([[x, y] for x in grid.bounds[:2] for y in grid.bounds[2:4]])
    foot = corners[np.argmax(corners @ outward[:2])]
    heights = np.linspace(*grid.bounds[4:], numbers[2] if on_left else 2)
    edge = np.column_stack([np.tile(foot, (len(heights), 1)), heights])
    ticks = edge + TICK * grid.length * outward
    plotter.add_lines(edge[[0, -1]], color=GREY, width=1)
    for start, end in zip(edge, ticks, strict=True):
        plotter.add_lines(np.array([start, end]), color=GREY, width=1)
    texts = [f"{1e3 * z:.4g}" for z in np.round(heights, 6) + 0.0]
    if sides[2] < FLAT * grid.length:  # no room for two lines of text
        ticks, texts = ticks[-1:], [f"z = {texts[0]} to {texts[-1]} mm"]
    else:
        texts[-1] = f"z = {texts[-1]} mm"
    plotter.add_point_labels(
        ticks, [_apart(text, on_left) for text in texts], font_size=18, text_color=GREY, bold=False,
        shape=None, always_visible=True, show_points=False, justification_vertical="center",
        justification_horizontal="right" if on_left else "left",
    )  # fmt: skip


def _apart(text: str, on_left: bool) -> str:
    """The text with a space between it and the point that it stands on the left or right of."""
    return f"{text} " if on_left else f" {text}"


def assembly(grid: pv.DataSet, fixtures: Fixtures, path: Path) -> None:
    """The mesh, each body in a colour of its own, with its dimensions, the chain that strikes it,
    pins where bolts are and held faces outlined."""
    plotter, n, names = white_plotter((1, 1)), SPLIT, fixtures.bodies
    eye = eye_of(fixtures.strike)
    shares = [(i / n, j / n, (n - i - j) / n) for i in range(n + 1) for j in range(n + 1 - i)]
    points = []
    for i in range(len(names)):
        body = grid.extract_cells(grid.cell_data["body"] == i).extract_surface(algorithm=None)
        colour = STEEL[i % len(STEEL)]
        # the triangles of a body without a mesh are no elements: its own edges are shown
        drawn = {"show_edges": fixtures.elements, "edge_color": "#404040"}
        plotter.add_mesh(body, color=colour, **drawn, **MATT)
        if not fixtures.elements:
            edges = body.extract_feature_edges(EDGE_ANGLE, manifold_edges=False)
            if edges.n_points:  # a ball has none
                plotter.add_mesh(edges, color="#404040", line_width=1.5)

        # points close enough on every facet to hide what is behind it
        triangles = body.triangulate()
        corners = triangles.points[triangles.regular_faces]
        points.append(np.einsum("sc,tcx->stx", shares, corners).reshape(-1, 3))

    # names beside the assembly, each with a line to its body, a dot where that is visible
    from_chain = -np.array(fixtures.strike[3:]) if fixtures.strike and fixtures.spheres else None
    labels = callouts(points, eye, UP, occupied=from_chain)
    for i, (name, label) in enumerate(zip(names, labels, strict=True)):
        dark = [0.7 * channel for channel in pv.Color(STEEL[i % len(STEEL)]).float_rgb]
        plotter.add_lines(np.array([label.anchor, label.text]), color=dark, width=2)
        if label.seen:
            dot = {"point_size": 11, "render_points_as_spheres": True}
            plotter.add_points(label.anchor[None], color=dark, **dot)
        plotter.add_point_labels(
            [label.text], [_apart(name if label.seen else f"{name} (hidden)", label.left)],
            font_size=20, text_color=dark, shape=None, always_visible=True, show_points=False,
            justification_vertical="center",
            justification_horizontal="right" if label.left else "left",
        )  # fmt: skip

    # what is fastened to the bodies, each kind with its entry in the legend
    legend = [
        *held_faces(plotter, fixtures),
        *bolts(plotter, fixtures, grid.length),
        *springs(plotter, fixtures, grid.length),
        *measured_parts(plotter, fixtures, grid.length),
        *masses(plotter, fixtures, grid.length),
        *struck(plotter, fixtures, grid.length),
    ]
    if legend:
        size = 0.3, 0.033 * len(legend)
        plotter.add_legend(legend, bcolor=None, face="rectangle", loc="upper left", size=size)

    # heights across from the names
    names_on_left = any(label.left for label in labels)
    dimensions(plotter, grid, eye, not names_on_left)
    seen_from(plotter, eye)

    # of the view's width, what the z axis or names take on either side
    beside = {names_on_left: 0.04, not names_on_left: 0.08}
    for name, label in zip(names, labels, strict=True):
        letters = len(name) + (0 if label.seen else len(" (hidden)"))
        beside[label.left] = max(beside[label.left], LETTER_WIDTH * letters)
    width, height = ASSEMBLY_VIEW
    fill_view(
        plotter, np.concatenate([mesh.points for mesh in plotter.meshes]),
        (width - sum(beside.values()), height),
    )  # fmt: skip
    plotter.camera.SetWindowCenter(beside[False] - beside[True], 0.045 * len(legend))
    plotter.screenshot(path)


def _numbered(names: Iterable[str]) -> str:
    """Each name once, with how often it comes: "cover (4), foot (2)"."""
    return ", ".join(f"{name} ({n})" for name, n in Counter(names).items())


def modes(grid: pv.DataSet, fixtures: Fixtures, path: Path) -> None:
    """The measured modes, or the first ones, coloured by displacement, and the outline at rest."""
    names = [name for name in grid.point_data if name.startswith("mode ")]
    names = [name for name in names if MEASURED in name] or names
    rows, columns = GRIDS[min(len(names), 4)]
    plotter = white_plotter((rows, columns))
    for i, name in enumerate(names[:4]):
        plotter.subplot(i // columns, i % columns)

        bent = bent_by(plotter, grid, name)
        plotter.add_text(name, font_size=12, color="black")
        seen_from(plotter, eye_of(fixtures.strike))

        # beside the colour bar and below the name
        fill_view(plotter, np.concatenate([grid.points, bent.points]), MODE_VIEW)
        plotter.camera.SetWindowCenter(1 - MODE_VIEW[0], 0.0)

    caption = "colour: displacement over the largest of the mode"
    plotter.add_text(caption, position="lower_left", font_size=8, color="black")
    plotter.screenshot(path)


def mesh_error(grid: pv.DataSet, fixtures: Fixtures, path: Path) -> None:
    """The elements, coloured by the energy per volume that each misses."""
    plotter, title = white_plotter((1, 1)), "missed"
    density = np.array(fixtures.missed) / grid.compute_cell_sizes()["Volume"]
    share = density / max(density.max(), 1e-300)
    shown = grid.copy()
    shown.cell_data[title] = np.log10(np.maximum(share, 10.0**-DECADES))
    surface = shown.extract_surface(algorithm=None)
    plotter.add_mesh(
        surface, scalars=title, cmap=ramp(RAMP, 64), clim=(-DECADES, 0), show_edges=True,
        edge_color="#404040", line_width=0.5, scalar_bar_args={"title": title, **BAR}, **MATT,
    )  # fmt: skip
    seen_from(plotter, eye_of(fixtures.strike))
    fill_view(plotter, grid.points, MODE_VIEW)
    plotter.camera.SetWindowCenter(1 - MODE_VIEW[0], 0.0)
    caption = "colour: energy missed per volume over the largest, as a power of ten"
    plotter.add_text(caption, position="lower_left", font_size=8, color="black")
    plotter.screenshot(path)


def bent_by(plotter: pv.Plotter, grid: pv.DataSet, name: str) -> pv.DataSet:
    """Draw a mode, exaggerated and coloured by displacement, on the outline at rest; the bent
    mesh."""
    u = grid.point_data[name]
    size = np.linalg.norm(u, axis=1)
    bent = grid.copy()
    bent.points = grid.points + MODE_AMPLITUDE * grid.length / size.max() * u
    title = f"{name}: displacement"
    bent[title] = size / size.max()
    surface = bent.extract_surface(algorithm=None)
    plotter.add_mesh(
        surface, scalars=title, cmap=ramp(RAMP, 64), clim=(0, 1),
        scalar_bar_args={"title": title, **BAR}, **MATT,
    )  # fmt: skip
    edges = surface.extract_feature_edges(EDGE_ANGLE)
    at_rest = grid.extract_surface(algorithm=None).extract_feature_edges(EDGE_ANGLE)
    plotter.add_mesh(edges, color="#202020", line_width=1.5)
    plotter.add_mesh(at_rest, color="#909090", line_width=1.0)
    return bent


def ramp(colours: tuple[str, ...], n: int) -> list[str]:
    """n colours, as hexadecimal texts, interpolated between the given ones."""
    ends = np.array([pv.Color(colour).float_rgb for colour in colours])
    places = np.linspace(0, len(colours) - 1, n)
    channels = [np.interp(places, np.arange(len(colours)), channel) for channel in ends.T]
    return [pv.Color(colour).hex_rgb for colour in np.transpose(channels).tolist()]


def white_plotter(shape: tuple[int, int], size: tuple[int, int] = SIZE) -> pv.Plotter:
    """A white picture of rows and columns of views."""
    plotter = pv.Plotter(off_screen=True, shape=shape, window_size=list(size), border=False)
    plotter.set_background("white")
    return plotter


def seen_from(plotter: pv.Plotter, eye: NDArray[np.float64], zoom: float = 1.15) -> None:
    """Everything from the direction `eye` (3,), in parallel projection; labels of axes need some
    room, a smaller `zoom`."""
    plotter.view_vector(eye, viewup=UP)
    plotter.enable_parallel_projection()
    plotter.camera.zoom(zoom)


def fill_view(
    plotter: pv.Plotter, points: NDArray[np.float64], shares: tuple[float, float]
) -> None:
    """Points (n, 3) in the middle of the view, filling it up to shares of its width and height."""
    camera = plotter.camera
    across = np.cross(camera.direction, camera.up)
    across = across / np.linalg.norm(across)
    axes = np.array([across, np.cross(across, camera.direction)])
    places = axes @ points.T
    low, high = places.min(axis=1), places.max(axis=1)
    shift = axes.T @ ((low + high) / 2 - axes @ camera.focal_point)
    camera.focal_point, camera.position = camera.focal_point + shift, camera.position + shift
    width, height = high - low
    window_width, window_height = plotter.renderer.GetSize()
    room = window_width / window_height * shares[0]
    camera.parallel_scale = 0.55 * max(height / shares[1], width / room)
    camera.reset_clipping_range()


def main(arguments: list[str]) -> None:
    """Render the pictures that the command line names."""
    field, fixtures_json, assembly_png, modes_png, *mesh_error_png = map(Path, arguments)
    grid, fixtures = (
        pv.read(field),
        Fixtures(**json.loads(fixtures_json.read_text(encoding="utf-8"))),
    )
    assembly(grid, fixtures, assembly_png)
    modes(grid, fixtures, modes_png)
    for path in mesh_error_png:
        mesh_error(grid, fixtures, path)


if __name__ == "__main__":
    main(sys.argv[1:])
