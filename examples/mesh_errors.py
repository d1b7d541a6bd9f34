"""Check of the errors that are stated of meshes, on structures made from a seed.

You will see, for each kind of quantity, how many were compared, and of

    ratio = stated error of the mesh / true error

the least, the median, the largest, and the share from 1 to 4. Where both errors are below 0.1 % of
the quantity nobody acts on them: these are counted in a column of their own. The structures are
boxes, plates with holes, L, T and U profiles and tubes, of one body or of two, tied or bolted,
drawn or from a STEP file, each at three values of mesh.scale.

True values are extrapolated from the coarsest of the three meshes, each element split in 8 and in
64, with the order observed. Half the difference to an extrapolation by an order of 1.5 is their own
error, of two meshes alone half that between the orders 1 and 3; true errors below twice that, or
below those stated of time step and reduction, are left out.

Run it: python examples/mesh_errors.py            seed 0, 20 structures
        python examples/mesh_errors.py 7 5        another seed, the first five
"""

import sys
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import gmsh
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree

from beadwave import dem, fem, geometry
from beadwave.dem.waves.chain_waves import chain_waves
from beadwave.geometry.meshing.gmsh_session import session, silent
from beadwave.rom.contact_modes import KrylovOptions
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.engine.pipeline import Pipeline, pipeline_of
from beadwave.workflows.stages.errors.mesh_error import MeshErrorEstimate
from beadwave.workflows.stages.errors.number_errors import numbers_of
from beadwave.workflows.stages.structure import assembly
from beadwave.workflows.stages.structure.krylov_space import krylov_space
from beadwave.workflows.stages.structure.meshed_parts import Parts
from beadwave.workflows.stages.structure.reduction import TO_HZ, contact_of

SCALES = (1.5, 1.0, 0.67)  # of mesh.scale, times that of the structure
UNKNOWNS = (1.5e3, 3.5e3)  # of a structure at the middle scale, smallest and largest
CHAIN = {
    "chain": {"count": 8, "radius": 0.005, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.2},
    "wall": {"kind": "rom"},
    "damping": {"kind": "modal", "ratio": 0.01},
    "time": {"duration": 5e-4},
    "output": {"spheres": [1, 4]},
    "materials": {
        "steel": {"young": 210e9, "poisson": 0.3, "density": 7850.0},
        "aluminium": {"young": 70e9, "poisson": 0.33, "density": 2700.0},
    },
}

Rng = np.random.Generator
Tables = dict[str, Any]


def box(rng: Rng, folder: Path) -> Tables:
    """A thick cantilever, struck on its side."""
    x, y, z = rng.uniform([0.08, 0.02, 0.02], [0.2, 0.05, 0.05]).tolist()
    return {
        "bodies": {"beam": {"box": [x, y, z]}},
        "assembly": {"held": ["beam:-x"]},
        "strike": {"on": "beam:+y", "at": [x * rng.uniform(-0.1, 0.4), 0.0]},
    }


def plate(rng: Rng, folder: Path) -> Tables:
    """A plate with a hole, held at an edge."""
    a, b, t = rng.uniform([0.08, 0.05, 3e-3], [0.16, 0.08, 10e-3]).tolist()
    drilled = {"diameter": b * rng.uniform(0.15, 0.35), "at": [[0.3 * a, b / 2]]}
    outline = {"outline": [[0, 0], [a, 0], [a, b], [0, b]], "thickness": t}
    return {
        "bodies": {"plate": {"plate": outline, "holes": drilled}},
        "assembly": {"held": ["plate:-x"]},
        "strike": {"on": "plate:+z", "at": [a * rng.uniform(0.6, 0.85), b * 0.4, t]},
    }


def _profile(outline: list, length: float, at: list[float]) -> Tables:
    """A length of a profile along z that is held at its lowest face, struck at a point."""
    return {
        "bodies": {"profile": {"plate": {"outline": outline, "thickness": length}}},
        "assembly": {"held": ["profile:-y"]},
        "strike": {"on": "profile@" + ",".join(f"{x:.6f}" for x in at)},
    }


def l_profile(rng: Rng, folder: Path) -> Tables:
    a, b, w, t = rng.uniform([0.04, 0.05, 6e-3, 0.02], [0.07, 0.09, 14e-3, 0.05]).tolist()
    outline = [[0, 0], [a, 0], [a, w], [w, w], [w, b], [0, b]]
    return _profile(outline, t, [0.0, b * rng.uniform(0.6, 0.85), t / 2])


def t_profile(rng: Rng, folder: Path) -> Tables:
    a, b, w, t = rng.uniform([0.04, 0.05, 6e-3, 0.02], [0.07, 0.09, 14e-3, 0.05]).tolist()
    left, right = (a - w) / 2, (a + w) / 2
    outline = [[0, 0], [a, 0], [a, w], [right, w], [right, b], [left, b], [left, w], [0, w]]
    return _profile(outline, t, [left, b * rng.uniform(0.6, 0.85), t / 2])


def u_profile(rng: Rng, folder: Path) -> Tables:
    a, b, w, t = rng.uniform([0.05, 0.04, 6e-3, 0.02], [0.08, 0.08, 12e-3, 0.05]).tolist()
    outline = [[0, 0], [a, 0], [a, b], [a - w, b], [a - w, w], [w, w], [w, b], [0, b]]
    return _profile(outline, t, [0.0, b * rng.uniform(0.6, 0.85), t / 2])


def tube(rng: Rng, folder: Path) -> Tables:
    """A tube that is held at one end and struck on its side."""
    radius, length = rng.uniform([0.018, 0.06], [0.035, 0.15]).tolist()
    shape = {"radius": radius, "length": length, "bore": radius * rng.uniform(0.4, 0.75)}
    return {
        "bodies": {"tube": {"cylinder": shape}},
        "assembly": {"held": ["tube:-z"]},
        "strike": {
            "on": "tube:cylinder",
            "at": [radius, 0, length * rng.uniform(0.0, 0.35)],
            "radius": 1.5e-3,
        },
    }


def tied(rng: Rng, folder: Path) -> Tables:
    """A box that stands on a plate, tied to it."""
    a, b, t = rng.uniform([0.06, 0.05, 8e-3], [0.1, 0.08, 16e-3]).tolist()
    x, y, z = rng.uniform([0.015, 0.015, 0.03], [0.03, 0.03, 0.07]).tolist()
    return {
        "bodies": {
            "base": {"box": [a, b, t], "at": [0, 0, -t / 2]},
            "post": {"box": [x, y, z], "at": [0.1 * a, 0, z / 2]},
        },
        "assembly": {"held": ["base:-x"], "touching": "tied"},
        "strike": {"on": "post:-x", "at": [0.0, z * rng.uniform(0.0, 0.3)]},
    }


def bolted(rng: Rng, folder: Path) -> Tables:
    """A cover on a base, bolted at its corners."""
    a, b, t, s = rng.uniform([0.05, 0.03, 6e-3, 10e-3], [0.07, 0.04, 10e-3, 20e-3]).tolist()
    outline = [[0, 0], [a, 0], [a, b], [0, b]]
    at = [[0.012, b / 2], [a - 0.012, b / 2]]
    holes = {"diameter": 10e-3, "at": at}
    return {
        "bodies": {
            "base": {"plate": {"outline": outline, "thickness": s}, "holes": holes},
            "cover": {
                "plate": {"outline": outline, "thickness": t}, "holes": holes, "at": [0, 0, s],
            },
        },
        "assembly": {"held": ["base:-z"], "touching": "free"},
        "strike": {"on": "cover:+z", "at": [a * rng.uniform(-0.2, 0.2), 0.1 * b]},
        "joints": [
            {"name": "bolts", "between": "cover|base", "kz": float(10 ** rng.uniform(7.5, 8.7))}
        ],
    }  # fmt: skip


def bracket(rng: Rng, folder: Path) -> Tables:
    """From a STEP file: a foot with two holes and a wall, the corner between them sharp."""
    a, b, t, w, h = rng.uniform(
        [0.05, 0.025, 5e-3, 5e-3, 0.04], [0.08, 0.045, 9e-3, 9e-3, 0.07]
    ).tolist()
    path = folder / f"bracket-{rng.integers(10**9)}.step"
    with session():
        occ = gmsh.model.occ
        solids = [(3, occ.addBox(0, 0, 0, a, b, t)), (3, occ.addBox(0, 0, 0, w, b, h))]
        (whole,), _ = occ.fuse(solids[:1], solids[1:])
        drills = [(3, occ.addCylinder(0.7 * a, y * b, 0, 0, 0, t, 4.5e-3)) for y in (0.25, 0.75)]
        occ.cut([whole], drills)
        occ.synchronize()
        with silent():
            gmsh.write(str(path))
    return {
        "assembly": {"step": str(path), "held": ["body:-z"]},
        "strike": {"on": "body:-x", "at": [0.0, b / 2, h * rng.uniform(0.6, 0.85)]},
    }


def halves(rng: Rng, folder: Path) -> Tables:
    """Two tubes on end, tied face to face."""
    radius, length = rng.uniform([0.015, 0.03], [0.025, 0.06]).tolist()
    low = {"radius": radius, "length": length, "bore": radius * rng.uniform(0.3, 0.6)}
    high = {"radius": radius * rng.uniform(0.75, 1.0), "length": length, "bore": low["bore"]}
    return {
        "bodies": {
            "low": {"cylinder": low, "at": [0, 0, length / 2]},
            "high": {"cylinder": high, "at": [0, 0, 1.5 * length]},
        },
        "assembly": {"held": ["low:-z"], "touching": "tied"},
        "strike": {"on": "high:cylinder", "at": [high["radius"], 0, 1.6 * length], "radius": 1e-3},
    }


KINDS = (box, plate, l_profile, t_profile, u_profile, tube, tied, bolted, bracket, halves)


def structure(seed: int, number: int, folder: Path) -> Scene:
    """The structure of this number, with a random number of unknowns."""
    kind, rng = KINDS[number % len(KINDS)], np.random.default_rng([seed, number])
    tables = kind(rng, folder)
    tables["assembly"] = {**tables["assembly"], "material": str(rng.choice(["steel", "aluminium"]))}
    scene = load_scene({**CHAIN, **tables, "name": f"{kind.__name__}-{number}"})
    n, wanted = 3 * sum(assembly.mesh(scene).nodes.values()), np.exp(rng.uniform(*np.log(UNKNOWNS)))
    return scene.but(mesh={"scale": float((n / wanted) ** (1 / 3))})


N_MODES = 8  # compared
NEGLIGIBLE = 1e-3  # of a quantity: errors stated and true that are both smaller are only counted
MOST_UNKNOWNS = 1.6e5  # of a reference


def shapes(model: fem.Model, phi, points: dict[str, np.ndarray]) -> np.ndarray:
    """Displacements (m, k) at points of the bodies, means of the four nearest nodes."""
    u = (model.T @ phi)[: model.structure.n_dofs].reshape(-1, 3, phi.shape[1])
    rows = []
    for body, at in points.items():
        nodes = model.structure.dofs(body)[::3] // 3
        distance, nearest = KDTree(model.structure.points[nodes]).query(at, k=4)
        share = 1 / (distance + 1e-9) ** 2
        share /= share.sum(axis=1, keepdims=True)
        rows.append((share[:, :, None, None] * u[nodes[nearest]]).sum(axis=1))
    return np.concatenate(rows).reshape(-1, phi.shape[1])


def reference(scene: Scene, parts: Parts, points: dict[str, np.ndarray], start, run):
    """Numbers of a run on a mesh by name, and the shapes of its modes."""
    model = assembly.model(scene, parts)
    contact = assembly.contact(scene, parts, model)
    space = krylov_space(scene, parts, model, assembly.factor(scene, model))
    modes = assembly.modes(scene, model, space)
    order = np.argsort(space.pairs.omega)
    omega, w = space.pairs.omega[order], space.pairs.phi[:, order].T @ contact.w
    static = int(np.sum(omega > KrylovOptions().reach * 2 * np.pi * TO_HZ))
    plain = MeshErrorEstimate(omega, np.zeros((len(omega), len(omega))), w, static)
    wall = plain.walls(contact_of(scene, model, contact))[0]
    march = dem.march(
        start.chain, wall_of(scene.but(wall={"cutoff": None}), wall), start.velocity,
        duration=float(run.t[-1]), n_save=len(run.t) - 1, dt=run.dt,
    )  # fmt: skip
    waves = chain_waves(march, start.chain, scene.output.spheres, at_wall=True)
    numbers = {name: entry[0] for name, entry in numbers_of(march, waves).items()}
    compliance = float(np.sum((w / omega) ** 2)) - wall.contact.half_space
    numbers["static_compliance_m_per_N"] = compliance
    return numbers, modes.omega[:20] / (2 * np.pi), shapes(model, modes.phi[:, :20], points)


def paired(first: np.ndarray, second: np.ndarray, f1: np.ndarray, f2: np.ndarray) -> np.ndarray:
    """Of each mode of the first the one of the second, one to one, by MAC and frequency."""
    cost = 1 - fem.mac(first, second) + 2 * np.abs(np.log(f1[:, None] / f2))
    return linear_sum_assignment(cost)[1]


def extrapolated(f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Limit (m,) and its own error (m,) of values f (k, m) on meshes each twice as fine as the one
    before: by the order 1.5, and where there are three by the order that these show."""
    last = f[-1] - f[-2]
    fixed = f[-1] + last / (2**1.5 - 1)
    if len(f) < 3:  # of two no order is seen: from 1, singular, to 3
        return fixed, np.abs(last) * (1 - 1 / 7) / 2
    ratio = (f[-2] - f[-3]) / np.where(last == 0, 1e-300, last)
    limit = f[-1] + last / (np.clip(ratio, 2.0, 16.0) - 1)
    return limit, np.abs(limit - fixed) / 2 + np.abs(limit - f[-1]) / 20


def stated(pipeline: Pipeline) -> dict[str, tuple[float, float, float]]:
    """Value, error of the mesh, and error of time step and reduction, of each number that the run
    states with an error of its mesh."""
    numbers = [*pipeline("quantity-errors"), *pipeline("structure-errors")]
    return {
        q.name: (q.value, q.mesh, (q.time or 0.0) + (q.reduction or 0.0))
        for q in numbers
        if q.mesh is not None
    }


def compared(scene: Scene) -> list[tuple[str, float, float, float]]:
    """Kind of quantity, mesh.scale, relative error stated and true, of all that are compared."""
    # the runs whose stated errors are judged, and references by the coarsest of their meshes, whole
    # and with every element split, so that all errors are those of one sequence
    base = scene.mesh.scale
    runs = [
        pipeline_of(scene.but(mesh={"scale": base * k}), lambda name: nullcontext()) for k in SCALES
    ]
    start, run, coarse = runs[0]("start"), runs[0]("impact").trajectory, runs[0]("mesh")
    points = {b: m.p[:, :: max(1, m.nvertices // 150)].T for b, m in coarse.meshes.items()}
    meshes = []
    for times in range(3):
        split = {name: geometry.refined(mesh, times) for name, mesh in coarse.meshes.items()}
        parts = coarse._replace(meshes=split)
        if times and 3 * sum(parts.nodes.values()) > MOST_UNKNOWNS:
            break
        meshes.append(reference(runs[0].scene, parts, points, start, run))
    if len(meshes) < 2:
        return []

    # limits of numbers by name, of frequencies by the shapes of the finest mesh
    names = sorted(set.intersection(*(set(numbers) for numbers, _, _ in meshes)))
    limit, of_limit = extrapolated(np.array([[n[name] for name in names] for n, _, _ in meshes]))
    _, hz, phi = meshes[-1]
    order = [paired(phi, shape, hz, f) for _, f, shape in meshes]
    hz_limit, of_hz = extrapolated(
        np.array([f[i] for (_, f, _), i in zip(meshes, order, strict=True)])
    )

    # stated beside true, where the true error stands clear of those of the limit and of the run
    rows = []
    for k, pipeline in zip(SCALES, runs, strict=True):
        modes, missed, model = pipeline("modes"), pipeline("missed-energy"), pipeline("model")
        i = paired(
            phi, shapes(model, modes.phi[:, :20], points), hz, modes.omega[:20] / (2 * np.pi)
        )
        relative = missed.of_frequencies(modes.omega)[i]
        computed = modes.omega[i] / (2 * np.pi)
        for j in range(N_MODES):
            true = abs(computed[j] / hz_limit[j] - 1)
            if true > 2 * of_hz[j] / hz_limit[j]:
                rows.append(("frequency", k, float(relative[j]), true))
        table = stated(pipeline)
        for j, name in enumerate(names):
            value, of_mesh, rest = table.get(name, (np.nan, np.nan, np.nan))
            true = abs(value - limit[j])
            if true > 2 * of_limit[j] + rest and true > 1e-6 * abs(value):
                kind = name.rpartition(": ")[2]
                rows.append((kind, k, of_mesh / abs(value), true / abs(value)))
    return rows


def main(seed: int = 0, n: int = 20) -> None:
    rows = []
    with TemporaryDirectory() as folder:
        for number in range(n):
            try:
                scene = structure(seed, number, Path(folder))
                more = compared(scene)
            except ValueError as reason:  # as of a strike drawn beside its face
                print(f"{number}: {reason}")
                continue
            rows += more
            print(f"{scene.name:25} {spread(more)}", flush=True)
    print(f"{'quantity':25} {'n':>4} {'small':>5} {'least':>6} {'median':>6} {'largest':>7} 1 to 4")
    for kind in (*dict.fromkeys(kind for kind, *_ in rows), "all"):
        print(f"{kind:25} {spread([row for row in rows if kind in (row[0], 'all')])}")


def spread(rows: list[tuple[str, float, float, float]]) -> str:
    """Number of ratios, of negligible errors, and of the ratios their least, median, largest, and
    the share from 1 to 4."""
    r = np.array([stated / true for *_, stated, true in rows if max(stated, true) > NEGLIGIBLE])
    counts = f"{len(r):4d} {len(rows) - len(r):5d}"
    if not len(r):
        return counts
    within = 100 * np.mean((r >= 1) & (r <= 4))
    return f"{counts} {r.min():6.2f} {np.median(r):6.2f} {r.max():7.2f} {within:4.0f} %"


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
