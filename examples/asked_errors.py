"""Check of meshes whose sizes follow from mesh.error, on structures made from a seed.

You will see, of each structure and each error asked: what ended the search, the unknowns, the error
stated and the true one, both the largest of the frequencies of the first twelve elastic modes and
of the static compliance at the contact, and the unknowns that mesh.scale alone takes for the same
true error. Below stand, of hexahedra, of tetrahedra and of all,

    ratio = stated error / true error      of each frequency and compliance that is told apart
    share = unknowns / unknowns of mesh.scale alone at the same true error

The structures are those of `mesh_errors.py` and plates on springs with a mass, boxes tied to a
plate of small elements, and blind bores; every other one has tetrahedra.

True values are extrapolated from the mesh of the middle error asked, each element split in 8 and,
where that is not too much, in 64. A true error below twice that of its limit is not counted.

Run it: python examples/asked_errors.py            seed 0, 12 structures
        python examples/asked_errors.py 7 5        another seed, the first five
        python examples/asked_errors.py 7 5 3      of these those from number 3 on
"""

import sys
from contextlib import nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from beadwave import fem, geometry
from beadwave.fem.modes.mac import RIGID
from beadwave.workflows.files.scene import scene as load_scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
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
    tube,
    u_profile,
)

ASKED = (0.05, 0.02, 0.005)  # mesh.error
MIDDLE = 1  # of these, whose mesh is split for the limit, or an earlier one's if it is smaller
BOUND = 40_000  # mesh.unknowns
MOST_UNKNOWNS = 1.3e5  # of a mesh that is split
SCALES = (2.0, 1.4, 1.0, 0.7, 0.5)  # mesh.scale of even meshes
N_GOALS = 12

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


KINDS = (
    box, bolted, sprung, tube, on_fine_plate, l_profile,
    plate, halves, bracket, thick_tube, u_profile,
)  # fmt: skip


def structure(seed: int, number: int, folder: Path) -> Scene:
    """The structure of this number, every other one of tetrahedra."""
    kind, rng = KINDS[number % len(KINDS)], np.random.default_rng([seed, number])
    tables = kind(rng, folder)
    tables["assembly"] = {**tables["assembly"], "material": "steel"}
    # eleven kinds in turn: the second time around each has the other elements
    tables["mesh"] = {"element": "tet" if number % 2 else "hex", "unknowns": BOUND}
    return load_scene({**CHAIN, **tables, "name": f"{kind.__name__}-{number}"})


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

    element: str
    asked: float
    stated: float
    true: float  # nan where the limit does not tell it
    share: float  # unknowns over those of even meshes of the same true error
    ratios: list[float]  # of numbers


def compared(scene: Scene) -> list[Row]:
    held = [
        pipeline_of(scene.but(mesh={"error": asked}), lambda name: nullcontext())
        for asked in ASKED
    ]  # fmt: skip
    coarse = held[0]("mesh")
    points = {b: m.p[:, :: max(1, m.nvertices // 150)].T for b, m in coarse.meshes.items()}

    # the limit, and its own error
    of_middle = next(
        (
            mesh
            for pipeline in held[MIDDLE::-1]
            if 8 * 3 * sum((mesh := pipeline("mesh")).nodes.values()) <= MOST_UNKNOWNS
        ),
        coarse,
    )
    split: list[Goals] = []
    for times in range(3):
        if split and 6 * split[-1].unknowns > MOST_UNKNOWNS:
            break
        meshes = {name: geometry.refined(m, times) for name, m in of_middle.meshes.items()}
        parts = of_middle._replace(meshes=meshes)
        if times and 3 * sum(parts.nodes.values()) > MOST_UNKNOWNS:
            break
        split.append(goals(scene, parts, points))
    if len(split) < 2:
        print(f"{scene.name}: {split[0].unknowns} unknowns are too many to be split")
        return []
    finest = split[-1]
    hz = [
        m.hz[paired(finest.shapes[:, :N_GOALS], m.shapes, finest.hz[:N_GOALS], m.hz)] for m in split
    ]
    of_modes, own = extrapolated(np.array(hz))
    (of_contact,), (own_contact,) = extrapolated(np.array([[m.compliance] for m in split]))
    limit, own = (of_modes, of_contact), np.append(own / of_modes, own_contact / finest.whole)

    # even meshes: their largest true errors
    even = []
    for scale in SCALES:
        parts = bodies.parts(scene.but(mesh={"scale": scale}))
        if 3 * sum(parts.nodes.values()) > BOUND:
            break
        on_mesh = goals(scene, parts, points)
        even.append((on_mesh.unknowns, np.nanmax(errors(on_mesh, limit, finest))))

    rows = []
    for pipeline, asked in zip(held, ASKED, strict=True):
        adapted, modes, missed = (pipeline(name) for name in ("sizes", "modes", "missed-energy"))
        on_mesh = goals(scene, pipeline("mesh"), points)
        true = errors(on_mesh, limit, finest)
        stated = np.full(len(true), np.nan)
        elastic = modes.omega > RIGID * modes.omega.max()
        i = paired(finest.shapes[:, :N_GOALS], on_mesh.shapes, finest.hz[:N_GOALS], on_mesh.hz)
        stated[:-1] = missed.of_frequencies(modes.omega)[elastic][i]
        if missed.of_compliance is not None:
            stated[-1] = missed.of_compliance / on_mesh.whole
        told = np.isfinite(stated) & (true > 2 * own)
        worst = np.nanargmax(true)
        largest = float(true[worst]) if told[worst] else np.nan
        row = Row(
            scene.mesh.element, asked, adapted.stated, largest,
            on_mesh.unknowns / even_unknowns(even, largest), (stated[told] / true[told]).tolist(),
        )  # fmt: skip
        rows.append(row)
        meshes = ", ".join(f"{m.unknowns}" for m in adapted.meshes)
        print(
            f"{scene.name:18} {row.element} asked {asked:5.1%} stated {row.stated:6.2%} "
            f"true {row.true:6.2%} share {row.share:5.2f} {adapted.bounded_by or 'met':8} {meshes}",
            flush=True,
        )
    return rows


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


def main(seed: int = 0, n: int = 12, first: int = 0) -> None:
    rows: list[Row] = []
    with TemporaryDirectory() as folder:
        for number in range(first, n):
            try:
                rows += compared(structure(seed, number, Path(folder)))
            except ValueError as reason:  # as of a strike drawn next to its face
                print(f"{number}: {reason}", flush=True)
    for name, of in {"hexahedra": ("hex",), "tetrahedra": ("tet",), "all": ("hex", "tet")}.items():
        print(f"{name:11} {summary([row for row in rows if row.element in of])}")


def summary(rows: list[Row]) -> str:
    """Ratios of numbers and of whole meshes, errors met, and shares, as a line."""
    ratios = np.array([ratio for row in rows for ratio in row.ratios])
    whole = np.array([row.stated / row.true for row in rows if np.isfinite(row.true)])
    share = np.array([row.share for row in rows if np.isfinite(row.share)])
    if not len(ratios):
        return "none"
    return (
        f"{len(ratios)} numbers: stated over true {ratios.min():.2f} least, "
        f"{np.median(ratios):.2f} median, at least 0.9 of {np.mean(ratios >= 0.9):.1%}, 1 to 4 of "
        f"{np.mean((ratios >= 1) & (ratios <= 4)):.1%}; {len(whole)} meshes: "
        f"{whole.min():.2f} least, {np.median(whole):.2f} median, met by "
        f"{np.mean([row.stated <= row.asked for row in rows]):.0%}; unknowns over even "
        f"{np.median(share):.2f} median of {len(share)}"
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
