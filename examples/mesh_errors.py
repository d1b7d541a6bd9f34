"""Whether the errors that are stated of meshes hold, on structures made from a seed.

You will see, for each kind of quantity, how many were compared, and of

    ratio = stated error of the mesh / true error

the least, the median, the largest, and the share from 1 to 4. The structures are boxes, plates with
holes, L, T and U profiles and tubes, of one body or of two that are tied or bolted, drawn or from a
STEP file, each at three values of mesh.scale.
"""

import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import gmsh
import numpy as np

from geometry.gmsh_session import session
from workflows.files.scene import scene as load_scene
from workflows.scene import Scene
from workflows.stages import assembly

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
        "strike": {"on": "tube:cylinder", "at": [radius, 0, length * rng.uniform(0.0, 0.35)],
                   "radius": 1.5e-3},
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
    a, b, t, s = rng.uniform([0.07, 0.06, 5e-3, 12e-3], [0.12, 0.09, 10e-3, 25e-3]).tolist()
    outline = [[0, 0], [a, 0], [a, b], [0, b]]
    at = [[0.015, 0.015], [a - 0.015, 0.015], [a - 0.015, b - 0.015], [0.015, b - 0.015]]
    holes = {"diameter": 8e-3, "at": at}
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
    """The structure of this number, with so many unknowns as are drawn too."""
    kind, rng = KINDS[number % len(KINDS)], np.random.default_rng([seed, number])
    drawn = kind(rng, folder)
    drawn["assembly"] = {**drawn["assembly"], "material": str(rng.choice(["steel", "aluminium"]))}
    scene = load_scene({**CHAIN, **drawn, "name": f"{kind.__name__}-{number}"})
    n, wanted = 3 * sum(assembly.mesh(scene).nodes.values()), np.exp(rng.uniform(*np.log(UNKNOWNS)))
    return scene.but(mesh={"scale": float((n / wanted) ** (1 / 3))})
