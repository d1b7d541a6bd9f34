"""Cost of friction at the wall: processor seconds with it and without.

You will see, for a chain that strikes a half-space (`rig-half-space`, pressed by 60 N): seconds of
`beadwave impact` with `[friction]` and an arm over those without, where the wall rests, and where a
shaker moves it and the run first finds the periodic state, held against turns and free to turn; and
the same of the stages alone, without what Python takes to start and without compilation. Each pair
runs one after the other; the table has medians of their ratios.

Run it: python examples/friction_cost.py       5 pairs, half a minute
        python examples/friction_cost.py 20    more
"""

import os
import subprocess
import sys
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from joblib import Memory

from beadwave.workflows.files.scene import scene
from beadwave.workflows.scene import Scene
from beadwave.workflows.scene.toml import toml
from beadwave.workflows.stages.engine.pipeline import Pipeline

PRESSED = {"preload.force": 60.0, "time.duration": 1e-3}
HELD = {"stiffness": 2e6, "rotation": float("inf")}
SHAKER = {
    "name": "shaker", "on": "wall", "direction": "y", "frequency": 100.0, "displacement": 2e-5,
}  # fmt: skip
FRICTION = {
    "at rest": {"friction.coefficient": 0.2, "arm": HELD},
    "shaken": {"friction.coefficient": 0.2, "arm": HELD, "shakers": [SHAKER]},
    "shaken, free to turn": {
        "friction.coefficient": 0.2,
        "arm": HELD | {"rotation": 0.0},
        "shakers": [SHAKER],
    },
}


def main(n_pairs: int = 5) -> None:
    without = scene("rig-half-space", PRESSED)
    print(f"{'wall':22} {'command':>8} {'stages':>7}   seconds with friction over those without")
    for name, friction in FRICTION.items():
        pair = scene("rig-half-space", PRESSED | friction), without
        commands, stages = (
            np.median([measure(pair[0]) / measure(pair[1]) for _ in range(n_pairs)])
            for measure in (command, numbers)
        )
        print(f"{name:22} {commands:8.2f} {stages:7.2f}")


def command(scene: Scene) -> float:
    """[s] of the processor that `beadwave impact` takes, with nothing kept but compiled code."""
    with TemporaryDirectory() as folder:
        Path(folder, "scene.toml").write_text(toml(scene), encoding="utf-8")
        call = [sys.executable, "-m", "beadwave", "impact", "scene.toml", "--json"]
        environment = os.environ | {"BEADWAVE_CACHE_DIR": str(Path(folder, "cache"))}
        before = getrusage(RUSAGE_CHILDREN)
        subprocess.run(call, cwd=folder, env=environment, check=True, capture_output=True)
        after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def numbers(scene: Scene) -> float:
    """[s] of the processor for the march, its waves, numbers and files."""
    pipeline = Pipeline(scene, Memory(None, verbose=0))
    pipeline("compilation")
    started = process_time()
    pipeline("chain-numbers"), pipeline("chain-files")
    return process_time() - started


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
