"""Joint stiffnesses that meet the measured modes 2 and 3, which one tangential stiffness cannot.

You will see that every setting of one stiffness for both tangential directions that meets mode 1
lies on one curve of mode 3 over mode 2, and that the hammer test's point (269, 907) Hz lies off it.
Each curve of the picture is such a set of settings, each row of the table a fit of modes 1 to 3
with more left free, of the stiffnesses k in K(k) = K0 + sum k_j b_j b_j^T.

Thesis, section 5.2, table 5.3.

Run it: python examples/gallery/joints.py       meshes the rig's structure: minutes
"""

import sys
from pathlib import Path

import numpy as np

from beadwave import scene
from beadwave.fem.modes.mac import paired
from beadwave.fem.updating.tuning import spectrum, tune
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.scene import Joints, JointStiffnesses
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.structure.parameters import at_values, freed
from beadwave.workflows.structure.tuning import loosened, shape_mac
from beadwave.workflows.thesis import HAMMER_TEST_HZ
from observed import say

TARGETS = {i: HAMMER_TEST_HZ[i - 1] for i in (1, 2, 3)}  # [Hz] by mode
TANGENTIAL = np.geomspace(1e6, 1e10, 33)  # [N/m] stiffnesses along a curve
STIFF = np.inf  # [N m/rad] a turn of the head joints in the sheets' plane that is not free
LOOSE = 100.0  # [N m/rad] one that hardly resists
BLOCK = ("block.young", "block.density")
# of a fit: its name, what is free at the head joints, and their turn in the sheets' plane
FREEDOMS = (
    ("normal, one tangential", ("head.ky", "head.kt"), STIFF),
    ("the same, loose turn in plane", ("head.ky", "head.kt"), LOOSE),
    ("normal, along x, vertical", ("head.ky", "head.kx", "head.kz"), STIFF),
    ("normal, vertical, turn in plane", ("head.ky", "head.kz", "head.kry"), LOOSE),
    ("the same, block's modulus and density", ("head.ky", "head.kz", "head.kry", *BLOCK), LOOSE),
)
BEST = "normal, vertical, turn in plane"  # the fewest freedoms that meet modes 1 to 3


def main(freedoms=FREEDOMS, tangential=TANGENTIAL, changes=()):
    """Fitted modes (k, 4) [Hz], MAC of mode 2 with that of stiff joints (k,), and curves (n, 2) of
    modes 2 and 3 [Hz] that meet mode 1, by their turn."""
    rig, targets_hz = scene("rig-rom", changes), np.array(list(TARGETS.values()))
    rows, fits, macs, curves = [], {}, [], {}
    for name, free, turn in freedoms:
        # modes 1 to 3 fitted on a basis of shapes; the full model at these stiffnesses judges
        joints = Joints(head=JointStiffnesses(kry=turn))
        varied = rig.but(assembly={"constraint": "wires"}, joints=joints)
        parameters = freed(varied, free)
        loose = loosened(varied, parameters)
        basis = pipeline_of(loose, quiet)("tuning-basis")
        fits[name] = fit = tune(basis, parameters, TARGETS)
        miss = float(100 * np.abs(fit.modes_hz[:3] / targets_hz - 1).max())
        macs.append(shape_mac(pipeline_of(at_values(loose, parameters, fit.value), quiet))["2"])
        rows.append((name, *fit.modes_hz.tolist(), miss, macs[-1]))
        if "head.kt" not in free:
            continue

        # modes 2 and 3 over the tangential stiffness, the normal one fitted to mode 1
        normal, along, points = *parameters, []
        for k in tangential:
            fixed = along._replace(start=k, lower=0.999 * k, upper=1.001 * k)
            met = tune(basis, [normal, fixed], {1: TARGETS[1]}, n_starts=2)
            modes = spectrum(basis, parameters, met.value)
            index = paired(basis.forms, modes, basis.targets).index
            points.append(modes.frequency_hz[index[1:3]])
        curves[name, turn] = np.array(points)

    columns = (*(f"f{i} [Hz]" for i in range(1, 5)), "miss of 1-3 [%]", "MAC of 2")
    print(aligned_text(("free at the head joints", *columns), rows))
    for (_, turn), hz in curves.items():
        say(f"""
            With a {"rigid" if turn == STIFF else "compliant"} rotation in the plane of the sheets,
            meeting mode 2 at {TARGETS[2]:g} Hz puts mode 3 at {np.interp(TARGETS[2], *hz.T):.0f}
            Hz, and meeting mode 3 at {TARGETS[3]:g} Hz puts mode 2 at
            {np.interp(TARGETS[3], *hz.T[::-1]):.0f} Hz.
            """)
    say("""
        Both modes shear the head joints: mode 2 along x and, by its pitch, vertically, mode 3 along
        x alone. One stiffness that is low enough for mode 2 lowers mode 3 with it.
        """)
    if BEST in fits:
        # modes of other shapes between 2 and 3 are what the best fit pays
        best, (*_, miss, mac) = fits[BEST], rows[list(fits).index(BEST)]
        _, second, third, _ = best.modes_hz
        further = [f"{hz:.0f}" for hz in best.all_hz if second < hz < third]
        say(f"""
            A stiffness of its own for the vertical direction, with a compliant rotation, meets
            modes 1 to 3 within {miss:.1g} %: mode 2 becomes a pitch of the block about the sheets,
            and mode 3 keeps its stiffness along x. In return the shape of mode 2 has a MAC of only
            {mac:.2f} with that of stiff joints, and {len(further)} further modes appear between
            modes 2 and 3 ({", ".join(further)} Hz).
            """)

    lines = [Line(name, *hz.T, colour=i) for i, ((name, _), hz) in enumerate(curves.items())]
    last = list(fits.values())[-1].modes_hz
    lines += [
        Line("hammer test", np.array([TARGETS[2]]), np.array([TARGETS[3]]), "s", 7),
        Line("all freedoms", last[1:2], last[2:3], "x", 2),
    ]
    figure = [Panel("settings that meet mode 1", "mode 2 [Hz]", "mode 3 [Hz]", lines)]
    Path("joints.png").write_bytes(panels(figure, size=(7, 4.5)))
    return np.array([row[1:5] for row in rows]), np.array(macs), curves


if __name__ == "__main__":
    main(changes=sys.argv[1:])
