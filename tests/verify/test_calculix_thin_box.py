"""A box of thin walls whose lid four screws hold on small washers: the error stated of a mesh that
mesh.error leads to, beside hexahedra of two sizes that CalculiX solves.

A quarter of the box, in hexahedra of our own drawing, has the modes that are symmetric about both
planes of symmetry. The box and its walls are one mesh, the lid is another; around each washer and
through the lid elements become small towards the washer's rim, where stresses are singular.
"""

import numpy as np
import pytest
from skfem import MeshHex

from beadwave import fem
from beadwave.fem.exchange.abaqus import input_deck
from beadwave.geometry.meshing.grid_lines import Stop, lines_through, refined
from beadwave.geometry.own_mesh.facets import EXTRUDED
from beadwave.workflows.evidence.harness import Comparison
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet

from peer_programs import require_program
from programs.calculix import PACKAGE, PROGRAM, answer

pytestmark = [pytest.mark.peer, pytest.mark.usefixtures("shared_cache")]

A, B, H, T = 0.121, 0.076, 0.028, 0.003  # [m] sides, height of the walls, their thickness
WASHER = 1.4e-3  # [m]
SCREW = np.array([0.059, 0.03, T + H])
SPRINGS = fem.Bushing(kz=2e8)
ALUMINIUM = {"young": 70e9, "poisson": 0.33, "density": 2700.0}
SOURCE = "CalculiX on hexahedra of a quarter, of two sizes, extrapolated; the error stated of ours"
N_MODES = 6  # of the quarter, its rigid motion among them


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_program(PROGRAM, PACKAGE)


def thin_box(error):
    x, y, z = (A - T) / 2, (B - T) / 2, T + H / 2
    bodies = {
        "floor": {"box": [A, B, T], "at": [0, 0, T / 2]},
        "left": {"box": [T, B, H], "at": [-x, 0, z]},
        "right": {"box": [T, B, H], "at": [x, 0, z]},
        "front": {"box": [A - 2 * T, T, H], "at": [0, -y, z]},
        "back": {"box": [A - 2 * T, T, H], "at": [0, y, z]},
        "lid": {"box": [A, B, T], "at": [0, 0, T + H + T / 2]},
    }
    walls = ("left", "right", "front", "back")
    pairs = [f"floor|{wall}" for wall in walls]
    pairs += [f"{end}|{side}" for end in walls[:2] for side in walls[2:]]
    cx, cy, cz = SCREW
    return scene(
        {
            "name": "thin-box",
            "bodies": bodies,
            "assembly": {"held": [], "touching": "free", "material": "aluminium"},
            "materials": {"aluminium": ALUMINIUM},
            "ties": [{"between": pair} for pair in pairs],
            "joints": [
                {
                    "name": f"on-{wall}", "between": f"lid|{wall}", "washer": WASHER, "kz": 2e8,
                    "at": [[sign * cx, -cy, cz], [sign * cx, cy, cz]],
                }
                for wall, sign in (("left", -1), ("right", 1))
            ],
            "mesh": {"error": error},
        }
    )  # fmt: skip


def plan(n, rim):
    """Quadrilaterals of a quarter of the lid: points (2, m), corners (4, k), and the radius of the
    polygon in place of the washer, of the same area. Its neighbours have the size rim [m]."""
    (cx, cy), half = SCREW[:2], T / 2

    def lines(*stretches):
        pieces = [np.linspace(a, b, k + 1)[:-1] for a, b, k in stretches]
        return np.concatenate([*pieces, [stretches[-1][1]]])

    x = lines((0, A / 2 - T, 4 * n), (A / 2 - T, A / 2, 2 * n))
    y = lines(
        (0, cy - half, 2 * n), (cy - half, cy + half, 2 * n), (cy + half, B / 2 - T, n),
        (B / 2 - T, B / 2, n),
    )  # fmt: skip
    s = np.linspace(-1, 1, 2 * n + 1)
    around = [(v, -1) for v in s[:-1]] + [(1, v) for v in s[:-1]]
    square = np.array(around + [(-v, -w) for v, w in around] + around[:1]).T
    angle = np.arctan2(square[1], square[0])
    radius = WASHER * np.sqrt(2 * np.pi / np.sum(np.sin(np.diff(np.unwrap(angle)))))
    circle = radius * square / np.linalg.norm(square, axis=0)
    across = [
        lines_through([Stop(0.0), refined(WASHER / 2, rim)], WASHER / 2 / n) / (WASHER / 2),
        lines_through([refined(0.0, rim), Stop(half / 4)], half / 4 / n) / (half / 4),
    ]

    # the grid without the square around the washer, a square inside of the washer, two rings
    grid = np.array(np.meshgrid(x, y, indexing="ij"))
    middle = [(along[1:] + along[:-1]) / 2 for along in (x, y)]
    whole = ~np.logical_and.outer(abs(middle[0] - cx) < half, abs(middle[1] - cy) < half)
    centre = np.array([cx, cy])[:, None, None]
    inner = centre + WASHER / 2 * np.array(np.meshgrid(s, s, indexing="ij"))
    patches = [(grid, whole), (inner, None)]
    for w, inside, outside in zip(
        across, (WASHER / 2 * square, circle), (circle, half * square), strict=True
    ):
        ring = inside[:, None] * (1 - w)[None, :, None] + outside[:, None] * w[None, :, None]
        patches.append((centre + ring, None))
    points, quads, first = [], [], 0
    for p, kept in patches:
        ix = first + np.arange(p[0].size).reshape(p[0].shape)
        corners = np.array([ix[:-1, :-1], ix[1:, :-1], ix[1:, 1:], ix[:-1, 1:]])
        quads.append(corners[:, slice(None) if kept is None else kept].reshape(4, -1))
        points.append(p.reshape(2, -1))
        first += p[0].size
    p, t = np.concatenate(points, axis=1), np.concatenate(quads, axis=1)
    (x, y) = p[:, t]
    clockwise = (x[2] - x[0]) * (y[3] - y[1]) < (x[3] - x[1]) * (y[2] - y[0])
    return p, np.where(clockwise, t[::-1], t), radius


def stacked(*parts):
    """Hexahedra of plans (points, quadrilaterals) between heights, one mesh."""
    p, t, first = [], [], 0
    for points, quads, z in parts:
        n = points.shape[1]
        p.append(np.concatenate([np.vstack([points, np.full(n, level)]) for level in z], axis=1))
        base = (quads[:, None] + n * np.arange(len(z) - 1)[:, None]).reshape(4, -1) + first
        t.append(np.concatenate([base, base + n])[EXTRUDED])
        first += p[-1].shape[1]
    p, t = np.concatenate(p, axis=1), np.concatenate(t, axis=1)
    _, one, same = np.unique(np.round(p, 9), axis=1, return_index=True, return_inverse=True)
    used, t = np.unique(same.ravel()[t], return_inverse=True)
    return MeshHex(np.ascontiguousarray(p[:, one[used]]), t.reshape(8, -1))


def quarter(n, rim):
    """The quarter with n elements through floor and lid, held so as its modes are symmetric."""
    p, t, radius = plan(n, rim)
    wall = np.any(p[:, t].mean(axis=1).T > np.array([A, B]) / 2 - T, axis=1)
    floor, high = np.linspace(0, T, n + 1), T + H
    walls = lines_through([Stop(T), refined(high, rim)], H / (4 * n))
    lid = lines_through([refined(high, rim), Stop(high + T)], T / n)
    meshes = {
        "box": stacked((p, t, floor), (p, t[:, wall], walls)),
        "lid": stacked((p, t, lid)),
    }

    named = {f"on-{axis}": lambda x, i=i: abs(x[i]) < 1e-9 for i, axis in enumerate("xy")}
    for body, mesh in meshes.items():
        # facets with all their corners within: middles of those around it may lie nearer
        x = mesh.p[:, mesh.facets]
        away = np.hypot(*(x[:2] - SCREW[:2, None, None]))
        on_washer = np.all((abs(x[2] - high) < 1e-9) & (away < radius + 1e-9), axis=0)
        facets = {"washer": np.intersect1d(np.flatnonzero(on_washer), mesh.boundary_facets())}
        meshes[body] = mesh.with_boundaries(named).with_boundaries(facets)
    materials = dict.fromkeys(meshes, fem.Material(**ALUMINIUM))
    symmetric = [fem.HeldFace(f"{body}:on-{axis}", axis) for body in meshes for axis in "xy"]
    screw = fem.Joint(
        "screw", fem.Side("lid:washer"), fem.Side("box:washer", "mean"), SCREW, SPRINGS,
        np.diag([1.0, -1.0, -1.0]),
    )  # fmt: skip
    structure = fem.assemble(meshes, materials)
    return fem.joined(structure, fem.Connections(joints=[screw], held=symmetric)), materials


def test_the_error_stated_of_the_thin_box_covers_that_to_hexahedra_in_calculix(check):
    """Frequencies of hexahedra of two sizes, extrapolated with the order 1.5, stand for the truth;
    they are known to half of what orders from 1 to 3 make of them."""
    coarse, fine = (
        answer(input_deck(*quarter(n, rim), n_modes=N_MODES)).frequency_hz[1:]
        for n, rim in ((1, 4e-4), (2, 2e-4))
    )
    limit = fine - (coarse - fine) / (2**1.5 - 1)
    own = (coarse - fine) * (1 - 1 / 7) / 2

    # ours that are symmetric about both planes, in which lid or floor move up and down in the mean
    box = pipeline_of(thin_box(0.1), quiet)
    model, modes = box("model"), box("modes")
    M, moved = model.structure.M, (model.T @ modes.phi)[: model.structure.n_dofs]
    means = []
    for body in ("floor", "lid"):
        up = np.zeros(len(moved))
        up[model.structure.dofs(body)[2::3]] = 1.0
        means.append(up @ (M @ moved) / np.sqrt(up @ (M @ up)))
    hz = modes.omega / (2 * np.pi)
    symmetric = np.flatnonzero((np.hypot(*means) > 0.1) & (hz > 1.0))[: len(limit)]
    stated = box("missed-energy").of_frequencies(modes.omega)[symmetric]
    assert box("sizes").stated <= 0.1

    true = hz[symmetric] / limit - 1
    for i, row in enumerate(zip(hz[symmetric], limit, true, stated, strict=True)):
        check(Comparison(f"thin box, symmetric mode {i + 1} [Hz]", *map(float, row), SOURCE))
    assert np.all(stated < 4 * (true + own / limit))
