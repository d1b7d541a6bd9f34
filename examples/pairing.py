"""Are measured modes paired with the right computed ones, whatever the points of the test?

You will see, for each built-in assembly, over tests drawn by a seed, with 3
to 30 points and directions anywhere outside: pairs made, those named doubtful, those whose points
cannot tell the mode from another one, of the rest the share that is right, and the largest
distance in frequency of a pair that nothing is said of. A test has the first modes of the model in
an order of its own, two fifths of them left out, their frequencies off by 8 %, and noise of 5 % of
the largest displacement; every other test has frequencies off by 30 %.

Run it: python examples/pairing.py [tests] [first seed]     50 tests of each, half a minute
"""

import sys
from contextlib import nullcontext

import numpy as np

from beadwave.fem.identification.sensor_placement import outside
from beadwave.fem.modes.mac import MeasuredPairs, mac, measured_pairs
from beadwave.workflows.files.scene import scene
from beadwave.workflows.stages.engine.pipeline import pipeline_of

ASSEMBLIES = ("rig-rom", "rig-full-tie", "cantilever", "plate-on-bolts", "rig-rom-269")
HIGHEST = 16  # modes of a test are among so many
NOISE = 0.05
OFF = (0.08, 0.3)  # standard deviations of ln frequency


def modes_outside(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Shapes (c, k) at points and directions all over the outside, and frequencies (k,) [Hz]."""
    run = pipeline_of(scene(name), lambda stage: nullcontext())
    model, modes = run("model"), run("modes")
    places = outside(model)
    return (model.T @ modes.phi)[places.reading], modes.omega / (2 * np.pi)


def paired(
    phi: np.ndarray, hz: np.ndarray, seed: int
) -> tuple[MeasuredPairs, np.ndarray, np.ndarray]:
    """The pairs of a test, its true modes and its frequencies."""
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(phi), min(rng.integers(3, 31), len(phi)), replace=False)
    few = min(HIGHEST, len(hz))
    true = rng.permutation(few)[: max(2, round(0.6 * few))]
    measured = phi[np.ix_(rows, true)]
    size = np.abs(measured).max(axis=0)
    measured = measured + NOISE * size * rng.standard_normal(measured.shape)
    measured_hz = hz[true] * np.exp(OFF[seed % 2] * rng.standard_normal(len(true)))
    computed = phi[rows]
    pairs = measured_pairs(measured_hz, hz, mac(measured, computed), mac(computed, computed))
    return pairs, true, measured_hz


def main(tests: int = 50, first: int = 0) -> dict[str, tuple[int, int, int, float, float]]:
    """Print the table; for each assembly pairs, doubtful ones, ambiguous ones, the share of the
    rest that is right, and the largest relative distance in frequency that nothing is said of."""
    print("assembly          pairs  doubtful  alike there  others right  farthest of the others")
    table = {}
    for name in ASSEMBLIES:
        phi, hz = modes_outside(name)
        number = doubtful = alike = right = others = 0
        farthest = 0.0
        for seed in range(first, first + tests):
            pairs, true, measured_hz = paired(phi, hz, seed)
            # doubtful pairs, then those that these points cannot tell apart; the others must be
            # right
            partners = pairs.index[pairs.index >= 0]
            assert len(set(partners)) == len(partners), "a computed mode in two pairs"
            for i, j in enumerate(pairs.index):
                if j < 0:
                    continue
                number += 1
                sentences = " ".join(pairs.doubts[i])
                if "doubtful" in sentences:
                    doubtful += 1
                    continue
                farthest = max(farthest, abs(hz[j] / measured_hz[i] - 1))
                if "cannot tell" in sentences:
                    alike += 1
                    continue
                others += 1
                right += j == true[i]
        share = right / max(others, 1)
        table[name] = number, doubtful, alike, share, farthest
        print(
            f"{name:16} {number:6} {doubtful:9} {alike:12} {100 * share:11.1f} % "
            f"{100 * farthest:14.1f} %"
        )
    return table


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
