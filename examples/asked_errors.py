"""Check of meshes whose sizes follow from mesh.error, on structures made from a seed and on STEP
files.

You will see, of each structure and each error asked: what ended the search, the unknowns, the error
stated and the true one, both the largest of the frequencies of the first twelve elastic modes and
of the static compliance at the contact, and the unknowns that mesh.scale alone takes for the same
true error. Below stand, of hexahedra, of tetrahedra, of each kind of structure and of all,

    ratio = stated error / true error      of each frequency and compliance that is told apart
    share = unknowns / unknowns of mesh.scale alone at the same true error
    least = the share that the indicators of such a mesh foresee of the best sizes

    at 5, 1, 0.2 %: shares at these true errors, between those of the errors asked

The third has sizes that vary from element to element (from layer to layer of boxes) without any
limit, and errors that fall with their orders. Of stresses that change over a whole body smoothly
it is near 1, of singular edges it falls with the error.

The structures are those of `mesh_errors.py`, plates on springs with a mass, boxes tied to a plate
of small elements, thick tubes, boxes whose lids are screwed on by small washers, stepped shafts,
brackets with a fillet and flanges; in a second round each has the other elements. A STEP file is of
steel, floats, and its bodies are tied where they touch.

True values are extrapolated from the mesh of an error asked, each element split in 8 and, where
that is not too much, in 64. Splitting keeps what elements make of curved faces: of structures that
have some the limit is moved by the difference between a mesh of half the sizes and the split one. A
true error below twice that of its limit is not counted.

Run it: python examples/asked_errors.py            seed 0, 12 structures
        python examples/asked_errors.py 7 5        another seed, the first five
        python examples/asked_errors.py 7 5 3      of these those from number 3 on
        python examples/asked_errors.py a.step b.step
        ... --asked 0.02 --bound 100000 --even 0   one error, more unknowns, no even meshes
        ... --split 0                              without true errors: what is met, and by what
        ... --to rows.jsonl                        appends to a file, without what it has already
"""

import argparse
import json
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import gmsh
import numpy as np
from skfem import MeshHex

from beadwave import fem, geometry
from beadwave.fem.errors.optimal_sizes import balanced_weights, kappa_for
from beadwave.fem.modes.mac import RIGID
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.errors.adapted_sizes import indicators, layouts_of, solved_on
from beadwave.workflows.stages.structure import assembly, bodies
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.reduction import contact_of
from mesh_errors import (
    CHAIN,
    bolted,
    box,
    bracket,
    extrapolated,
    halves,
    l_profile,
    paired,
    plate,
    shapes,
    t_profile,
    tied,
    tube,
    u_profile,
)

ASKED = (0.05, 0.02, 0.005)  # mesh.error
MIDDLE = 1  # of these, whose mesh is split for the limit, or an earlier one's if it is smaller
BOUND = 40_000  # mesh.unknowns
MOST_UNKNOWNS = 1.3e5  # of a mesh that is split
SCALES = (2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25)  # mesh.scale of even meshes, up to the bound
TRUE = (0.05, 0.01, 0.002)  # errors at which unknowns are compared
FARTHEST = 1.3  # of these over a true error of the errors asked
N_GOALS = 12
FLAT = 1e-6  # of a volume: what facets cut off bodies without curved faces

Rng = np.random.Generator
Tables = dict[str, Any]


def sprung(rng: Rng, folder: Path) -> Tables:
    """A plate on four springs to the ground that carries a mass."""
    a, b, t = rng.uniform([0.1, 0.07, 5e-3], [0.16, 0.1, 10e-3]).tolist()
    x, y = 0.4 * a, 0.4 * b
    return {
        "bodies": {"plate": {"box": [a, b, t]}},
        "assembly": {"held": []},
        "strike": {"on": "plate:-z", "at": [0.1 * a, 0.2 * b]},
        "springs": [
            {
                "name": "mounts", "on": "plate:+z", "at": [[x, y], [-x, y], [-x, -y], [x, -y]],
                "radius": 6e-3, "kz": float(10 ** rng.uniform(4, 6)), "kx": 1e4, "ky": 1e4,
            }
        ],
        "masses": [
            {"name": "sensor", "on": "plate:+z", "at": [0.0, 0.0], "mass": 0.05, "radius": 8e-3}
        ],
    }  # fmt: skip


def on_fine_plate(rng: Rng, folder: Path) -> Tables:
    """A box tied to a plate, whose elements have half the size by its shape at most."""
    a, b, t = rng.uniform([0.06, 0.05, 8e-3], [0.1, 0.08, 16e-3]).tolist()
    x, y, z = rng.uniform([0.015, 0.015, 0.03], [0.03, 0.03, 0.07]).tolist()
    return {
        "bodies": {
            "base": {"box": [a, b, t], "at": [0, 0, -t / 2], "seed": 0.5 * t},
            "post": {"box": [x, y, z], "at": [0.1 * a, 0, z / 2]},
        },
        "assembly": {"held": ["base:-x"], "touching": "tied"},
        "strike": {"on": "post:-x", "at": [0.0, z * rng.uniform(0.0, 0.3)]},
    }


def thick_tube(rng: Rng, folder: Path) -> Tables:
    """A tube of a thick wall, struck on its end."""
    radius, length = rng.uniform([0.02, 0.03], [0.03, 0.06]).tolist()
    shape = {"radius": radius, "length": length, "bore": radius * rng.uniform(0.2, 0.5)}
    return {
        "bodies": {"tube": {"cylinder": shape}},
        "assembly": {"held": ["tube:-z"]},
        "strike": {"on": "tube:+z", "at": [0.75 * radius, 0.0], "radius": 1e-3},
    }


def screwed(rng: Rng, folder: Path) -> Tables:
    """A box of thin walls, tied, whose lid four screws hold on small washers; it floats."""
    a, b, h, t = rng.uniform([0.08, 0.05, 0.02, 2.5e-3], [0.14, 0.09, 0.035, 4e-3]).tolist()
    x, y, z = (a - t) / 2, (b - t) / 2, t + h / 2
    bodies = {
        "floor": {"box": [a, b, t], "at": [0, 0, t / 2]},
        "left": {"box": [t, b, h], "at": [-x, 0, z]},
        "right": {"box": [t, b, h], "at": [x, 0, z]},
        "front": {"box": [a - 2 * t, t, h], "at": [0, -y, z]},
        "back": {"box": [a - 2 * t, t, h], "at": [0, y, z]},
        "lid": {"box": [a, b, t], "at": [0, 0, t + h + t / 2]},
    }
    walls = ("left", "right", "front", "back")
    pairs = [f"floor|{wall}" for wall in walls]
    pairs += [f"{end}|{side}" for end in walls[:2] for side in walls[2:]]
    y = 0.4 * b
    return {
        "bodies": bodies,
        "assembly": {"held": [], "touching": "free"},
        "ties": [{"between": pair} for pair in pairs],
        "strike": {"on": "lid:+z", "at": [0.0, 0.0]},
        "joints": [
            {
                "name": f"screws-{wall}", "between": f"lid|{wall}", "washer": 0.45 * t,
                "at": [[sign * x, -y, t + h], [sign * x, y, t + h]],
                "kz": float(10 ** rng.uniform(7.5, 8.5)),
            }
            for wall, sign in (("left", -1), ("right", 1))
        ],
    }  # fmt: skip


def shaft(rng: Rng, folder: Path) -> Tables:
    """From a STEP file: a shaft with a step that is rounded off, held at its thick end."""
    r, thin, length = rng.uniform([0.012, 0.5, 0.06], [0.02, 0.75, 0.1]).tolist()
    corner, fillet = 0.4 * length, 0.2 * r

    def draw(occ: Any) -> None:
        low = (3, occ.addCylinder(0, 0, 0, 0, 0, corner, r))
        high = (3, occ.addCylinder(0, 0, corner, 0, 0, length - corner, thin * r))
        ((_, tag),), _ = occ.fuse([low], [high])
        occ.synchronize()
        occ.fillet([tag], edges_within(thin * r, corner, corner), [fillet])

    return {
        "assembly": {"step": step_file(rng, folder, "shaft", draw), "held": ["body:-z"]},
        "strike": {"on": "body:+z", "at": [0.0, 0.0], "radius": 1e-3},
    }


def rounded_bracket(rng: Rng, folder: Path) -> Tables:
    """From a STEP file: a foot and a wall, the corner between them rounded off."""
    a, b, t, w, h = rng.uniform(
        [0.05, 0.025, 5e-3, 5e-3, 0.04], [0.08, 0.045, 9e-3, 9e-3, 0.07]
    ).tolist()

    def draw(occ: Any) -> None:
        solids = [(3, occ.addBox(0, 0, 0, a, b, t)), (3, occ.addBox(0, 0, 0, w, b, h))]
        ((_, tag),), _ = occ.fuse(solids[:1], solids[1:])
        occ.synchronize()
        occ.fillet([tag], edges_at(w, t), [rng.uniform(0.5, 1.0) * t])

    return {
        "assembly": {"step": step_file(rng, folder, "rounded", draw), "held": ["body:-z"]},
        "strike": {"on": "body:-x", "at": [0.0, 0.0]},
    }


def flange(rng: Rng, folder: Path) -> Tables:
    """From a STEP file: a round flange with bolt holes, at which it is held, and a pipe on it."""
    r, t, length = rng.uniform([0.03, 5e-3, 0.03], [0.045, 9e-3, 0.06]).tolist()
    pipe, bore, hole = 0.5 * r, 0.35 * r, 0.1 * r

    def draw(occ: Any) -> None:
        solids = [(3, occ.addCylinder(0, 0, 0, 0, 0, t, r))]
        solids.append((3, occ.addCylinder(0, 0, t, 0, 0, length, pipe)))
        (whole,), _ = occ.fuse(solids[:1], solids[1:])
        drills = [(3, occ.addCylinder(0, 0, 0, 0, 0, t + length, bore))]
        for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            drills.append((3, occ.addCylinder(0.78 * r * x, 0.78 * r * y, 0, 0, 0, t, hole)))
        occ.cut([whole], drills)

    return {
        "assembly": {"step": step_file(rng, folder, "flange", draw), "held": ["body:-z"]},
        "strike": {"on": "body:+z", "at": [(pipe + bore) / 2, 0.0], "radius": 1e-3},
    }


def step_file(rng: Rng, folder: Path, name: str, draw: Any) -> str:
    """The file of a part that is drawn with gmsh's kernel, lengths in m."""
    path = folder / f"{name}-{rng.integers(10**9)}.step"
    with session():
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        with silent():
            gmsh.write(str(path))
    return str(path)


def edges_within(radius: float, low: float, high: float) -> list[int]:
    """Circles of a radius about z, at heights from low to high."""
    tags = []
    for _, tag in gmsh.model.getEntities(1):
        box = np.reshape(gmsh.model.getBoundingBox(1, tag), (2, 3))
        if low - 1e-5 < box[0, 2] <= box[1, 2] < high + 1e-5:
            tags += [tag] if abs(np.ptp(box[:, 0]) / 2 - radius) < 1e-5 else []
    return tags


def edges_at(x: float, z: float) -> list[int]:
    """Edges along y at a place x, z."""
    tags = []
    for _, tag in gmsh.model.getEntities(1):
        box = np.reshape(gmsh.model.getBoundingBox(1, tag), (2, 3))
        if np.allclose(box[:, [0, 2]], [[x, z]] * 2, atol=1e-5):
            tags.append(tag)
    return tags


KINDS = (
    box, bolted, sprung, tube, on_fine_plate, l_profile,
    plate, halves, bracket, thick_tube, u_profile,
    screwed, shaft, tied, rounded_bracket, t_profile, flange,
)  # fmt: skip


def structure(seed: int, number: int, folder: Path, bound: int = BOUND) -> Scene:
    """The structure of this number, every other one of tetrahedra, then the others."""
    kind, rng = KINDS[number % len(KINDS)], np.random.default_rng([seed, number])
    tables = kind(rng, folder)
    tables["assembly"] = {**tables["assembly"], "material": "steel"}
    # an odd number of kinds: the second time around each has the other elements
    element = "tet" if number % 2 else "hex"
    tables["mesh"] = {"element": element, "error": ASKED[0], "unknowns": bound}
    return load_scene({**CHAIN, **tables, "name": f"{kind.__name__}-{number}"})


def part(path: Path, bound: int = BOUND) -> Scene:
    """The bodies of a STEP file, which float."""
    table = {"step": str(path), "held": [], "touching": "tied", "material": "steel"}
    mesh = {"element": "tet", "error": ASKED[0], "unknowns": bound}
    return load_scene({"name": path.stem, "assembly": table, "mesh": mesh})


class Goals(NamedTuple):
    """The bounded quantities on one mesh."""

    unknowns: int
    hz: np.ndarray  # (k,) of the lowest elastic modes
    shapes: np.ndarray  # (m, k) displacements at points
    compliance: float  # [m/N] beyond the half-space; nan of what floats
    whole: float  # [m/N] of it with the half-space


def goals(scene: Scene, parts: Parts, points: dict[str, np.ndarray]) -> Goals:
    model = assembly.model(scene, parts)
    modes = fem.modes(model.K, model.M, min(N_GOALS + 12, model.K.shape[0] - 2))
    elastic = np.flatnonzero(modes.omega > RIGID * modes.omega.max())[: N_GOALS + 4]
    compliance = whole = np.nan
    if (factor := assembly.factor(scene, model)) is not None:
        contact = assembly.contact(scene, parts, model)
        whole = float(contact.w @ factor.solve(contact.w))
        compliance = whole - contact_of(scene, model, contact).half_space
    phi = shapes(model, modes.phi[:, elastic], points)
    return Goals(model.K.shape[0], modes.omega[elastic] / (2 * np.pi), phi, compliance, whole)


def errors(on_mesh: Goals, limit: tuple[np.ndarray, float], finest: Goals) -> np.ndarray:
    """Relative errors (N_GOALS + 1,) of the goals, the compliance last; nan of none."""
    n = min(N_GOALS, len(finest.hz))
    i = paired(finest.shapes[:, :n], on_mesh.shapes, finest.hz[:n], on_mesh.hz)
    of_hz = np.abs(on_mesh.hz[i] / limit[0][:n] - 1)
    return np.append(of_hz, abs(on_mesh.compliance - limit[1]) / on_mesh.whole)


class Row(NamedTuple):
    """One error asked of one structure."""

    name: str
    kind: str
    element: str
    asked: float
    stated: float
    ended: str  # the bound that ended the search, or "met"
    unknowns: list[int]  # of each mesh
    share: float  # unknowns over those of even meshes of the same true error
    least: float  # the share foreseen of the best sizes
    # relative errors of the frequencies, and of the compliance last: nan of those that are not told
    stated_of: list[float]
    true_of: list[float]

    @property
    def true(self) -> float:
        """The largest; nan if the limit does not tell it."""
        return float(np.max(self.true_of, initial=0.0, where=np.isfinite(self.true_of))) or np.nan

    @property
    def ratios(self) -> np.ndarray:
        ratio = np.array(self.stated_of) / np.array(self.true_of)
        return ratio[np.isfinite(ratio)]


def compared(
    scene: Scene, kind: str = "", asked_errors: tuple[float, ...] = ASKED,
    scales: tuple[float, ...] = SCALES, most_unknowns: float | None = None,
) -> Iterator[Row]:  # fmt: skip
    most_unknowns = MOST_UNKNOWNS if most_unknowns is None else most_unknowns
    held = [pipeline_of(scene.but(mesh={"error": asked}), quiet) for asked in asked_errors]
    coarse = held[0]("mesh")
    is_hex = any(isinstance(mesh, MeshHex) for mesh in coarse.meshes.values())
    element = "hex" if is_hex else "tet"
    if not most_unknowns:
        for pipeline, asked in zip(held, asked_errors, strict=True):
            adapted = pipeline("sizes")
            yield Row(
                scene.name, kind or scene.name, element, asked, adapted.stated,
                adapted.bounded_by or "met", [m.unknowns for m in adapted.meshes],
                np.nan, np.nan, [], [],
            )  # fmt: skip
        return
    points = {b: m.p[:, :: max(1, m.nvertices // 150)].T for b, m in coarse.meshes.items()}

    # the limit, and its own error: from the finest mesh that can be split twice, or once
    def unknowns(pipeline: Any) -> int:
        return 3 * sum(pipeline("mesh").nodes.values())

    middle = held[MIDDLE::-1]
    coarser = (
        pipeline_of(scene.but(mesh={"error": min(k * max(asked_errors), 0.8)}), quiet)
        for k in (3, 10, 30)
    )
    base = next(
        chain(
            (p for p in middle if 64 * unknowns(p) <= most_unknowns),
            (p for p in chain(middle, coarser) if 8 * unknowns(p) <= most_unknowns),
        ),
        None,
    )
    if base is None:
        print(f"{scene.name}: {unknowns(held[0])} unknowns are too many to be split")
        return
    of_base = base("mesh")
    split: list[Goals] = []
    for times in range(3):
        meshes = {name: geometry.refined(m, times) for name, m in of_base.meshes.items()}
        parts = of_base._replace(meshes=meshes)
        if times > 1 and 3 * sum(parts.nodes.values()) > most_unknowns:
            break
        split.append(goals(scene, parts, points))
    finest = split[-1]

    def in_order(on_mesh: Goals) -> np.ndarray:
        """Frequencies of the modes of the finest mesh."""
        first = finest.shapes[:, :N_GOALS]
        return on_mesh.hz[paired(first, on_mesh.shapes, finest.hz[:N_GOALS], on_mesh.hz)]

    of_modes, own = extrapolated(np.array([in_order(m) for m in split]))
    (of_contact,), (own_contact,) = extrapolated(np.array([[m.compliance] for m in split]))
    own = np.append(own / of_modes, own_contact / finest.whole)
    limit = np.append(of_modes, of_contact)

    # what elements make of curved faces: a mesh of half the sizes beside the split one
    if max(map(abs, of_base.chords.values())) > FLAT:
        of_half = goals(scene, bodies.parts(scene, base("sizes").sizes, coarser=0.5), points)
        moved = np.append(
            in_order(of_half) / in_order(split[1]) - 1,
            (of_half.compliance - split[1].compliance) / finest.whole,
        )
        limit = limit + moved * np.append(of_modes, finest.whole)
        own = own + np.abs(moved) / 2
    limit = limit[:-1], limit[-1]

    # even meshes: their largest true errors, and shares foreseen of the best sizes beside them
    even, foreseen = [], []
    for scale in scales:
        parts = bodies.parts(scene.but(mesh={"scale": scale, "error": None}))
        if 3 * sum(parts.nodes.values()) > scene.mesh.unknowns:
            break
        on_mesh = goals(scene, parts, points)
        even.append((on_mesh.unknowns, np.nanmax(errors(on_mesh, limit, finest))))
        foreseen.append(least_share(scene, parts))

    for pipeline, asked in zip(held, asked_errors, strict=True):
        adapted, modes, missed = (pipeline(name) for name in ("sizes", "modes", "missed-energy"))
        on_mesh = goals(scene, pipeline("mesh"), points)
        true = errors(on_mesh, limit, finest)
        stated = np.full(len(true), np.nan)
        elastic = modes.omega > RIGID * modes.omega.max()
        n = min(N_GOALS, len(finest.hz))
        i = paired(finest.shapes[:, :n], on_mesh.shapes, finest.hz[:n], on_mesh.hz)
        stated[:-1] = missed.of_frequencies(modes.omega)[elastic][i]
        if missed.of_compliance is not None:
            stated[-1] = missed.of_compliance / on_mesh.whole
        told = np.isfinite(stated) & (true > 2 * own)
        worst = np.nanargmax(true)
        largest = true[worst] if told[worst] else np.nan
        yield Row(
            scene.name, kind or scene.name, element, asked, adapted.stated,
            adapted.bounded_by or "met", [m.unknowns for m in adapted.meshes],
            on_mesh.unknowns / even_unknowns(even, largest), at_error(even, foreseen, largest),
            np.where(told, stated, np.nan).tolist(), np.where(told, true, np.nan).tolist(),
        )  # fmt: skip


def even_unknowns(even: list[tuple[int, float]], error: float) -> float:
    """Unknowns of even meshes for an error, on the line through the logarithms of both nearest."""
    if len(even) < 2 or not np.isfinite(error):
        return np.nan
    n, e = np.log(np.array(even)).T
    slope, start = np.polyfit(e, n, 1) if len(even) == 2 else (None, None)
    if slope is None:
        order = np.argsort(np.abs(e - np.log(error)))[:3]
        slope, start = np.polyfit(e[order], n[order], 1)
    return float(np.exp(start + slope * np.log(error))) if slope < 0 else np.nan


def least_share(scene: Scene, parts: Parts) -> float:
    """Unknowns that the best sizes take for the errors that the mesh states, over its own."""
    found = indicators(scene, solved_on(scene, parts))
    layouts = {
        body: layout._replace(regions=[r._replace(coarsest=np.inf) for r in layout.regions])
        for body, layout in layouts_of(parts, found).items()
    }
    regions = [region for layout in layouts.values() for region in layout.regions]
    stated = float(np.max(sum(r.energy.sum(axis=0) for r in regions)))
    weights = balanced_weights(regions, stated)
    kappa = kappa_for(regions, stated, weights)
    nodes = parts.nodes
    of_bodies = [
        nodes[body] * layout.growth([r.factors(kappa, weights) for r in layout.regions])
        for body, layout in layouts.items()
    ]
    return sum(of_bodies) / sum(nodes.values())


def share_at(rows: list[Row], error: float) -> float:
    """Share of a structure at a true error, on the line of logarithms through those of the errors
    asked; nan beyond `FARTHEST` times them."""
    of = sorted((row.true, row.share) for row in rows if np.isfinite([row.true, row.share]).all())
    if not of or not of[0][0] / FARTHEST <= error <= of[-1][0] * FARTHEST:
        return np.nan
    true, share = np.log(np.array(of)).T
    return float(np.exp(np.interp(np.log(error), true, share)))


def at_error(even: list[tuple[int, float]], values: list[float], error: float) -> float:
    """The value of the even mesh whose error is the nearest."""
    if not even or not np.isfinite(error):
        return np.nan
    return values[int(np.argmin(np.abs(np.log([e for _, e in even]) - np.log(error))))]


def main(words: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("what", nargs="*", help="seed, number of structures, first; or STEP files")
    parser.add_argument("--asked", type=float, nargs="+", default=ASKED)
    parser.add_argument("--bound", type=int, default=BOUND)
    parser.add_argument("--even", type=int, default=len(SCALES), help="number of even meshes")
    parser.add_argument("--split", type=float, help="most unknowns of a mesh that is split")
    parser.add_argument("--to", type=Path)
    args = parser.parse_args(words)
    rows = [] if args.to is None else rows_of(args.to)
    done = {row.name for row in rows}

    with TemporaryDirectory() as folder:
        if any(not word.isdigit() for word in args.what):
            scenes = [
                (lambda p=Path(p): part(p, args.bound), "part", Path(p).stem) for p in args.what
            ]
        else:
            seed, n, first = [*map(int, args.what), *(0, 12, 0)[len(args.what) :]]
            scenes = [
                (lambda i=i: structure(seed, i, Path(folder), args.bound), kind, f"{kind}-{i}")
                for i in range(first, n)
                for kind in [KINDS[i % len(KINDS)].__name__]
            ]
        for made, kind, name in scenes:
            if name in done:
                continue
            try:
                scales = SCALES[: args.even]
                for row in compared(made(), kind, tuple(args.asked), scales, args.split):
                    rows.append(row)
                    print(line(row), flush=True)
                    if args.to:
                        with args.to.open("a") as file:
                            print(json.dumps(row._asdict()), file=file)
            except ValueError as reason:  # as of a strike drawn next to its face
                print(f"{name}: {reason}", flush=True)
    groups = {"hexahedra": ("hex",), "tetrahedra": ("tet",), "all": ("hex", "tet")}
    for kind in dict.fromkeys(row.kind for row in rows):
        print(f"{kind:15} {summary([row for row in rows if row.kind == kind])}")
    for name, of in groups.items():
        print(f"{name:15} {summary([row for row in rows if row.element in of])}")


def rows_of(path: Path) -> list[Row]:
    """The rows of a file; none where it does not exist yet."""
    if not path.exists():
        return []
    return [Row(**json.loads(text)) for text in path.read_text().splitlines()]


def line(row: Row) -> str:
    return (
        f"{row.name:18} {row.element} asked {row.asked:5.1%} stated {row.stated:6.2%} "
        f"true {row.true:6.2%} share {row.share:5.2f} "
        f"least {row.least:5.2f} {row.ended:8} "
        f"{', '.join(map(str, row.unknowns))}"
    )


def summary(rows: list[Row]) -> str:
    """Ratios of numbers and of whole meshes, errors met, and shares, as a line."""
    ratios = np.array([ratio for row in rows for ratio in row.ratios])
    whole = np.array([row.stated / row.true for row in rows if np.isfinite(row.true)])
    shares = [[row.share, row.least] for row in rows if np.isfinite(row.share)]
    share, least = np.reshape(shares, (-1, 2)).T
    of_names = [[row for row in rows if row.name == name] for name in {row.name for row in rows}]
    shares_at = [[share_at(of, error) for of in of_names] for error in TRUE]
    told = [[f"{share:.2f}" for share in sorted(s) if np.isfinite(share)] for s in shares_at]
    met = f"met by {sum(row.stated <= row.asked for row in rows)} of {len(rows)}"
    if not len(ratios):
        return met if rows else "none"
    return (
        f"{len(ratios)} numbers: stated over true {ratios.min():.2f} least, "
        f"{np.median(ratios):.2f} median, at least 0.9 of {np.mean(ratios >= 0.9):.1%}, 1 to 4 of "
        f"{np.mean((ratios >= 1) & (ratios <= 4)):.1%}; {len(whole)} meshes: "
        f"{whole.min():.2f} least, {np.median(whole):.2f} median, {met}; "
        "unknowns over even "
        + (f"{np.median(share):.2f} median of {len(share)}" if len(share) else "not compared")
        + (f", foreseen {np.median(least):.2f} at least" if len(share) else "")
        + "".join(
            f"; at {error:.1%} {', '.join(each)}"
            for error, each in zip(TRUE, told, strict=True)
            if each
        )
    )


if __name__ == "__main__":
    main()
