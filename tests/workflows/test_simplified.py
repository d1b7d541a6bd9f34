"""Features below mesh.simplify: which go, which stay, and what leaving them out changes."""

import gmsh
import numpy as np
import pytest

from beadwave import fem, geometry
from beadwave.geometry.cad.occ import body_of, model
from beadwave.geometry.cad.shapes import Hole, Slab
from beadwave.geometry.cad.simplified import simplified
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.files.scene import scene
from beadwave.workflows.report.summary_rows import mesh_words
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.structure import assembly, bodies, sizes_file
from beadwave.workflows.stages.structure.meshed_parts import ElementSizes
from beadwave.workflows.structure.look import look

pytestmark = pytest.mark.usefixtures("shared_cache")

N_MODES = 4  # elastic modes that are compared
SIZE = 2.5e-3  # m, of mesh.simplify


def plate(holes, **assembly):
    """Tables of a steel plate of 60 by 30 by 6 mm with holes at these places, all of 2 mm."""
    outline = [[0, 0], [0.06, 0], [0.06, 0.03], [0, 0.03]]
    drilled = {"diameter": 2e-3, "at": holes} if isinstance(holes, list) else holes
    return made({"plate": {"outline": outline, "thickness": 6e-3}, "holes": drilled}, **assembly)


def made(body, **assembly):
    steel = {"young": 210e9, "poisson": 0.3, "density": 7850.0}
    table = {"held": [], "material": "steel"} | assembly
    return {
        "name": "part", "assembly": table, "materials": {"steel": steel}, "bodies": {"part": body},
    }  # fmt: skip


def from_step(folder, draw):
    """Tables of a part that is drawn in the kernel, as a STEP file; lengths in m."""
    path = folder / "part.step"
    with session("no part"), silent():
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
    tables = made({})
    return tables | {"assembly": tables["assembly"] | {"step": str(path)}, "bodies": {}}


def rounded_box(occ, outer=True):
    """A box with four rounded edges, or an angle with a rounded inner edge."""
    tag = occ.addBox(0, 0, 0, 0.05, 0.02, 0.012)
    if not outer:
        ((_, tag),), _ = occ.cut([(3, tag)], [(3, occ.addBox(0.008, -1, 0.006, 1, 2, 1))])
    occ.synchronize()
    edges = []
    for _, edge in gmsh.model.getEntities(1):
        lower, upper = np.reshape(gmsh.model.getBoundingBox(1, edge), (2, 3))
        along = int(np.argmax(upper - lower))
        middle = (lower + upper) / 2
        at_inner_edge = np.allclose(middle[[0, 2]], [0.008, 0.006], atol=1e-4)
        if along == 2 if outer else at_inner_edge:
            edges.append(edge)
    occ.fillet([tag], edges, [2e-3])


def pinned_box(occ):
    """A box with a pin of 2 mm on it."""
    box, pin = (
        occ.addBox(0, 0, 0, 0.05, 0.02, 5e-3),
        occ.addCylinder(0.02, 0.01, 0, 0, 0, 7e-3, 1e-3),
    )
    occ.fuse([(3, box)], [(3, pin)])


def pocketed_box(occ):
    """A box with two pockets of 1.4 mm cubed."""
    box = occ.addBox(0, 0, 0, 0.05, 0.02, 5e-3)
    pockets = [occ.addBox(x, 0.01, 3.6e-3, 1.4e-3, 1.4e-3, 1) for x in (0.02, 0.03)]
    occ.cut([(3, box)], [(3, pocket) for pocket in pockets])


def chamfered_box(occ):
    """A box whose four upper edges are chamfered by 1 mm."""
    tag = occ.addBox(0, 0, 0, 0.05, 0.02, 6e-3)
    occ.synchronize()
    top = [face for _, face in gmsh.model.getEntities(2)
           if occ.getCenterOfMass(2, face)[2] > 5.9e-3]  # fmt: skip
    edges = gmsh.model.getAdjacencies(2, top[0])[1].tolist()
    occ.chamfer([tag], edges, top * len(edges), [1e-3])


def chamfered_disc(occ):
    """A disc with a chamfer of 1 mm around its upper edge."""
    low = occ.addCylinder(0, 0, 0, 0, 0, 5e-3, 0.02)
    occ.fuse([(3, low)], [(3, occ.addCone(0, 0, 5e-3, 0, 0, 1e-3, 0.02, 0.019))])


def slotted_plate(occ, through=True):
    """A plate with a slot of 2 by 9 mm with round ends, or a groove of 2 mm by 2 mm across it."""
    box = occ.addBox(0, 0, 0, 0.06, 0.03, 6e-3)
    if not through:
        tools = [(3, occ.addBox(0.025, -1, 4e-3, 2e-3, 2, 1))]
    else:
        tools = [(3, occ.addBox(0.02, 0.01, -1, 7e-3, 2e-3, 2))]
        tools += [(3, occ.addCylinder(x, 0.011, -1, 0, 0, 2, 1e-3)) for x in (0.02, 0.027)]
    occ.cut([(3, box)], tools)


PARTS = {
    "holes": lambda folder: plate([[0.01 + 0.01 * i, 0.015] for i in range(5)]),
    "blind holes": lambda folder: plate(
        {"diameter": 2e-3, "depth": 4e-3, "at": [[0.02 + 0.01 * i, 0.01] for i in range(3)]}
    ),
    "hole at the middle": lambda folder: plate([[0.03, 0.015]]),
    "holes at the edge": lambda folder: plate([[0.03, 0.0025], [0.03, 0.0275]]),
    "holes in pairs": lambda folder: plate([[0.029, 0.012], [0.032, 0.015], [0.05, 0.015]]),
    "drilled bar": lambda folder: made(
        {
            "cylinder": {"radius": 8e-3, "length": 0.03},
            "holes": {"diameter": 2e-3, "depth": 8e-3, "at": [[4e-3, 0.0], [-4e-3, 0.0]]},
        }
    ),
    "outer roundings": lambda folder: from_step(folder, rounded_box),
    "inner rounding": lambda folder: from_step(folder, lambda occ: rounded_box(occ, outer=False)),
    "pin": lambda folder: from_step(folder, pinned_box),
    "chamfers": lambda folder: from_step(folder, chamfered_box),
    "round chamfer": lambda folder: from_step(folder, chamfered_disc),
    "slot": lambda folder: from_step(folder, slotted_plate),
    "groove": lambda folder: from_step(folder, lambda occ: slotted_plate(occ, through=False)),
    "pockets": lambda folder: from_step(folder, pocketed_box),
}


def frequencies(tables, **mesh):
    """The first elastic ones on a mesh whose elements are split, with their own errors, and what is
    stated of each by the features that the mesh leaves out."""
    of = scene({**tables, "mesh": {"error": 0.5, "modes": N_MODES, **mesh}})
    parts = bodies.parts(of, ElementSizes(usual=2.0, curved=True))
    modes = []
    for times in range(2):
        split = {name: geometry.refined(m, times) for name, m in parts.meshes.items()}
        model = assembly.model(of, parts._replace(meshes=split))
        modes.append(fem.modes(model.K, model.M, 6 + N_MODES))
        if not times:
            features = [fem.LeftOut(r.body, r.places, r.volume, r.factor) for r in parts.left_out]
            G = fem.energy_left_out(model, parts.materials, features, *modes[0][::-1])
    coarse, fine = (m.omega[6:] for m in modes)
    stated = 1 - 1 / np.sqrt(1 + np.diag(G.sum(axis=0))[6:] / coarse**2)
    # extrapolated by an order of 4; its own error is that to an order of 2.6
    return fine - (coarse - fine) / 15, (coarse - fine) / 6, stated, parts.left_out


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name == "hole at the middle" else [pytest.mark.slow])
        for name in PARTS
    ],
)
def test_the_true_change_is_within_what_is_stated(name, tmp_path):
    """Of each frequency with and without the features, each extrapolated from two meshes."""
    tables = PARTS[name](tmp_path)
    whole, own, none, kept = frequencies(tables)
    simple, own_simple, stated, left_out = frequencies(tables, simplify=SIZE)
    assert left_out and not kept and not none.any()
    true, doubt = np.abs(simple / whole - 1), (own + own_simple) / whole
    assert np.all(true < stated + doubt)
    # and no more than eight times it: in a bar inertia and stiffness cancel, a pin has no strain.
    # At an edge all around they cancel in some modes, a slot takes its factor across it alone
    changed = true > 2 * doubt
    if name in ("chamfers", "slot", "groove"):
        assert stated.max() < 8 * true.max()
    else:
        assert name == "pin" or np.all(stated[changed] < 8 * true[changed])


def held(**mesh):
    """A plate held at an end and struck, with small holes."""
    tables = plate([[0.02, 0.015], [0.03, 0.015], [0.045, 0.0152]], held=["part:-x"])
    chain = {"count": 3, "radius": 5e-3, "density": 7800.0, "young": 210e9, "poisson": 0.3}
    strike = {"on": "part:+z", "at": [0.038, 0.015, 6e-3], "radius": 2e-3}
    return {
        **tables, "chain": chain, "striker": {"velocity": 0.2}, "wall": {"kind": "rom"},
        "damping": {"kind": "modal", "ratio": 0.01}, "time": {"duration": 1e-4},
        "output": {"spheres": [1]}, "strike": strike, "mesh": {"error": 0.05, **mesh},
    }  # fmt: skip


def test_features_left_out_are_listed_and_are_a_part_of_the_error():
    with_holes, without = (
        pipeline_of(scene(held(error=0.15, modes=3, **m)), quiet) for m in ({}, {"simplify": SIZE})
    )
    sizes, of_whole = without("sizes"), with_holes("sizes")
    assert of_whole.left_out == () and of_whole.floor == 0
    assert without("model").K.shape[0] < 0.6 * with_holes("model").K.shape[0]
    assert [part.faces for part in sizes.left_out] == [
        ("part@0.02,0.015,0.003",), ("part@0.03,0.015,0.003",), ("part@0.045,0.0152,0.003",)
    ]  # fmt: skip
    assert all(part.size_m == pytest.approx(2e-3) and part.error > 0 for part in sizes.left_out)
    assert max(part.error for part in sizes.left_out) <= sizes.floor < sizes.stated < 0.15
    numbers = without("mesh-numbers")
    assert [part.body for part in numbers.left_out] == ["part"] * 3
    assert "3 small features left out, most of it at part@0.0" in mesh_words(numbers)


def test_what_the_scene_names_and_what_lies_under_a_patch_stays():
    tables = held(simplify=SIZE)
    tables["assembly"]["held"] = ["part@0.02,0.015,0.003"]
    tables["strike"]["at"] = [0.045, 0.0185, 6e-3]
    left_out = bodies.parts(scene(tables)).left_out
    assert [part.faces for part in left_out] == [("part@0.03,0.015,0.003",)]


def test_faces_keep_their_names():
    """Of the face around a hole that is filled, and of one that has none."""
    outline = ((0, 0), (0.06, 0), (0.06, 0.03), (0, 0.03))
    slab = Slab(outline=outline, thickness=6e-3, holes=(Hole(at=(0.03, 0.015), diameter=2e-3),))
    with model({"part": slab}) as cad:
        for face in cad.bodies["part"].faces:
            if face.centre[2] > 5e-3 or face.centre[0] < 1e-3:
                gmsh.model.setEntityName(2, face.tag, "top" if face.centre[2] > 5e-3 else "end")
        named = {"part": body_of("part", cad.bodies["part"].tag)}
        simple, (removal,) = simplified(named, SIZE, (), ())
        assert len(simple["part"].faces) == len(named["part"].faces) - 1
        assert removal.volume == pytest.approx(np.pi * 1e-6 * 6e-3)
        centres = {face.name: face.centre for face in simple["part"].faces if face.name}
        assert centres["top"] == pytest.approx([0.03, 0.015, 6e-3])
        assert centres["end"] == pytest.approx([0, 0.015, 3e-3])


def test_sizes_of_a_file_have_features_left_out_as_their_search_has(tmp_path):
    found = pipeline_of(scene(held(modes=3, simplify=SIZE)), quiet)
    np.savez(tmp_path / "sizes.npz", **sizes_file.arrays_of(found("sizes")))
    of_file = scene(held(modes=3, simplify=SIZE, sizes=str(tmp_path / "sizes.npz")))
    run = pipeline_of(of_file, quiet)
    numbers, again = found("mesh-numbers"), run("mesh-numbers")
    assert [part.faces for part in again.left_out] == [part.faces for part in numbers.left_out]
    # shapes that vibrate have inertia in a static response, which the search has not
    errors = np.array([[part.error for part in n.left_out] for n in (numbers, again)])
    assert np.all((errors[1] >= errors[0]) & (errors[1] < 2.1 * errors[0]))
    # of few elements, which are split: features are a part of their error all the same
    missed, omega = run("missed-energy"), run("modes").omega[:3]
    assert missed.split is not None
    of_split = missed._replace(energy=np.zeros_like(missed.energy))
    features = np.diag(missed.left_out.sum(axis=0))[:3]
    assert np.allclose(
        missed.of_frequencies(omega) - of_split.of_frequencies(omega),
        1 - 1 / np.sqrt(1 + features / omega**2),
    )
    assert missed.of_compliance > of_split.of_compliance


@pytest.mark.parametrize("meshed", [False, True])
def test_look_lists_features_left_out_and_meshes_without_them(meshed):
    seen = look(scene(held(simplify=SIZE)), "part", meshed=meshed).look
    whole = look(scene(held()), "part", meshed=meshed).look
    assert seen.dofs < 0.8 * whole.dofs
    assert not whole.left_out
    assert [row.faces for row in seen.left_out] == [
        ("part@0.02,0.015,0.003",), ("part@0.03,0.015,0.003",), ("part@0.045,0.0152,0.003",)
    ]  # fmt: skip
    assert seen.left_out[0].volume_m3 == pytest.approx(np.pi * 1e-6 * 6e-3)
    assert "left out of the mesh" in seen.text()
    assert "left out of the mesh" not in whole.text()


def test_simplify_without_an_error_is_refused():
    with pytest.raises(InvalidScene, match=r"mesh.simplify = 0.0025 m .* give mesh.error"):
        scene({**plate([[0.03, 0.015]]), "mesh": {"simplify": SIZE}})
