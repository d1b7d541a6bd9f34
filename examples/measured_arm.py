"""A cantilever whose outer part is known by its receptances alone.

You will see the bending modes of a bar of 0.4 m, held at one end and meshed, that carries an arm of
0.3 m known by computed receptances with noise at two points of its end (SYNTHETIC, not measured),
beside those of a solid bar of 0.7 m and of a Timoshenko beam.

    held |=============|o- - - - - - -      H(omega) at the two points, x and z
         0            0.4            0.7 m

The files stay in the folder: measured_arm.uff and measured_arm.toml, which `beadwave modes`, `run`
and `look` take.

Run it: python examples/measured_arm.py [folder] [noise]     half a minute
"""

import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix, vstack

from beadwave import fem
from beadwave.fem.assembly.springs import SpringEnd, along_disc
from beadwave.fem.identification.hits import FrequencyResponses
from beadwave.fem.modes.solver.full_responses import full_responses
from beadwave.workflows.files.hammer import write_responses
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import InvalidScene
from beadwave.workflows.stages.engine.pipeline import pipeline_of

WIDE, TALL = 0.02, 0.04  # [m] of the bar
RADIUS, OFF = 6e-3, 0.013  # [m] of a disc, and of its middle off the axis
BAR = """name = "{name}"
[assembly]
held = {held}
material = "steel"
[bodies.bar]
box = [{length}, 0.02, 0.04]
at = [{middle}, 0.0, 0.0]
[strike]
on = "{struck}"
radius = 3e-3
[reduction]
kind = "{kind}"
modes = 24
[damping]
kind = "modal"
ratio = 0.002   # assumed
[mesh]
scale = 1.5
"""
ARM = """[[measured]]
name = "arm"
receptance = "measured_arm.uff"   # SYNTHETIC: computed, not measured
on = "bar:+x"
radius = 6e-3
"""


def bar(name: str, start: float, end: float, *, held: bool) -> str:
    """A scene of a bar along x."""
    return BAR.format(
        name=name, held='["bar:-x"]' if held else "[]", length=end - start,
        middle=(start + end) / 2, struck="bar:+z" if held else "bar:-x",
        kind="craig-bampton" if held else "free-modes",
    )  # fmt: skip


def written(folder: Path, noise: float = 0.002, seed: int = 0) -> Path:
    """The scene of bar and arm, with the arm's receptances beside it."""
    # the arm alone, free: two points on its end, each read and pushed along x and z
    tables = folder / "arm_alone.toml"
    tables.write_text(bar("arm-alone", 0.4, 0.7, held=False))
    model = pipeline_of(scene(tables), lambda _: nullcontext())("model")
    face = "bar:strike"
    middle = fem.planar_spot(model.structure, face, (0.0, 0.0))
    rows, names, nodes = [], [], {}
    for node, z in ((1, -OFF), (2, OFF)):
        at = tuple((middle.axes @ np.array([0.0, 0.0, z])).tolist())
        spot = fem.planar_spot(model.structure, face, at)
        nodes[node] = spot.point
        for axis, letter in ((0, "x"), (2, "z")):
            end, d = SpringEnd(face, at, RADIUS), np.eye(3)[axis]
            rows.append(along_disc(model.structure, end, spot, spot.point, d))
            names.append(f"{node}+{letter}")

    # accelerances to 6 kHz, damping ratio 0.3 %
    hz = np.arange(8.0, 6000.0, 8.0)
    modes = fem.modes(model.K, model.M, 40)
    reading = csr_matrix(vstack(rows) @ model.T)
    s = 2j * np.pi * hz
    H = full_responses(model, modes, 0.006 * modes.omega, reading, reading, s, power=2).H

    # noise of both quadratures, relative to each response
    rng = np.random.default_rng(seed)
    H = H * (1 + noise / np.sqrt(2) * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape)))
    title = "SYNTHETIC: computed, not measured"
    responses = FrequencyResponses(hz, H, tuple(names), tuple(names))
    write_responses(folder / "measured_arm.uff", responses, nodes, title)
    joined = folder / "measured_arm.toml"
    joined.write_text(bar("measured-arm", 0.0, 0.4, held=True) + ARM)
    return joined


def bending_hz(tables: Path, n: int = 4) -> np.ndarray:
    """Frequencies (n,) [Hz] of the lowest modes that move along z."""
    pipeline = pipeline_of(scene(tables), lambda _: nullcontext())
    modes = pipeline("modes")
    return modes.omega[modes.effective_mass[:, 2] > 1e-3][:n] / (2 * np.pi)


def timoshenko_hz(length: float = 0.7, n: int = 4, elements: int = 200) -> np.ndarray:
    """Frequencies (n,) [Hz] of a beam of the bar's section and steel that is clamped at one end, by
    elements with the shear parameter phi = 12 E I / (kappa G A h^2) and lumped masses."""
    E, rho, A, second = 210e9, 7850.0, WIDE * TALL, WIDE * TALL**3 / 12
    h, shear = length / elements, 5 / 6 * E / (2 * 1.3) * A
    phi = 12 * E * second / (shear * h**2)
    near, far = (4 + phi) * h**2, (2 - phi) * h**2
    k = np.array(
        [
            [12, 6 * h, -12, 6 * h], [6 * h, near, -6 * h, far],
            [-12, -6 * h, 12, -6 * h], [6 * h, far, -6 * h, near],
        ]
    )  # fmt: skip
    k = k * E * second / (h**3 * (1 + phi))
    K, M = np.zeros((2, 2 * elements + 2, 2 * elements + 2))
    for i in range(elements):
        K[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += k
        for node in (i, i + 1):
            M[2 * node, 2 * node] += rho * A * h / 2
            M[2 * node + 1, 2 * node + 1] += rho * second * h / 2
    root = np.sqrt(np.diag(M)[2:])
    values = np.linalg.eigvalsh(K[2:, 2:] / np.outer(root, root))
    return np.sqrt(values[:n]) / (2 * np.pi)


def main(folder: str = ".", noise: float = 0.002) -> dict[str, np.ndarray]:
    """Print the modes of the three."""
    where = Path(folder)
    joined = written(where, noise)
    (where / "whole.toml").write_text(bar("whole", 0.0, 0.7, held=True))
    rows = {
        "bar and arm": bending_hz(joined), "solid bar": bending_hz(where / "whole.toml"),
        "Timoshenko": timoshenko_hz(),
    }  # fmt: skip
    print("SYNTHETIC: computed, not measured")
    for name, hz in rows.items():
        print(f"{name:12s}" + "".join(f"{f:10.2f} Hz" for f in hz))
    return rows


if __name__ == "__main__":
    try:
        main(*sys.argv[1:2], *map(float, sys.argv[2:3]))
    except InvalidScene as missing:  # pyuff, for the universal file
        print(missing, file=sys.stderr)
        sys.exit(2)
