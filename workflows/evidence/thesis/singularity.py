"""The contact node's compliance on ever finer meshes, and what it should have been.

A force at a single node sinks in like 1/h. Read beside it, the wall's displacement converges, but
then force and reading differ. A patch converges with one functional for both, and what it has
beyond the half-space under it is the structure's alone. Thesis, figures 6.2 and 6.3.
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import fem
from fem.trace import trace
from workflows.evidence.prose import rendered
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.scene.parts import with_assembly
from workflows.stages import assembly as stages
from workflows.stages.assembly import material
from workflows.stages.pipeline import Progress
from workflows.stages.rig import STRUCK

SEEDS = (4e-3, 2e-3, 1e-3, 0.5e-3)  # [m] at the contact
REACH = 8e-3  # [m] to either side of the contact that is drawn
SPOT = 1e-7  # [m] radius of what reads a point


class Answer(NamedTuple):
    """One mesh; compliances [m/N], profiles (k,) [m/N] along y per unit force."""

    seed: float  # [m]
    n_dofs: int
    node: float
    recovery: float
    patch: float
    patch_structure: float
    node_structure: float
    y: NDArray[np.float64]  # (k,) [m] from the contact
    under_node: NDArray[np.float64]
    under_patch: NDArray[np.float64]


def singularity(scene: Scene, progress: Progress) -> Finding:
    """Compliance of a contact node and of a patch against the mesh (thesis, figures 6.2, 6.3)."""
    with_assembly(scene)
    answers = []
    for seed in SEEDS:
        with progress(f"contact seed {1e3 * seed:g} mm"):
            answers.append(_answer(scene, seed))
    columns = (
        "seed_mm", "dofs", "node", "node_itself", "growth", "recovery_points", "patch",
        "structure_by_patch", "structure_by_node",
    )  # fmt: skip
    sunk = [a.node - a.patch_structure for a in answers]
    grown = [None, *(finer / coarser for coarser, finer in pairwise(sunk))]
    rows = tuple(
        (1e3 * a.seed, a.n_dofs, a.node, own, g, a.recovery, a.patch, a.patch_structure,
         a.node_structure)
        for a, own, g in zip(answers, sunk, grown, strict=True)
    )  # fmt: skip
    picture = Picture("study_singularity", _picture(answers))
    return Finding(
        (Table("singularity", columns, rows),),
        rendered(__file__, **_numbers(scene, answers, grown)),
        (picture,),
    )


def _answer(scene: Scene, seed: float) -> Answer:
    fine = scene.but(mesh={"contact_seed": seed})
    model = stages.model(fine, stages.mesh(fine))
    point, radius = scene.patch.point, scene.patch.radius
    node = fem.node_patch(model, STRUCK, [point])
    patch = fem.contact_patch(model, STRUCK, point, radius)
    u = fem.factorised(model.K).solve(np.column_stack([node.w, patch.w]))
    steel = material(scene.assembly, "block")
    local = [fem.half_space_on_mesh(model, STRUCK, one, steel) for one in (node, patch)]
    y = np.linspace(-REACH, REACH, 321)
    profile = _read_along(model, patch, y) @ u
    return Answer(
        seed=seed,
        n_dofs=model.M.shape[0],
        node=float(node.w @ u[:, 0]),
        recovery=float(_recovery(model, point, radius) @ u[:, 0]),
        patch=float(patch.w @ u[:, 1]),
        patch_structure=float(patch.w @ u[:, 1] - local[1]),
        node_structure=float(node.w @ u[:, 0] - local[0]),
        y=y,
        under_node=profile[:, 0],
        under_patch=profile[:, 1],
    )


def _recovery(model: fem.Model, point, radius: float) -> NDArray[np.float64]:
    """w (n,) that reads the mean of two points a radius to either side, between nodes or not."""
    y, z = point
    sides = [(y - radius, z), (y + radius, z)]
    return sum(fem.contact_patch(model, STRUCK, side, SPOT).w for side in sides) / 2


def _read_along(model: fem.Model, patch: fem.ContactPatch, y) -> NDArray[np.float64]:
    """Displacement into the wall at y [m] beside the contact, (k, n) on the free dofs."""
    spots = patch.spot.point + np.column_stack([np.zeros_like(y), y, np.zeros_like(y)])
    P = trace(model.structure, STRUCK, spots)[0::3]
    return patch.spot.inward[0] * (P @ model.T)


def _numbers(scene: Scene, answers: list[Answer], grown: list[float | None]) -> dict[str, Any]:
    steel = material(scene.assembly, "block")
    return {
        "radius": scene.patch.radius,
        "sunk": [answer.node - answer.patch_structure for answer in answers],
        "growth": grown[1:],
        "last": answers[-1],
        "recovery_change": abs(answers[-1].recovery / answers[-2].recovery - 1),
        "patch_change": abs(answers[-1].patch / answers[-2].patch - 1),
        "dent": (1 - steel.poisson**2) / (np.pi * steel.young * scene.patch.radius),
        "patch_spread": _spread([answer.patch_structure for answer in answers]),
        "node_spread": _spread([answer.node_structure for answer in answers]),
    }


def _spread(values: list[float]) -> float:
    return float(np.ptp(values) / np.mean(values))


def _picture(answers: list[Answer]) -> bytes:
    limits = (0.0, 1.05e9 * max(a.under_node.max() for a in answers))
    force = [
        Panel(title, "y from the contact [mm]", "displacement [nm/N]", lines, y_limits=limits)
        for title, lines in (
            (
                "force at the node: depends on the mesh (figure 6.2)",
                _profiles(answers, "under_node"),
            ),
            ("the same force over a patch: converged", _profiles(answers, "under_patch")),
        )
    ]
    return panels([*force, *_convergence(answers)], columns=2, size=(5.2, 3.6))


def _profiles(answers: list[Answer], name: str) -> list[Line]:
    return [
        Line(f"{1e3 * a.seed:g} mm at the contact", 1e3 * a.y, 1e9 * getattr(a, name))
        for a in answers
    ]


def _differences(values: NDArray[np.float64], best: float) -> NDArray[np.float64]:
    """In parts per million, without the zero that a logarithm cannot show."""
    off = 1e6 * np.abs(values / best - 1)
    return np.where(off > 0, off, np.nan)


def _convergence(answers: list[Answer]) -> tuple[Panel, Panel]:
    seeds = np.array([1e3 * a.seed for a in answers])
    own = np.array([a.patch_structure for a in answers])
    names = {
        "node": "contact node",
        "recovery": "recovery points, force at the node (figure 6.3)",
        "patch": "patch",
    }
    values = {name: np.array([getattr(a, name) for a in answers]) for name in names}
    lines = [Line(words, seeds, 1e9 * (values[n] - own), "o-") for n, words in names.items()]
    lines.append(Line("the structure itself", seeds, 1e9 * own, "o-"))
    by_node = np.array([a.node_structure for a in answers])
    kept = [
        Line("by the patch", seeds, _differences(own, own[-1]), "o-", 3),
        Line("by the node", seeds, _differences(by_node, own[-1]), "o-", 0),
    ]
    return (
        Panel(
            "compliance beyond that of the structure", "contact seed [mm]", "compliance [nm/N]",
            lines, "xy",
        ),
        Panel(
            "the structure's own compliance, against the finest mesh", "contact seed [mm]",
            "difference [ppm]", kept, "xy",
        ),
    )  # fmt: skip
