"""A beam that is pulled and pressed: the first reflected wave, and those that come later.

You will see what an axial force up to 0.9 of buckling does to the waves that a beam sends back. The
force changes what is slow, the lowest modes (omega^2 ~ 1 - N / N_cr of a hinged beam); a contact
lasts a tenth of a millisecond. Velocities are compared with those of the beam without a force,
until the first reflected wave has passed the observed spheres, and after.

Run it: python examples/gallery/axial_force.py                    the scene slender-beam
        python examples/gallery/axial_force.py beam.width=0.01    with changes
"""

import sys
from pathlib import Path

import numpy as np

from beadwave import scene
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.structure import bending
from observed import bending_run, bending_wall, first_and_later, first_mode, say

SHARES = (0.9, 0.5, 0.0, -0.3, -0.6, -0.8, -0.9)  # of the buckling load, 0 among them; < 0 presses
NOTICED = 0.01  # of the striker's velocity: a difference


def main(shares=SHARES, changes=()):
    """First mode [Hz], time of flight [us], amplitude ratio, and largest velocity difference over
    the striker's until the first reflected wave has passed and after it, by force."""
    beam = scene("slender-beam", changes)

    # the buckling load [N], from a pressure so small that the beam does not notice it: the load
    # factor is the buckling load over the force
    small = -1e-6 * beam.beam.young * bending.section(beam.beam).area
    buckling_load = -small / bending.model(beam.but(beam={"axial_force": small})).load_factor

    hz, runs = [], []
    for share in shares:
        loaded = beam.but(beam={"axial_force": share * buckling_load})
        hz.append(first_mode(loaded))
        runs.append(bending_run(loaded, bending_wall(loaded)))
    tof = np.array([1e6 * run.contact.tof for run in runs])
    arr = np.array([run.contact.arr for run in runs])

    # differences to the beam without a force, over the striker's velocity
    free, first, later, later_ms = shares.index(0.0), [], [], []
    t, speed = runs[free].trajectory.t, np.abs(runs[free].trajectory.v[0]).max()
    for run in runs:
        until, after = first_and_later(runs[free], run)
        first.append(until / speed)
        later.append(float(after.max()) / speed)
        beyond = after > NOTICED * speed
        later_ms.append(1e3 * float(t[beyond.argmax()]) if beyond.any() else np.nan)

    columns = (
        "share", "force_N", "first_mode_hz", "tof_us", "arr", "first_wave", "later", "later_ms",
    )  # fmt: skip
    forces = [share * float(buckling_load) for share in shares]
    numbers = (hz, tof.tolist(), arr.tolist(), first, later, later_ms)
    print(aligned_text(columns, zip(shares, forces, *numbers, strict=True)))
    d_tof, d_arr = tof - tof[free], 100 * (arr / arr[free] - 1)
    say(f"""
        The beam buckles at {buckling_load:.4g} N. From no force to {shares[-1]:g} of that its first
        mode goes from {hz[free]:.3g} to {hz[-1]:.3g} Hz, the time of flight changes by
        {d_tof.min():.2f} to {d_tof.max():.2f} µs and the amplitude ratio by {d_arr.min():+.2f} to
        {d_arr.max():+.2f} %.

        Until the first reflected wave has passed, velocities differ from those without a force by
        at most {max(first):.2%} of the striker's, later by up to {max(later):.1%}, and by more than
        {NOTICED:.0%} from {np.nanmin([*later_ms, np.inf]):.3g} ms on.
        """)
    if max(later) > 5 * max(first):
        say("""
            The first reflected wave does not feel the axial force, later ones do: a record that
            ends with the first one tells nothing of it.
            """)
    else:
        say("""
            Later waves feel the axial force no more than the first one does: the record is too
            short, or the beam too stiff, to tell it.
            """)

    sphere = max(runs[0].labels)
    lines = [
        Line(f"{share:g} of buckling", run.milliseconds, run.velocity(sphere), "-", i, 1.0)
        for i, (share, run) in enumerate(zip(shares, runs, strict=True))
    ]
    figure = [Panel(f"sphere {sphere}", "time [ms]", "velocity [m/s]", lines)]
    Path("axial_force.png").write_bytes(panels(figure, size=(8, 4)))
    return np.array(hz), tof, arr, np.array(first), np.array(later)


if __name__ == "__main__":
    main(changes=sys.argv[1:])
