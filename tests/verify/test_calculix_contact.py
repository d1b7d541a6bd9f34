"""Two plates pressed by washers in CalculiX's contact (Debian: calculix-ccx): pressure and zone."""

from os import environ
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.spatial import cKDTree
from skfem import MeshHex

from beadwave.fem import Connections, HeldFace, Material, assemble, joined
from beadwave.fem.assembly.trace import face_mean
from beadwave.fem.contact.facing_facets import facing_facets
from beadwave.fem.contact.preloaded_contact import condensed, preloaded_contact
from beadwave.fem.exchange.abaqus import ORDER, input_deck

from peer_programs import require_program
from programs.calculix import PACKAGE, PROGRAM

pytestmark = pytest.mark.peer
STEEL = Material(210e9, 0.3, 7850.0)
HOLE, WASHER, RIM, THICKNESS = 4.5e-3, 6.5e-3, 30e-3, 10e-3  # m
SOURCE = "CalculiX 2.20, surface-to-surface contact of other facets"
LAYER = 1e15  # Pa/m in both programs
FORCE = 3e3  # N on a quarter
# corners of Abaqus' faces of a hexahedron, S1 to S6
FACES = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]


@pytest.fixture(autouse=True, scope="module")
def needed():
    require_program(PROGRAM, PACKAGE)


def plate(radii, n_around, z):
    """A quarter of a round plate with a hole."""
    mesh = MeshHex.init_tensor(radii, np.linspace(0, np.pi / 2, n_around + 1), z)
    r, angle, height = mesh.p
    mesh = MeshHex(np.array([r * np.cos(angle), r * np.sin(angle), height]), mesh.t)

    def at(z_0, inside):
        return lambda x: (np.abs(x[2] - z_0) < 1e-9) & (np.hypot(x[0], x[1]) < inside)

    return mesh.with_boundaries(
        {
            "bottom": at(z[0], 1.0), "top": at(z[-1], 1.0),
            "below": at(z[0], WASHER), "above": at(z[-1], WASHER),
            "x": lambda x: np.abs(x[0]) < 1e-9, "y": lambda x: np.abs(x[1]) < 1e-9,
        }
    )  # fmt: skip


def surface(structure, face, name, first):
    """*SURFACE of a face by its elements, and the elements and faces in the order of its facets."""
    body, facets = structure.facets(face)
    basis = structure.basis[body]
    mesh = basis.mesh
    corners = basis.element_dofs[0::3][ORDER["C3D20"][:8]]  # by their dofs
    sides = []
    for facet in facets:
        cell = mesh.f2t[0, facet]
        nodes = {basis.nodal_dofs[0, vertex] for vertex in mesh.facets[:, facet]}
        (side,) = (i for i, f in enumerate(FACES, 1) if {corners[k, cell] for k in f} == nodes)
        sides.append((first + cell + 1, side))
    lines = [f"{element}, S{side}" for element, side in sides]
    return [f"*SURFACE, NAME={name}, TYPE=ELEMENT", *lines], sides


def calculix_pressure(deck, loads, surfaces, sides):
    """Pressures [Pa] at the closed points of facets, by their elements and faces."""
    contact = [
        "*SURFACE INTERACTION, NAME=HARD",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{LAYER:g}",
        "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE",
        "SLAVE, MASTER",
    ]
    step = ["*STEP", "*STATIC", "1., 1.", "*CLOAD", *loads]
    step += ["*CONTACT PRINT, SLAVE=SLAVE, MASTER=MASTER", "CSTR", "*END STEP"]
    text = "\n".join([deck.partition("*STEP\n")[0].rstrip(), *surfaces, *contact, *step, ""])
    with TemporaryDirectory() as folder:
        (Path(folder) / "deck.inp").write_text(text)
        out = run(
            [PROGRAM, "deck"], cwd=folder, capture_output=True, text=True, timeout=1800,
            env=environ | {"OMP_NUM_THREADS": "1"},  # its threads spin where others want the cores
        )  # fmt: skip
        printed = (Path(folder) / "deck.dat").read_text()
        assert printed.strip(), out.stdout[-2000:]
    points = {}
    for line in printed.rpartition("contact stress")[2].splitlines():
        row = line.split()
        if len(row) >= 5 and row[0].isdigit():
            points.setdefault((int(row[0]), int(row[1])), []).append(float(row[-3]))
    return [points.get(side, []) for side in sides]


def test_zone_and_pressure_of_two_pressed_plates(compare):
    """Meshes that do not match; CalculiX integrates the pressure over the facets of the slave face,
    here it is constant on each. The radius at which the faces part is that of the closed area."""
    fine = np.concatenate([np.linspace(HOLE, WASHER, 4), np.linspace(WASHER, 16e-3, 13)[1:]])
    radii = np.concatenate([fine, np.linspace(16e-3, RIM, 6)[1:]])
    coarse = np.concatenate([np.linspace(HOLE, WASHER, 3), np.linspace(WASHER, RIM, 17)[1:]])
    meshes = {
        "a": plate(coarse, 5, np.linspace(-THICKNESS, 0, 5)),
        "b": plate(radii, 6, np.linspace(0, THICKNESS, 5)),
    }
    structure = assemble(meshes, dict.fromkeys(meshes, STEEL))
    held = [HeldFace("a:below", "z")]
    held += [HeldFace(f"{body}:{face}", face) for body in "ab" for face in "xy"]
    model = joined(structure, Connections(held=held))
    facets = facing_facets(structure, "b:bottom", "a:top")
    contact = condensed(model.K, model.M, model.T, facets, np.full(len(facets.area), LAYER))
    above, F = face_mean(structure, "b:above"), np.zeros((len(structure.points), 3))
    F[above.node, 2] = -FORCE * above.share
    state = preloaded_contact(contact, model.T.T @ F.ravel())
    assert state.force == pytest.approx(FORCE, rel=1e-6)

    # the same in CalculiX: nodes as numbered there, loads at them
    loads = [f"{i + 1}, 3, {F[i, 2]:.12e}" for i in above.node]
    n_lower = structure.basis["a"].nelems
    slave, sides = surface(structure, "b:bottom", "SLAVE", n_lower)
    master, _ = surface(structure, "a:top", "MASTER", 0)
    deck = input_deck(model, dict.fromkeys(meshes, STEEL))
    points = calculix_pressure(deck, loads, slave + master, sides)

    # CalculiX prints closed points alone, of as many as the cuts by the other mesh make of a facet:
    # at the rim their number is compared with that of the facet next to it on the inside
    assert len(points) == len(state.pressure)
    r, n_points = np.hypot(*facets.points[:, :2].T), np.array([len(p) for p in points])
    inside = facets.points * (1 - 0.79e-3 / r)[:, None]
    neighbour = cKDTree(facets.points).query(inside)[1]
    share = np.where(
        r < WASHER, 1.0, np.minimum(n_points / np.maximum(n_points[neighbour], 1), 1.0)
    )
    radius = [
        float(np.sqrt(4 * (facets.area @ closed) / np.pi + HOLE**2))
        for closed in (state.pressure > 0, share * (n_points > 0))
    ]
    compare("radius at which pressed plates part", *radius, allowed=0.05, source=SOURCE)
    within = r < 0.95 * radius[1]
    theirs = np.array(
        [np.mean(p) for p, is_within in zip(points, within, strict=True) if is_within]
    )
    compare(
        "pressure between pressed plates", state.pressure[within], theirs,
        allowed=0.03, source=SOURCE,
    )  # fmt: skip
