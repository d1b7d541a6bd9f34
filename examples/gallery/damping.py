"""An undamped wall under repeated impacts, and what the thesis' Rayleigh damping means.

You will see that nothing grows where force and reading are one functional, and no damping is needed
to say so; with force and reading at different nodes the wall makes energy, which the thesis saw as
growing oscillations and met with damping. Its Rayleigh coefficients mean the damping ratios

    zeta = (alpha / omega + beta omega) / 2

Thesis, section 6.2, figures 6.5 and 6.6, equation 6.1.

Run it: python examples/gallery/damping.py       meshes the rig's structure: minutes
"""

import sys
from pathlib import Path

import numpy as np

from beadwave import coupling, scene
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import aligned_text
from beadwave.workflows.stages.structure import assembly
from beadwave.workflows.thesis import HAMMER_TEST_HZ, THESIS
from observed import say
from schemes import (
    ERROR,
    N_MODES,
    ROUNDING,
    StruckBody,
    energy_run,
    of_the_thesis,
    one_functional,
)

DURATION = 12e-3  # [s] of repeated impacts, in which a growth shows
BAND_HZ = (10.0, 5e4)  # of the curve of damping over frequency


def main(duration=DURATION, n_modes=N_MODES, error=ERROR, changes=()):
    """Largest gain of energy over the striker's in three couplings, the first with one functional;
    damping ratios at the modes of the hammer test."""
    rig = scene("rig-rom", changes)
    model, steel = assembly.model(rig, assembly.mesh(rig)), assembly.solid(rig, "block")
    body = StruckBody(model, steel, rig.strike.at, rig.strike.radius)
    (y, z), radius = body.point, body.radius

    # one undamped wall in three couplings: force and reading are one, or a radius apart, or at
    # opposite sides of the block
    opposite = ((-y, z - radius), (-y, z + radius))
    walls = {
        "one functional": one_functional(body, n_modes),
        f"thesis, read {1e3 * radius:g} mm beside": of_the_thesis(body, n_modes),
        "thesis, read at the block's other side": of_the_thesis(body, n_modes, opposite),
    }
    runs = [energy_run(rig, name, wall, duration, error) for name, wall in walls.items()]
    growth = []
    for run in runs:
        # rms velocity of the wall in the last third of the time after the first touch over that in
        # the first
        v = run.trajectory.wall_v[run.trajectory.contact_force[:, -1].argmax() :]
        first, _, last = (np.sqrt(np.mean(third**2)) for third in np.array_split(v, 3))
        growth.append(last / first)

    rayleigh, tested = coupling.RayleighDamping(**THESIS["rayleigh"]), np.array(HAMMER_TEST_HZ)
    zeta = coupling.damping_ratios(rayleigh, 2 * np.pi * tested)
    rows = [(f"undamped, {r.name}: largest gain of energy", r.gain.largest) for r in runs]
    rows += [(f"undamped, {r.name}: gain at the end", r.gain.final) for r in runs]
    rows += [(f"Rayleigh ratio at {hz:g} Hz", float(x)) for hz, x in zip(tested, zeta, strict=True)]
    print(aligned_text(("quantity", "value"), rows))
    theirs = "; ".join(
        f"{g:.2f} times ({r.name}), where it generates {r.gain.largest:.0%} of the striker's "
        f"energy at {1e3 * r.gain.time:.2g} ms and {100 * r.gain.final:.2g} % at the end"
        for r, g in zip(runs[1:], growth[1:], strict=True)
    )
    say(f"""
        Figure 6.5: the thesis attributes growing oscillations to missing damping. Without any
        damping, in {1e3 * duration:g} ms, the rms velocity of the wall in the last third of the run
        is {growth[0]:.2f} times that in the first third where force and displacement share one
        contact functional. With the thesis' scheme, whose force and displacement belong to
        different points, it is {theirs}. One functional for both generates less than
        {max(1.5 * runs[0].gain.largest, ROUNDING):.0e} of the striker's energy: damping only hides
        the effect.

        The Rayleigh coefficients of the thesis, alpha = {rayleigh.alpha:g} 1/s and beta =
        {rayleigh.beta:g} s, follow from its formula, but mean a damping ratio of {zeta[0]:.0%} at
        {tested[0]:g} Hz, which leaves no oscillation of that mode. A ratio for each measured mode
        (`damping.kind = "modal"`) is the better default.
        """)

    # figure 6.5: velocities of the last sphere and of the wall, each run with the same limits
    figure = []
    fastest = 1.1 * max(np.abs(run.trajectory.v[:, -1]).max() for run in runs)
    for run in runs:
        lines = [
            Line("last sphere", run.milliseconds, run.trajectory.v[:, -1], "-", width=0.8),
            Line("wall, where read", run.milliseconds, run.trajectory.wall_v, "-", width=0.8),
        ]
        title, limits = f"undamped, {run.name} (figure 6.5)", (-fastest, fastest)
        figure.append(Panel(title, "time [ms]", "velocity [m/s]", lines, y_limits=limits))
    made = [(r.name, r.milliseconds, r.total - r.total[0]) for r in runs]
    percent = [Line(name, t, 100 * gain, width=1.0) for name, t, gain in made]
    sizes = [Line(name, t, np.maximum(np.abs(gain), 1e-16), width=1.0) for name, t, gain in made]
    title = "energy generated, logarithmic"
    figure += [
        Panel("energy generated", "time [ms]", "energy [% of the striker's]", percent),
        Panel(title, "time [ms]", "energy [of the striker's]", sizes, "y"),
    ]

    # figure 6.6: the thesis' damping over frequency, 100 % is critical
    f = np.geomspace(*BAND_HZ, 400)
    name = f"alpha = {rayleigh.alpha:g} 1/s, beta = {rayleigh.beta:g} s"
    lines = [
        Line(name, f, 100 * coupling.damping_ratios(rayleigh, 2 * np.pi * f)),
        Line("modes of the hammer test", tested, 100 * zeta, "o"),
        Line("no oscillation above", f, np.full_like(f, 100.0), "--"),
    ]
    title = "Rayleigh damping of the thesis (figure 6.6)"
    figure.append(Panel(title, "frequency [Hz]", "damping ratio [%]", lines, "xy"))
    Path("damping.png").write_bytes(panels(figure, columns=2, size=(5.6, 3)))
    return np.array([run.gain.largest for run in runs]), zeta


if __name__ == "__main__":
    main(changes=sys.argv[1:])
