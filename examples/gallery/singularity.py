"""The contact node's compliance on ever finer meshes, and what it should have been.

You will see that a force at a single node sinks in like 1/h. Read beside it, the wall's
displacement converges, but then force and reading differ. A patch converges with one functional w
for both, u_w = w^T u under the force w F, and what it has beyond the half-space under it is the
structure's alone.

Thesis, figures 6.2 and 6.3.

Run it: python examples/gallery/singularity.py       four meshes of the rig's structure: minutes
"""

import sys
from pathlib import Path

import numpy as np

from beadwave import fem, scene
from beadwave.fem.assembly.trace import trace
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.structure import assembly
from observed import say

SEEDS = (4e-3, 2e-3, 1e-3, 0.5e-3)  # [m] element size at the contact
PROFILE = 8e-3  # [m] to either side of the contact that is drawn
SPOT = 1e-7  # [m] radius of the patch that reads a point


def main(seeds=SEEDS, changes=()):
    """Compliances [m/N] on each mesh: of the node without the structure's, of the recovery points,
    of the structure by the patch and by the node."""
    rig = scene("rig-rom", changes)
    steel, radius, (y, z) = assembly.solid(rig, "block"), rig.strike.radius, rig.strike.at
    face = assembly.struck(rig)

    # compliances on each mesh, and displacements (k,) [m/N] at y [m] from the contact under a unit
    # force at the node and over the patch
    n_dofs, compliances, profiles = [], [], []
    along = np.linspace(-PROFILE, PROFILE, 321)
    for seed in seeds:
        fine = rig.but(mesh={"contact_seed": seed})
        model = assembly.model(fine, assembly.mesh(fine))

        # K u = w for a unit force at the node and for one over the patch
        node = fem.node_patch(model, face, [(y, z)])
        patch = fem.contact_patch(model, face, (y, z), radius)
        u = fem.factorised(model.K).solve(np.column_stack([node.w, patch.w]))
        of_node, of_patch = node.w @ u[:, 0], patch.w @ u[:, 1]
        half_space = [fem.half_space_on_mesh(model, face, w, steel) for w in (node, patch)]

        # the thesis' reading: the mean of two points a radius to either side, between nodes or not
        sides = [(y - radius, z), (y + radius, z)]
        recovery = sum(fem.contact_patch(model, face, side, SPOT).w for side in sides) / 2

        # displacement into the wall along a line through the contact
        offsets = np.column_stack([np.zeros_like(along), along, np.zeros_like(along)])
        P = trace(model.structure, face, patch.spot.point + offsets)[0::3]
        profiles.append(((patch.spot.inward[0] * (P @ model.T)) @ u).T)
        n_dofs.append(model.M.shape[0])
        compliances.append(
            (of_node, recovery @ u[:, 0], of_patch, of_patch - half_space[1],
             of_node - half_space[0])
        )  # fmt: skip

    # what the node sinks in by itself: like 1/h it doubles where the element size halves
    at_node, at_recovery, at_patch, by_patch, by_node = np.transpose(compliances)
    sunk = at_node - by_patch
    growth = sunk[1:] / sunk[:-1]

    columns = (
        "seed_mm", "dofs", "node", "node_itself", "growth", "recovery_points", "patch",
        "structure_by_patch", "structure_by_node",
    )  # fmt: skip
    mm = 1e3 * np.array(seeds)
    numbers = (sunk, [np.nan, *growth], at_recovery, at_patch, by_patch, by_node)
    of_mesh = zip(mm.tolist(), n_dofs, at_node.tolist(), *map(list, numbers), strict=True)
    print(aligned_text(columns, of_mesh))
    # a half-space at the distance of the recovery points, u = (1 - nu^2) F / (pi E r)
    dent = (1 - steel.poisson**2) / (np.pi * steel.young * radius)
    ppm = [1e6 * np.ptp(values) / np.mean(values) for values in (by_patch, by_node)]
    say(f"""
        Compliances are in m/N; the recovery points lie {1e3 * radius:g} mm beside the contact,
        which is also the radius of the patch.

        The local compliance of the contact node, without that of the structure as a whole, is
        {1e9 * sunk[0]:.3g} nm/N on the coarsest mesh and {1e9 * sunk[-1]:.3g} nm/N on the finest.
        Each halving of the element size multiplies it by {", ".join(f"{x:.2f}" for x in growth)}:
        it grows like 1/h, as in the thesis.

        The compliance at the two recovery points changes by
        {100 * abs(at_recovery[-1] / at_recovery[-2] - 1):.2g} % from the last mesh but one to the
        finest, that of the patch by {100 * abs(at_patch[-1] / at_patch[-2] - 1):.2g} %. The
        displacement at the recovery points still contains
        {1e9 * (at_recovery[-1] - by_patch[-1]):.2g} nm/N of local deformation (a half-space has
        {1e9 * dent:.2g} nm/N at that distance from the force). The thesis counts it twice, because
        Hertz' law contains it already.

        The compliance of the structure, which is what the patch has beyond the half-space under
        it, is equal on all meshes within {ppm[0]:.2g} ppm; determined from the node and its own
        half-space, within {ppm[1]:.2g} ppm.
        """)

    # displacement of the face on each mesh; what each reading has beyond the structure; the
    # structure's own against the finest mesh, nan for a zero that a logarithm cannot show
    figure, limits = [], (0.0, 1.05e9 * max(under_node.max() for under_node, _ in profiles))
    for under, title in enumerate((
        "force at the node: depends on the mesh (figure 6.2)",
        "the same force over a patch: converged",
    )):  # fmt: skip
        lines = [
            Line(f"{seed:g} mm at the contact", 1e3 * along, 1e9 * profile[under])
            for seed, profile in zip(mm, profiles, strict=True)
        ]
        x_label, y_label = "y from the contact [mm]", "displacement [nm/N]"
        figure.append(Panel(title, x_label, y_label, lines, y_limits=limits))
    readings = {
        "contact node": sunk,
        "recovery points, force at the node (figure 6.3)": at_recovery - by_patch,
        "patch": at_patch - by_patch,
        "the structure itself": by_patch,
    }
    lines = [Line(name, mm, 1e9 * values, "o-") for name, values in readings.items()]
    title = "compliance beyond that of the structure"
    figure.append(Panel(title, "contact seed [mm]", "compliance [nm/N]", lines, "xy"))
    lines = []
    for name, values, colour in (("by the patch", by_patch, 3), ("by the node", by_node, 0)):
        off = 1e6 * np.abs(values / by_patch[-1] - 1)
        lines.append(Line(name, mm, np.where(off > 0, off, np.nan), "o-", colour))
    title = "the structure's own compliance, against the finest mesh"
    figure.append(Panel(title, "contact seed [mm]", "difference [ppm]", lines, "xy"))
    Path("singularity.png").write_bytes(panels(figure, columns=2, size=(5.2, 3.6)))
    return sunk, at_recovery, by_patch, by_node


if __name__ == "__main__":
    main(changes=sys.argv[1:])
