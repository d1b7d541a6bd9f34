"""An undamped wall under repeated impacts, and what the thesis' Rayleigh damping means.

With force and reading at different nodes the wall makes energy, which the thesis saw as growing
oscillations and met with damping. With one functional for both nothing grows and no damping is
needed to say so. Thesis, figures 6.5 and 6.6, equation 6.1.
"""

from typing import NamedTuple

import numpy as np

from beadwave import coupling
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis.requirements import require_rig
from beadwave.workflows.evidence.thesis.schemes import (
    ROUNDING,
    SchemeOptions,
    StruckBody,
    impact_run,
    of_the_thesis,
    one_functional,
)
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import Scene
from beadwave.workflows.stages import assembly as stages
from beadwave.workflows.stages.progress import Progress
from beadwave.workflows.thesis import HAMMER_TEST_HZ, THESIS

RAYLEIGH = coupling.RayleighDamping(**THESIS["rayleigh"])  # section 6.2


class DampingOptions(NamedTuple):
    """How long the study runs, and what it draws; not varied."""

    duration: float = 12e-3  # [s] of repeated impacts, in which a growth shows
    band_hz: tuple[float, float] = (10.0, 5e4)  # of the curve over frequency
    schemes: SchemeOptions = SchemeOptions()


def damping(
    scene: Scene, progress: Progress, options: DampingOptions = DampingOptions()
) -> Finding:
    """An undamped wall, and its Rayleigh damping over frequency (thesis, figures 6.5, 6.6)."""
    require_rig(scene)
    model = stages.model(scene, stages.mesh(scene))
    body, schemes = StruckBody(model, scene.patch.point, scene.patch.radius), options.schemes
    (y, z), radius = body.point, body.radius

    # one undamped wall in three couplings: force and reading are one, or a radius apart, or at
    # opposite sides of the block
    near_by = f"thesis, read {1e3 * radius:g} mm beside"
    opposite = ((-y, z - radius), (-y, z + radius))
    runs = []
    couplings = (
        ("one functional", lambda: one_functional(scene, body, schemes)),
        (near_by, lambda: of_the_thesis(body, schemes)),
        ("thesis, read at the block's other side", lambda: of_the_thesis(body, schemes, opposite)),
    )
    for name, wall_of in counted(couplings, progress, lambda pair: pair[0]):
        runs.append(impact_run(scene, name, wall_of(), options.duration, schemes))

    # zeta = (alpha / omega + beta omega) / 2 at the measured modes
    tested = np.array(HAMMER_TEST_HZ)
    zeta = coupling.damping_ratios(RAYLEIGH, 2 * np.pi * tested)
    rows = (
        *((f"undamped, {r.name}: largest gain of energy", r.gain.largest) for r in runs),
        *((f"undamped, {r.name}: gain at the end", r.gain.final) for r in runs),
        *(
            (f"Rayleigh ratio at {hz:g} Hz", float(ratio))
            for hz, ratio in zip(HAMMER_TEST_HZ, zeta, strict=True)
        ),
    )
    ours, *others = runs

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

    # energy that each run makes
    gains = [(run.name, run.milliseconds, run.total - run.total[0]) for run in runs]
    percent = [Line(name, t, 100 * gain, width=1.0) for name, t, gain in gains]
    sizes = [Line(name, t, np.maximum(np.abs(gain), 1e-16), width=1.0) for name, t, gain in gains]
    label, logarithmic = "energy [% of the striker's]", "the same, logarithmic"
    figure += [
        Panel("energy generated", "time [ms]", label, percent),
        Panel(logarithmic, "time [ms]", "energy [of the striker's]", sizes, "y"),
    ]

    # figure 6.6: the thesis' damping over frequency, 100 % is critical
    f = np.geomspace(*options.band_hz, 400)
    curve = coupling.damping_ratios(RAYLEIGH, 2 * np.pi * f)
    name = f"alpha = {RAYLEIGH.alpha:g} 1/s, beta = {RAYLEIGH.beta:g} s"
    lines = [
        Line(name, f, 100 * curve),
        Line("modes of the hammer test", tested, 100 * zeta, "o"),
        Line("no oscillation above", f, np.full_like(f, 100.0), "--"),
    ]
    title = "Rayleigh damping of the thesis (figure 6.6)"
    figure.append(Panel(title, "frequency [Hz]", "damping ratio [%]", lines, "xy"))

    return concluded(
        __file__, ("quantity", "value"), rows, panels(figure, columns=2, size=(5.6, 3)),
        ours=ours, grown=ours.growth, others=[(run, run.growth) for run in others],
        most=max(1.5 * ours.gain.largest, ROUNDING), duration=options.duration,
        rayleigh=RAYLEIGH, ratio=zeta[0], frequency=HAMMER_TEST_HZ[0],
    )  # fmt: skip
