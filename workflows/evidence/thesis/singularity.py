"""The contact node's compliance on ever finer meshes, and what it should have been.

A force at a single node sinks in like 1/h. Read beside it, the wall's displacement converges, but
then force and reading differ. A patch converges with one functional for both, and what it has
beyond the half-space under it is the structure's alone. Thesis, figures 6.2 and 6.3.
"""

from typing import NamedTuple

import numpy as np

from beadwave import fem
from beadwave.fem.trace import trace
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.parts import with_assembly
from beadwave.workflows.stages import assembly as stages
from beadwave.workflows.stages.progress import Progress

COLUMNS = (
    "seed_mm", "dofs", "node", "node_itself", "growth", "recovery_points", "patch",
    "structure_by_patch", "structure_by_node",
)  # fmt: skip


class SingularityOptions(NamedTuple):
    """What the study varies, and what it draws."""

    seeds: tuple[float, ...] = (4e-3, 2e-3, 1e-3, 0.5e-3)  # [m] element size at the contact
    profile: float = 8e-3  # [m] to either side of the contact that is drawn; not varied
    spot: float = 1e-7  # [m] radius of the patch that reads a point; not varied


def singularity(
    scene: Scene, progress: Progress, options: SingularityOptions = SingularityOptions()
) -> Finding:
    """Compliance of a contact node and of a patch against the mesh (thesis, figures 6.2, 6.3)."""
    with_assembly(scene)
    steel, radius = stages.solid(scene, "block"), scene.patch.radius
    y, z = scene.patch.point

    # compliances [m/N] of each mesh, and displacements (k,) [m/N] at y [m] from the contact under
    # a unit force at the node and over the patch
    n_dofs, compliances, profiles, face = [], [], [], stages.struck(scene)
    along = np.linspace(-options.profile, options.profile, 321)
    for seed in counted(options.seeds, progress, lambda seed: f"contact seed {1e3 * seed:g} mm"):
        fine = scene.but(mesh={"contact_seed": seed})
        model = stages.model(fine, stages.mesh(fine))

        # K u = w for a unit force at the node and for one over the patch
        node = fem.node_patch(model, face, [(y, z)])
        patch = fem.contact_patch(model, face, (y, z), radius)
        u = fem.factorised(model.K).solve(np.column_stack([node.w, patch.w]))
        of_node, of_patch = node.w @ u[:, 0], patch.w @ u[:, 1]
        half_space = [fem.half_space_on_mesh(model, face, w, steel) for w in (node, patch)]

        # the thesis' reading: the mean of two points a radius to either side, between nodes
        # or not
        sides = [(y - radius, z), (y + radius, z)]
        spots = [fem.contact_patch(model, face, side, options.spot) for side in sides]
        recovery = sum(spot.w for spot in spots) / 2

        # displacement into the wall along a line through the contact
        offsets = np.column_stack([np.zeros_like(along), along, np.zeros_like(along)])
        P = trace(model.structure, face, patch.spot.point + offsets)[0::3]
        profiles.append(((patch.spot.inward[0] * (P @ model.T)) @ u).T)
        n_dofs.append(model.M.shape[0])
        compliances.append(
            (of_node, recovery @ u[:, 0], of_patch, of_patch - half_space[1],
             of_node - half_space[0])
        )  # fmt: skip

    # what the structure has by itself, without the half-space under patch or node
    at_node, at_recovery, at_patch, by_patch, by_node = np.transpose(compliances)
    # what the node sinks in by itself: like 1/h it doubles where the element size halves
    sunk = at_node - by_patch
    growth = (sunk[1:] / sunk[:-1]).tolist()
    mm = [1e3 * seed for seed in options.seeds]
    numbers = (sunk.tolist(), [None, *growth], *np.transpose(compliances)[1:].tolist())
    rows = tuple(zip(mm, n_dofs, at_node.tolist(), *numbers, strict=True))

    # displacement of the face on each mesh, force at the node and force over the patch
    figure = []
    limits = (0.0, 1.05e9 * max(under_node.max() for under_node, _ in profiles))
    for title, under in (
        ("force at the node: depends on the mesh (figure 6.2)", 0),
        ("the same force over a patch: converged", 1),
    ):
        lines = [
            Line(f"{seed:g} mm at the contact", 1e3 * along, 1e9 * profile[under])
            for seed, profile in zip(mm, profiles, strict=True)
        ]
        x_label, y_label = "y from the contact [mm]", "displacement [nm/N]"
        figure.append(Panel(title, x_label, y_label, lines, y_limits=limits))

    # convergence of what each reading has beyond the structure
    seeds = np.array(mm)
    lines = [
        Line(words, seeds, 1e9 * (compliance - by_patch), "o-")
        for compliance, words in (
            (at_node, "contact node"),
            (at_recovery, "recovery points, force at the node (figure 6.3)"),
            (at_patch, "patch"),
        )
    ]
    lines.append(Line("the structure itself", seeds, 1e9 * by_patch, "o-"))
    title = "compliance beyond that of the structure"
    figure.append(Panel(title, "contact seed [mm]", "compliance [nm/N]", lines, "xy"))

    # the structure's own, against the finest mesh; nan for a zero that a logarithm cannot show
    lines = []
    for words, values, colour in (("by the patch", by_patch, 3), ("by the node", by_node, 0)):
        ppm = 1e6 * np.abs(values / by_patch[-1] - 1)
        lines.append(Line(words, seeds, np.where(ppm > 0, ppm, np.nan), "o-", colour))
    title = "the structure's own compliance, against the finest mesh"
    figure.append(Panel(title, "contact seed [mm]", "difference [ppm]", lines, "xy"))

    return concluded(
        __file__,
        COLUMNS,
        rows,
        panels(figure, columns=2, size=(5.2, 3.6)),
        radius=radius,
        sunk=sunk,
        growth=growth,
        local=at_recovery[-1] - by_patch[-1],
        recovery_change=abs(at_recovery[-1] / at_recovery[-2] - 1),
        patch_change=abs(at_patch[-1] / at_patch[-2] - 1),
        # a half-space at the distance of the recovery points, u = (1 - nu^2) F / (pi E r)
        dent=(1 - steel.poisson**2) / (np.pi * steel.young * radius),
        patch_spread=float(np.ptp(by_patch) / np.mean(by_patch)),
        node_spread=float(np.ptp(by_node) / np.mean(by_node)),
    )
