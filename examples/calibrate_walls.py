"""Do the bars of `calibrate` hold the truth where the records come from a better wall?

You will see, for chains before beams (drawn by a seed) whose velocities are made with a wall that
is known better than the one of the fit, by another theory or by finer elements, reduced with more
modes: how far contacts and striker are found from the truth, over the bars of the noise alone and
over those of `calibrate`.

    off = |found - true| / bar,   bar = two sigma

Run it: python examples/calibrate_walls.py [beams] [solid | usual | finer] [seed]     5 s a beam
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import beadwave
from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages.chain.chain import Start
from beadwave.workflows.stages.chain.impact import impact
from beadwave.workflows.stages.chain.sensor_signals import csv_text, record
from beadwave.workflows.stages.chain.walls import wall_of
from beadwave.workflows.stages.chain.waves import waves
from beadwave.workflows.stages.engine.pipeline import pipeline_of
from beadwave.workflows.stages.engine.progress import quiet
from beadwave.workflows.stages.structure import bending

NOISE = 0.003  # of the largest velocity
WALLS = ("solid", "usual", "finer")
SCENE = {
    "name": "walls",
    "chain": {"count": 6, "radius": 0.006, "density": 7800.0, "young": 210e9, "poisson": 0.3},
    "striker": {"velocity": 0.3},
    "wall": {"kind": "rom"},
    "damping": {"kind": "modal", "ratio": 0.003},
    "time": {"duration": 0.8e-3},
    "reduction": {"error": 1e-3},
    "output": {
        "spheres": [2, 4],
        "samples": 801,
        "instrument": {"sampling": 1e6},
        "sensors": [{"sphere": n, "quantity": "velocity", "noise": NOISE} for n in (2, 4, 6)],
    },
}


def main(beams: int = 20, wall: str = "usual", seed: int = 1) -> None:
    rng = np.random.default_rng(seed)
    by_noise, by_all = [], []
    print(f"{'thickness, width, length':28} {'ends':16} most off by noise, by all  largest part")
    for i in range(beams):
        start, true, truth = random_beam(rng, i)
        report = calibrated(start, true, wall)
        rows = [row for row in report.parameters if row.name in truth and row.two_sigma]
        off = np.array([abs(row.found - truth[row.name]) for row in rows])
        bars = np.array([row.two_sigma for row in rows])
        noise = bars * np.sqrt([row.bar_by["noise"] for row in rows])
        by_noise.extend(off / noise)
        by_all.extend(off / bars)
        shares = {c: np.mean([row.bar_by[c] for row in rows]) for c in rows[0].bar_by}
        largest = max(shares, key=shares.get)
        beam = start.beam
        mm = f"{1e3 * beam.thickness:.2f} x {1e3 * beam.width:.1f} x {1e3 * beam.length:.0f} mm"
        print(
            f"{mm:28} {beam.left:8}{beam.right:8} {max(off / noise):17.2f} {max(off / bars):7.2f}  "
            f"{largest} {shares[largest]:.0%}",
            flush=True,
        )
    print_bars(by_noise, by_all, f"{len(by_all)} parameters")


def print_bars(by_noise, by_all, numbers: str) -> None:
    """Print the share of numbers within their bars, by the noise alone and by all that is known."""
    for name, ratios in (("noise alone", by_noise), ("all that is known", by_all)):
        off = np.array(ratios)
        print(
            f"bars of {name}: {np.mean(off <= 1):.0%} of {numbers} within one bar, "
            f"{np.mean(off <= 2):.0%} within two; rms {np.sqrt(np.mean(off**2)):.2f}, "
            f"most {off.max():.2f} bars"
        )


def random_beam(rng: np.random.Generator, seed: int) -> tuple[Scene, Scene, dict[str, float]]:
    """The scene that a calibration starts from, the true one, and the true parameters."""
    start = with_beam(rng, SCENE, seed, rng.uniform(0.006, 0.015), slenderest=10)
    factors = [float(x) for x in rng.uniform(0.9, 1.1, SCENE["chain"]["count"])]
    velocity = 0.3 * rng.uniform(0.95, 1.05)
    changes = {"contact.stiffness_factor": factors, "striker.velocity": velocity}
    truth = {f"contact {i}": factor for i, factor in enumerate(factors, 1)} | {"striker": velocity}
    return scene(start), scene(start, changes), truth


def with_beam(
    rng: np.random.Generator, tables: dict, seed: int, h: float, slenderest: float
) -> dict:
    """The tables of a scene with a beam of thickness h [m], at least so many times as long, and
    with the seed of its noise."""
    beam = {
        "thickness": h,
        "width": h * rng.uniform(0.7, 2.2),
        "length": h * rng.uniform(slenderest, 24),
        "young": 70e9,
        "poisson": 0.33,
        "density": 2700.0,
        "left": str(rng.choice(["hinged", "clamped"])),
        "right": str(rng.choice(["hinged", "clamped"])),
    }
    beam["position"] = beam["length"] * rng.uniform(0.4, 0.6)
    instrument = tables["output"]["instrument"] | {"seed": seed}
    return tables | {"output": tables["output"] | {"instrument": instrument}, "beam": beam}


def calibrated(start: Scene, true: Scene, wall: str):
    """The report of a calibration on velocities that the true chain has before a better wall."""
    of = pipeline_of(true, quiet)
    if wall == "finer":
        model = bending.model(true.but(reduction={"error": 1e-5}), 0.5)
        better = bending.reduction(true.but(reduction={"error": 1e-5}), model)
    else:
        better = bending.other_theories(true)[WALLS.index(wall)].reduced
    with TemporaryDirectory() as folder:
        file = write_record(Path(folder), true, of("start"), better)
        return beadwave.calibrate(start, file, free="contacts,striker,trigger", starts=2).report


def write_record(folder: Path, true: Scene, start: Start, reduced) -> Path:
    """A file with what the sensors of the true scene record before a reduced wall."""
    run = impact(true, start, wall_of(true, reduced))
    file = folder / "record.csv"
    file.write_text(csv_text(true, record(true, run, waves(true, start, run))))
    return file


if __name__ == "__main__":
    main(*(argument if argument in WALLS else int(argument) for argument in sys.argv[1:]))
