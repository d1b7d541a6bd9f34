"""Beams and plates of one size after the other: time of flight and amplitude ratio over it.

You will see, over the thickness of a beam, the length of a beam struck at the same share of it and
the thickness of a plate, what the first reflected wave tells of each. It leaves when the contact
ends: what lies so far away that bending waves come back later does not change it. The slopes
d ln y / d ln x say how well an instrument's amplitude ratio and time of flight tell the size.

Run it: python examples/gallery/beam_and_plate_sizes.py       27 impacts, a minute
"""

from pathlib import Path

import numpy as np

from beadwave import scene
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from observed import bending_run, bending_wall, first_mode, say

FACTORS = tuple(2.0 ** np.arange(-2, 2.5, 0.5))  # of the scene's own size, ascending, 1 among them
ARR_KNOWN = 0.01  # relative, to which an instrument tells the amplitude ratio (ARR)
TOF_KNOWN = 0.5  # [us] to which it tells the time of flight: a sample at 2 MHz
UNCHANGED = 0.01  # relative change of ARR that is none


def main(factors=FACTORS, sizes=("beam thickness", "beam length", "plate thickness"), changes=()):
    """First mode [Hz], time of flight [us] and amplitude ratio by size, an array (k, 3) each."""
    results, figure = [], []
    for size in sizes:
        table, key = size.split()
        usual = scene(table, changes)
        body = getattr(usual, table)
        values = np.array(factors) * getattr(body, key)
        if key == "length":
            values = values[values > 2 * (body.thickness or 0.0)]  # shorter is no beam

        rows = []
        for value in values:
            change = {key: float(value)}
            if key == "length":  # struck at the same share
                change["position"] = float(value) * body.position / body.length
            structure = usual.but(**{table: change})
            run = bending_run(structure, bending_wall(structure))
            contact, peak = run.contact, float(run.trajectory.contact_force[:, -1].max())
            rows.append((
                1e3 * float(value), first_mode(structure), 1e6 * contact.contact_time.seconds,
                1e6 * contact.tof, contact.arr, peak,
            ))  # fmt: skip
        mm, hz, contact_us, tof_us, arr, _ = np.transpose(rows)
        results.append(np.column_stack([hz, tof_us, arr]))
        columns = ("first_mode_hz", "contact_us", "tof_us", "arr", "peak_N")
        print(aligned_text((f"{size}, mm", *columns), rows))

        # slopes at the scene's own size, between its neighbours
        own = int(np.argmin(np.abs(np.log(values / getattr(body, key)))))
        x = np.log(mm)
        slope_arr, slope_tof = (
            float((y[own + 1] - y[own - 1]) / (x[own + 1] - x[own - 1]))
            for y in (np.log(arr), np.log(tof_us))
        )
        ends = np.flatnonzero(np.isfinite(arr))[[0, -1]]
        say(f"""
            The amplitude ratio goes from {arr[ends[0]]:.3f} to {arr[ends[1]]:.3f}, the time of
            flight from {tof_us[ends[0]]:.0f} to {tof_us[ends[1]]:.0f} µs. At {mm[own]:.3g} mm the
            amplitude ratio goes with the {key} to the power {slope_arr:.3f}, the time of flight to
            the power {slope_tof:.3f}. There an amplitude ratio known to {ARR_KNOWN:.0%} tells the
            {key} {resolution(ARR_KNOWN, slope_arr)}, a time of flight known to {TOF_KNOWN:g} µs
            {resolution(TOF_KNOWN / tof_us[own], slope_tof)}, if all else is known.
            """)
        # the size from which on ARR no longer changes
        changed = np.flatnonzero(~(np.abs(arr / arr[-1] - 1) < UNCHANGED))
        first_same = changed[-1] + 1 if changed.size else 0
        if first_same < len(mm) - 1:
            say(f"""
                From {mm[first_same]:.3g} mm on the amplitude ratio stays the same within
                {UNCHANGED:.0%}: the first reflected wave does not feel the {key}.
                """)
        print()

        # what hardly changes stays level: its axis reaches a tenth of the mean to either side
        for title, unit, y in (
            ("amplitude ratio", "ARR [-]", arr),
            ("time of flight", "TOF [µs]", tof_us),
            ("contact time", "T_c [µs]", contact_us),
        ):
            mean = float(np.nanmean(y))
            limits = (0.9 * mean, 1.1 * mean) if np.ptp(y) < 0.1 * mean / 4 else None
            line = Line(None, mm, y, "o-")
            figure.append(Panel(f"{title}, {table}", f"{key} [mm]", unit, [line], "x", limits))
    Path("beam_and_plate_sizes.png").write_bytes(panels(figure, columns=3, size=(4.2, 3.0)))
    return results


def resolution(known, slope):
    """Words for the relative error of a size that a quantity known to a relative error leaves."""
    error = known / abs(slope) if slope else np.inf
    return f"to {error:.1%}" if error < 1 else "not at all"


if __name__ == "__main__":
    main()
