"""Are the modes of a hammer test found, and do their deviations hold the truth?

You will see, for synthetic tests drawn by a seed (roving hammer at 8 points, 5 hits each, 8 modes
of which two are 1 % apart; double hits, overloads, sensors that read across): modes found
(frequency within 0.1 %, damping within 10 %, MAC 0.95), modes that are none, and how often two
deviations hold frequency and damping. Of three kinds: "hits" with three references, "short" records
of a second in which light modes have not decayed, and "ring-downs", the same motion behind the
pulse at eight sensors, five records, without the force.

    |estimate - truth| / deviation < 2   of 95 % where deviations are right

Run it: python examples/hammer_modes.py [tests] [noise] [first seed] [kind]     a second a test
"""

import sys

import numpy as np

from beadwave.fem.identification.hits import frequency_responses
from beadwave.fem.identification.poly_reference import identified_modes
from beadwave.fem.identification.synthetic_hits import HammerDefects, synthetic_hits
from beadwave.fem.modes.mac import mac

PULSE_OVER = 0.030  # s, of every record, the ringing of its filter included


def main(
    tests: int = 4, noise: float = 0.02, first: int = 0, kind: str = "hits"
) -> tuple[int, int, int]:
    """Print the counts; modes, those found, and those that are none."""
    total, matched, false, ratios = 0, 0, 0, []
    for seed in range(first, first + tests):
        # responses of a test, and the true shapes at their points
        defects = HammerDefects(noise=noise)
        if kind == "ring-downs":
            quiet = defects._replace(double=0.0, overload=0.0)
            test = synthetic_hits(seed, quiet, points=8, references=8, repeats=1)
            behind = round(PULSE_OVER / test.hits.dt)
            responses = frequency_responses(
                test.hits._replace(force=None, response=test.hits.response[:5, :, behind:])
            )
            truth = test.phi_at_sensors
        else:
            duration = 1.0 if kind == "short" else 2.0
            test = synthetic_hits(seed, defects, points=8, duration=duration)
            responses = frequency_responses(test.hits)
            truth = test.phi[[test.hits.points.index(p) for p in responses.points]]

        # a mode is found by shape and frequency, and good if its damping is as well
        modes = identified_modes(responses, test.band_hz)
        likeness = mac(modes.phi, truth)
        off_hz = modes.frequency_hz[:, None] - test.frequency_hz
        off_zeta = modes.zeta[:, None] - test.zeta
        same = (np.abs(off_hz) < 1e-3 * test.frequency_hz) & (likeness > 0.95)
        good = same & (np.abs(off_zeta) < 0.1 * test.zeta)
        ratios += [
            np.abs((off / deviation[:, None])[same])
            for off, deviation in (
                (off_hz, modes.frequency_deviation),
                (off_zeta, modes.zeta_deviation),
            )
        ]
        total += len(test.zeta)
        matched += np.count_nonzero(good.any(axis=0))
        false += np.count_nonzero(~same.any(axis=1))
        left_out = sum("is left out" in remark for remark in responses.remarks)
        print(
            f"seed {seed}: {left_out} hits left out of {len(test.spoiled)} "
            f"({test.spoiled.sum()} spoiled); {np.count_nonzero(good.any(axis=0))} of "
            f"{len(test.zeta)} modes, {np.count_nonzero(~same.any(axis=1))} false"
        )
    inside = np.mean(np.concatenate(ratios) < 2)
    print(f"{matched} of {total} modes, {false} false, {100 * inside:.0f} % within two deviations")
    return total, matched, false


if __name__ == "__main__":
    kinds = (int, float, int, str)
    main(*(kind(text) for kind, text in zip(kinds, sys.argv[1:], strict=False)))
