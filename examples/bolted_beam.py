"""A measured bolted beam: the modes of its ring-down, and damping that grows with the amplitude.

You will see the modes that `beadwave hammer` finds in the ring-down of a Brake-Reuss beam (two
steel beams, a lap joint of three bolts, free ends) after the stroke of a hammer, tones of the joint
named as such, and frequency and damping of the first mode over the amplitude at sensor 3, beside
those of sine tests in which that amplitude was held:

    m (omega_0^2 - omega^2 + 2 i zeta omega_0 omega) u = f,

fitted to force and displacement within 46 degrees of the resonance. Both sides are measured; in the
sine tests a shaker was attached.

The data are not part of beadwave: clone github.com/mattiacenedese/BRBtesting (GPL-3.0) and see
W. Chen et al., Mechanical Systems and Signal Processing 166 (2022) 108401.

Run it: python examples/bolted_beam.py BRBtesting
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import scipy.io

import beadwave

SENSOR = 3  # whose amplitude the sine tests held
NEAR = 0.8  # [rad] phase on either side of a resonance that is fitted


def main(folder: str) -> None:
    # the ring-down of three sensors as a file of records without a force
    record = scipy.io.loadmat(Path(folder, "HammerImpact.mat"), squeeze_me=True, spmatrix=False)[
        "HIdata"
    ]
    columns = np.column_stack([record[name].item() for name in ("time", "acc1", "acc2", "acc3")])
    with TemporaryDirectory() as work:
        file = Path(work, "beam.csv")
        head = ["time [s]", *(f"response {n}+y [m/s^2]" for n in (1, 2, 3))]
        np.savetxt(file, columns, delimiter=",", header=",".join(head), comments="")
        test = beadwave.hammer(file)

    print("      Hz      +-  damping       +-")
    for row in test.report.rows:
        print(
            f"{row.frequency_hz:8.2f} {row.frequency_deviation_hz:7.1g} "
            f"{100 * row.zeta:6.3f} % {100 * row.zeta_deviation:6.1g} %  {'; '.join(row.remarks)}"
        )

    # amplitudes of a mode are those of its largest component, which is 1
    first = test.report.rows[0]
    at_sensor = abs(test.modes.phi[SENSOR - 1, 0])
    ring_down = np.array(
        [
            (at_sensor * step.amplitude, step.frequency_hz, step.zeta)
            for step in reversed(first.over_amplitude)
        ]
    ).T
    print(f"\nfirst mode, amplitude at sensor {SENSOR}")
    print("m/s^2   ring-down Hz  damping   sine Hz  damping")
    for amplitude, hz, zeta in sine_tests(Path(folder, "ForcedFrequencyResponses.mat")):
        here = ""
        if ring_down[0, 0] <= amplitude <= ring_down[0, -1]:
            at = np.log(amplitude), np.log(ring_down[0])
            here = f"{np.interp(*at, ring_down[1]):.2f}  {100 * np.interp(*at, ring_down[2]):.3f} %"
        print(f"{amplitude:5.1f} {here:>22} {hz:9.2f}  {100 * zeta:.3f} %")


def sine_tests(file: Path) -> list[tuple[float, float, float]]:
    """Amplitude of the acceleration [m/s^2], frequency [Hz] and damping ratio of each test.

    f / (omega^2 u) = k / omega^2 - m + 2 i zeta omega_0 m / omega is linear in k and m.
    """
    tests = scipy.io.loadmat(file, squeeze_me=True, spmatrix=False)["FRdata"][
        "ResponseControl"
    ].item()
    rows = []
    for test in tests:
        names = ("frequency", "force", "amplitude", "phase")
        f, force, amplitude, phase = (np.asarray(test[name], dtype=float) for name in names)
        near = np.abs(phase + np.pi / 2) < NEAR
        omega = 2 * np.pi * f[near]
        # f / (omega^2 u): amplitudes are of the acceleration, phases of the displacement u
        ratio = (force / amplitude * np.exp(-1j * phase))[near]
        columns = np.column_stack([1 / omega**2, -np.ones_like(omega)])
        k, m = np.linalg.lstsq(columns, ratio.real, rcond=None)[0]
        omega_0 = np.sqrt(k / m)
        zeta = np.median(ratio.imag * omega) / (2 * m * omega_0)
        rows.append((float(amplitude[near].mean()), float(omega_0) / (2 * np.pi), float(zeta)))
    return sorted(rows)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("give the folder of the data: python examples/bolted_beam.py BRBtesting")
    main(sys.argv[1])
