"""Two plates pressed by washers in CalculiX's contact (Debian: calculix-ccx): pressure, zone, and
the modes about that state."""

import gmsh
import numpy as np
import pytest
from scipy.spatial import cKDTree
from skfem import MeshHex

from beadwave.fem import Connections, HeldFace, Material, assemble, joined, modes
from beadwave.fem.assembly.trace import face_mean
from beadwave.fem.contact.facing_facets import facing_facets
from beadwave.fem.contact.preloaded_contact import (
    MINDLIN,
    STUCK,
    condensed,
    joined_stiffness,
    preloaded_contact,
    with_friction,
)
from beadwave.fem.exchange.abaqus import input_deck
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.scene.toml import resolved
from beadwave.workflows.stages.structure import assembly

from peer_programs import require_program
from programs.calculix import PACKAGE, PROGRAM, answer
from programs.calculix_contact import Layer, pressed

pytestmark = pytest.mark.peer
STEEL = Material(210e9, 0.3, 7850.0)
HOLE, WASHER, RIM, THICKNESS = 4.5e-3, 6.5e-3, 30e-3, 10e-3  # m
SOURCE = "CalculiX 2.20, surface-to-surface contact of other facets"
LAYER = 1e15  # Pa/m in both programs
FORCE = 3e3  # N on a quarter
N_MODES = 6


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


def pressed_plates(upper=STEEL):
    """Two plates whose meshes do not match, with their faces condensed, and the forces (nodes, 3)
    [N] that press them."""
    fine = np.concatenate([np.linspace(HOLE, WASHER, 4), np.linspace(WASHER, 16e-3, 13)[1:]])
    radii = np.concatenate([fine, np.linspace(16e-3, RIM, 6)[1:]])
    coarse = np.concatenate([np.linspace(HOLE, WASHER, 3), np.linspace(WASHER, RIM, 17)[1:]])
    meshes = {
        "a": plate(coarse, 5, np.linspace(-THICKNESS, 0, 5)),
        "b": plate(radii, 6, np.linspace(0, THICKNESS, 5)),
    }
    structure = assemble(meshes, {"a": STEEL, "b": upper})
    held = [HeldFace("a:below", "z")]
    held += [HeldFace(f"{body}:{face}", face) for body in "ab" for face in "xy"]
    model = joined(structure, Connections(held=held))
    facets = facing_facets(structure, "b:bottom", "a:top")
    contact = condensed(model.K, model.M, model.T, facets, np.full(len(facets.area), LAYER))
    above, F = face_mean(structure, "b:above"), np.zeros((len(structure.points), 3))
    F[above.node, 2] = -FORCE * above.share
    return model, contact, F


def test_zone_pressure_and_modes_of_two_pressed_plates(compare):
    """CalculiX integrates the pressure over the facets of the slave face, here it is constant on
    each. The radius at which the faces part is that of the closed area."""
    model, contact, F = pressed_plates()
    facets, meshes = contact.facets, dict.fromkeys("ab", STEEL)
    state = preloaded_contact(contact, model.T.T @ F.ravel())
    assert state.force == pytest.approx(FORCE, rel=1e-6)

    # the same in CalculiX
    faces = ("b:bottom", "a:top")
    theirs = pressed(model, meshes, faces, F, Layer(LAYER), n_modes=N_MODES)
    points = theirs.pressure

    # modes about the state, closed facets joined along the normal alone
    K = model.K + joined_stiffness(state)
    ours = modes(K.tocsc(), model.M, N_MODES).frequency_hz
    compare(
        "modes of pressed plates without friction, over CalculiX's", ours / theirs.frequency_hz,
        np.ones(N_MODES), allowed=0.05, source=SOURCE,
    )  # fmt: skip

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
    pressure = np.array(
        [np.mean(p) for p, is_within in zip(points, within, strict=True) if is_within]
    )
    compare(
        "pressure between pressed plates", state.pressure[within], pressure,
        allowed=0.03, source=SOURCE,
    )  # fmt: skip


def test_modes_of_pressed_plates_that_stick(compare):
    """Friction holds all of the zone, and its layer along the faces is that here."""
    model, contact, F = pressed_plates()
    force = model.T.T @ F.ravel()
    friction = np.full(len(contact.facets.area), 0.6)
    state = with_friction(contact, preloaded_contact(contact, force), force, friction)
    K = model.K + joined_stiffness(state)
    ours = modes(K.tocsc(), model.M, N_MODES).frequency_hz
    faces, layer = ("b:bottom", "a:top"), Layer(LAYER, MINDLIN * LAYER, 0.6)
    theirs = pressed(model, dict.fromkeys("ab", STEEL), faces, F, layer, n_modes=N_MODES)
    compare(
        "modes of pressed plates that stick, over CalculiX's", ours / theirs.frequency_hz,
        np.ones(N_MODES), allowed=0.05, source=SOURCE,
    )  # fmt: skip


@pytest.mark.parametrize("joint", [{"model": "contact", "friction": 0.15}, {}])
def test_the_deck_of_bolted_plates_has_their_modes(joint, compare):
    """Faces in contact and springs by formula, with the masses of bolts; without the geometric
    stiffness of the preload, which is 3e-4 of K here. CalculiX prints seven digits."""
    plate = {"outline": [[0, 0], [0.04, 0], [0.04, 0.04], [0, 0.04]], "thickness": 0.01}
    hole = {"diameter": 0.009, "at": [[0.02, 0.02]]}
    bolt = {"name": "lap", "between": "left|right", "bolt": "M8-8.8", "preload": 12e3}
    scene = resolved(
        {
            "name": "plates",
            "assembly": {"held": ["left:-x"], "material": "steel", "touching": "free"},
            "mesh": {"scale": 2.0},
            "bodies": {
                "left": {"plate": plate, "holes": hole},
                "right": {"plate": plate, "holes": hole, "at": [0.0, 0.0, 0.01]},
            },
            "joints": [bolt | joint],
        },
        "plates.toml",
    )
    mesh = assembly.mesh(scene)
    model = assembly.model(scene, mesh)
    ours = modes(model.K, model.M, N_MODES).frequency_hz
    theirs = answer(input_deck(model, mesh.materials, n_modes=N_MODES)).frequency_hz
    name = "modes of bolted plates by their deck, " + ("in contact" if joint else "on springs")
    compare(
        name, ours / theirs, np.ones(N_MODES), allowed=3e-4 if joint else 1e-6,
        source="CalculiX on the deck that `modes --inp` writes",
    )  # fmt: skip


def test_the_deck_of_a_clamped_bar_has_its_modes(compare, tmp_path):
    """One M8 from saddle to saddle through a bar: faces in contact about the axis of the bar. The
    geometric stiffness of the preload, which the deck leaves out, is 5e-4 of frequencies."""
    with session():
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        occ = gmsh.model.occ

        def cut(tag, *tools):
            occ.cut([(3, tag)], [(3, tool) for tool in tools])

        def hole():
            return occ.addCylinder(0, 0, -0.05, 0, 0, 0.1, 0.0045)

        def bar():
            return occ.addCylinder(0, -0.03, 0, 0, 0.06, 0, 0.02)

        cut(bar(), hole())
        for z in (0, -0.03):
            cut(occ.addBox(-0.015, -0.02, z, 0.03, 0.04, 0.03), bar(), hole())
        occ.synchronize()
        with silent():
            gmsh.write(str(tmp_path / "saddles.step"))
    bolt = {"name": "clamp", "bolt": "M8-8.8", "preload": 10e3, "friction": 0.15}
    scene = resolved(
        {
            "name": "saddles",
            "assembly": {
                "step": str(tmp_path / "saddles.step"), "held": ["body-1:-y"], "material": "steel",
                "touching": "free",
            },
            "mesh": {"scale": 4.0},
            "joints": [bolt | {"stack": ["body-2", "body-1", "body-3"], "model": "contact"}],
        },
        "saddles.toml",
    )  # fmt: skip
    mesh = assembly.mesh(scene)
    model = assembly.model(scene, mesh)
    ours = modes(model.K, model.M, N_MODES).frequency_hz
    theirs = answer(input_deck(model, mesh.materials, n_modes=N_MODES)).frequency_hz
    compare(
        "modes of a bar clamped between saddles by their deck", ours / theirs, np.ones(N_MODES),
        allowed=7e-4, source="CalculiX on the deck that `modes --inp` writes",
    )  # fmt: skip


def test_slip_of_unlike_plates_while_they_are_pressed(compare):
    """Aluminium on steel, which widen unlike each other: with friction 0.3 a ring of more than half
    of the zone slides. It is the same facet by facet, as is the shear of the rings of facets
    between the edge of the hole and the rim. Without gaps all states along a force that grows are
    alike, so that its path is that of one step."""
    mu, upper = 0.3, Material(70e9, 0.33, 2700.0)
    model, contact, F = pressed_plates(upper)
    force = model.T.T @ F.ravel()
    facets, friction = contact.facets, np.full(len(contact.facets.area), mu)
    state = with_friction(contact, preloaded_contact(contact, force), force, friction)
    layer = Layer(LAYER, MINDLIN * LAYER, mu)
    theirs = pressed(model, {"a": STEEL, "b": upper}, ("b:bottom", "a:top"), F, layer)
    p, tau = (
        np.array([np.mean(points) if points else 0.0 for points in of_facet])
        for of_facet in (theirs.pressure, theirs.shear)
    )

    r = np.hypot(*facets.points[:, :2].T)
    inside = r < 11.2e-3
    sticks = (tau < 0.99 * mu * p)[inside]
    assert 0.2 < facets.area[inside] @ sticks / facets.area[inside].sum() < 0.8
    np.testing.assert_array_equal(state.state[inside] == STUCK, sticks)
    ring, of_ring = np.unique(r.round(5), return_inverse=True)
    ours, tau = (
        np.bincount(of_ring, shear) / np.bincount(of_ring)
        for shear in (np.hypot(*state.shear) / facets.area, tau)
    )
    # nearer to the hole the shear turns its direction within facets
    within = (ring > 6e-3) & (ring < 11.2e-3)
    assert within.sum() > 6
    compare(
        "shear between plates of aluminium and steel while they are pressed", ours[within],
        tau[within], allowed=0.05, source=SOURCE,
    )  # fmt: skip
