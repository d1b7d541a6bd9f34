"""Do the bars of `calibrate` hold the truth, and does it call only contacts identifiable that are?

You will see, for chains whose contacts are known (drawn by a seed, see twin.py)
and two levels of noise, how many of all contacts lie within their bar of two deviations,

    share = number of |found - true| <= bar over all contacts,   wanted: 0.95,

the two deviations of that share by chance, 2 sqrt(0.95 0.05 / n), and the same of the contacts that
are called identifiable. Contacts of one chain are found together, so that n counts chains.

Chains: bare spheres, the same on leaf springs and pressed, and one of steel and aluminium.

Run it: python examples/calibrate_twins.py             20 seeds of each, 2 hours
        python examples/calibrate_twins.py 3 5         3 seeds from seed 5 on
        python examples/calibrate_twins.py 3 0 bare    of one chain
"""

import sys
import time
from contextlib import redirect_stdout
from math import sqrt
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import twin

BARE = {"leaf_springs.stiffness": 0.0, "preload.force": 0.0}
CHAINS = {
    "bare": BARE,
    "leaf springs": {"leaf_springs.stiffness": 2e4, "preload.force": 5.0},
    "two materials": BARE
    | {
        "chain.count": 12,
        "chain.density": [7800.0, 2700.0] * 6,
        "chain.young": [210e9, 70e9] * 6,
        "chain.poisson": [0.3, 0.33] * 6,
        "output.spheres": [1, 4, 9],
    },
}
NOISES = (1e-3, 4e-3)  # m/s rms of a record, ten of which are averaged


def main(n_seeds: int = 20, first: int = 0, only: str = "") -> None:
    head = f"{'all contacts':>20}  {'identifiable':>20}  seconds"
    print(f"{'chain':14} {'noise':>6} {'twins':>5}  {head}")
    for name, changes in CHAINS.items():
        if only in ("", name):
            for noise in NOISES:
                row(name, changes, noise, range(first, first + n_seeds))


def row(name: str, changes: dict, noise: float, seeds: range) -> None:
    """A line of the table."""
    began, within, called, chains = time.perf_counter(), [], [], []
    for seed in seeds:
        with redirect_stdout(None), TemporaryDirectory() as folder:
            file = Path(folder, "twin.csv")
            fitted, true = twin.main(0, changes, twin.Twin(noise=noise, seed=seed), file)
        contacts = [p for p in fitted.report.parameters if p.name.startswith("contact")]
        # without a bar the data say nothing of a contact
        within += [abs(p.found - true[p.name]) <= (p.two_sigma or np.inf) for p in contacts]
        called += [p.identifiable == "yes" for p in contacts]
        chains += [seed] * len(contacts)
    within, called, chains = map(np.array, (within, called, chains))
    cells = []
    for part in (np.ones(within.shape, bool), called):
        n, chance = part.sum(), 2.0 * sqrt(0.95 * 0.05 / max(len(set(chains[part])), 1))
        share = within[part].mean() if n else np.nan
        cells.append(f"{within[part].sum():4d}/{n:<4d}{share:5.2f} ±{chance:.2f}")
    seconds = time.perf_counter() - began
    print(f"{name:14} {noise:6.0e} {len(seeds):5d}  {cells[0]:>20}  {cells[1]:>20}  {seconds:7.0f}",
          flush=True)  # fmt: skip


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
