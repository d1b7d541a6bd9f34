"""Do the bars of `inspect` hold the truth where the records come from another theory of bending?

You will see, for beams drawn by a seed whose records are made with the theory as solids correct it,
or with the usual one: how far thickness and modulus are found from the truth, over their bars, with
the bars of the noise alone and with those of `inspect`.

    off = |found - true| / bar,   bar = two sigma

Run it: python examples/inspect_theories.py [beams] [solid | usual] [seed]      ten seconds a beam
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import beadwave
import calibrate_walls  # the same experiment, with velocities that `calibrate` takes
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.structure import bending

NOISE = 0.003  # of the largest force
FIND = ("beam.thickness", "beam.young")
THEORIES = ("solid", "usual")  # in the order of bending.other_theories
SCENE = calibrate_walls.SCENE | {
    "name": "theories",
    "time": {"duration": 1.2e-3},
    "output": {
        "spheres": [4],
        "samples": 1201,
        "instrument": {"sampling": 1e6},
        "sensors": [{"sphere": 4, "quantity": "force", "noise": NOISE}],
    },
}


def main(beams: int = 40, theory: str = "usual", seed: int = 1) -> None:
    rng = np.random.default_rng(seed)
    print(f"{'thickness, width, length':28} {'ends':16} off by noise    off by all  explained")
    by_noise, by_all = [], []
    for i in range(beams):
        start, true = random_beam(rng, i)
        report = inspected(start, true, theory)
        rows = report.numbers
        off = np.array([abs(row.found - number(true, row.name)) for row in rows])
        bars = np.array([row.two_sigma for row in rows])
        noise = bars * np.sqrt([row.bar_by.get("noise", 1.0) for row in rows])
        by_noise.append(off / noise)
        by_all.append(off / bars)
        beam = true.beam
        mm = f"{1e3 * beam.thickness:.2f} x {1e3 * beam.width:.1f} x {1e3 * beam.length:.0f} mm"
        ratios = " ".join(f"{r:6.2f}" for r in (*by_noise[-1], *by_all[-1]))
        print(f"{mm:28} {beam.left:8}{beam.right:8} {ratios}  {report.explained}", flush=True)
    calibrate_walls.print_bars(by_noise, by_all, "the numbers")


def random_beam(rng: np.random.Generator, seed: int) -> tuple[Scene, Scene]:
    """The scene that an inspection starts from, and the true one."""
    h = rng.uniform(0.008, 0.015)
    tables = calibrate_walls.with_beam(rng, SCENE, seed, h, slenderest=14)
    truth = {
        "beam.thickness": h * rng.uniform(0.95, 1.05),
        "beam.young": 70e9 * rng.uniform(0.95, 1.05),
    }
    return scene(tables), scene(tables, truth)


def inspected(start: Scene, true: Scene, theory: str):
    """The report of an inspection of a record that the true beam makes by another theory."""
    of = pipeline_of(true, quiet)
    other = bending.other_theories(true)[THEORIES.index(theory)]
    with TemporaryDirectory() as folder:
        file = calibrate_walls.write_record(Path(folder), true, of("start"), other.reduced)
        bounds = ",".join(
            f"{key}={0.85 * number(start, key)}:{1.15 * number(start, key)}" for key in FIND
        )
        return beadwave.inspect(start, [file], find=",".join(FIND), bounds=bounds, starts=4).report


def number(of: Scene, key: str) -> float:
    """The value of a key of the beam."""
    return getattr(of.beam, key.removeprefix("beam."))


if __name__ == "__main__":
    main(*(argument if argument in THEORIES else int(argument) for argument in sys.argv[1:]))
