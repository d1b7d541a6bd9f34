"""An undamped wall under repeated impacts, and what the thesis' Rayleigh damping means.

With force and reading at different nodes the wall makes energy, which the thesis saw as growing
oscillations and met with damping. With one functional for both nothing grows and no damping is
needed to say so. Thesis, figures 6.5 and 6.6, equation 6.1.
"""

import numpy as np

import coupling
from workflows.evidence.prose import rendered
from workflows.evidence.thesis.energy_run import EnergyRun
from workflows.evidence.thesis.requirements import require_rig
from workflows.evidence.thesis.schemes import Body, impact_run, of_the_thesis
from workflows.evidence.thesis.schemes import ours as with_one_functional
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import Scene
from workflows.stages import assembly as stages
from workflows.stages.pipeline import Progress
from workflows.thesis import HAMMER_TEST_HZ, THESIS

DURATION = 12e-3  # [s]
RAYLEIGH = coupling.RayleighDamping(**THESIS["rayleigh"])  # section 6.2
FAR = "thesis, read at the block's other side"
BAND_HZ = (10.0, 5e4)


def damping(scene: Scene, progress: Progress) -> Finding:
    """An undamped wall, and its Rayleigh damping over frequency (thesis, figures 6.5, 6.6)."""
    require_rig(scene)
    runs = tuple(_runs(scene, progress))
    zeta = coupling.damping_ratios(RAYLEIGH, 2 * np.pi * np.array(HAMMER_TEST_HZ))
    rows = (
        *((f"undamped, {r.name}: largest gain of energy", r.gain.largest) for r in runs),
        *((f"undamped, {r.name}: gain at the end", r.gain.final) for r in runs),
        *(
            (f"Rayleigh ratio at {hz:g} Hz", float(z))
            for hz, z in zip(HAMMER_TEST_HZ, zeta, strict=True)
        ),
    )
    picture = Picture("study_damping", _picture(runs))
    table = Table("damping", ("quantity", "value"), rows)
    ours, *others = runs
    sentences = rendered(
        __file__, ours=ours, grown=ours.growth, others=[(run, run.growth) for run in others],
        most=max(1.5 * ours.gain.largest, 1e-9), duration=DURATION,
        rayleigh=RAYLEIGH, ratio=zeta[0], frequency=HAMMER_TEST_HZ[0],
    )  # fmt: skip
    return Finding((table,), sentences, (picture,))


def _runs(scene: Scene, progress: Progress):
    model = stages.model(scene, stages.mesh(scene))
    body = Body(model, scene.patch.point, scene.patch.radius)
    (y, z), aside = body.point, body.radius
    beside = f"thesis, read {1e3 * body.radius:g} mm beside"
    with progress("one functional"):
        yield impact_run(scene, "one functional", with_one_functional(scene, body), DURATION)
    with progress(beside):
        yield impact_run(scene, beside, of_the_thesis(body), DURATION)
    with progress(FAR):
        wall = of_the_thesis(body, ((-y, z - aside), (-y, z + aside)))
        yield impact_run(scene, FAR, wall, DURATION)


def _picture(runs: tuple[EnergyRun, ...]) -> bytes:
    speed = 1.1 * max(np.abs(run.trajectory.v[:, -1]).max() for run in runs)
    moving = [
        Panel(
            f"undamped, {run.name} (figure 6.5)", "time [ms]", "velocity [m/s]",
            [Line("last sphere", run.milliseconds, run.trajectory.v[:, -1], "-", width=0.8),
             Line("wall, where read", run.milliseconds, run.trajectory.wall_v, "-", width=0.8)],
            y_limits=(-speed, speed),
        )
        for run in runs
    ]  # fmt: skip
    return panels([*moving, _gains(runs), _log_gains(runs), _rayleigh()], columns=2, size=(5.6, 3))


def _gains(runs: tuple[EnergyRun, ...]) -> Panel:
    lines = [Line(r.name, r.milliseconds, 100 * (r.total - r.total[0]), width=1.0) for r in runs]
    return Panel("energy generated", "time [ms]", "energy [% of the striker's]", lines)


def _log_gains(runs: tuple[EnergyRun, ...]) -> Panel:
    lines = [
        Line(r.name, r.milliseconds, np.maximum(np.abs(r.total - r.total[0]), 1e-16), width=1.0)
        for r in runs
    ]
    return Panel("the same, logarithmic", "time [ms]", "energy [of the striker's]", lines, "y")


def _rayleigh() -> Panel:
    f = np.geomspace(*BAND_HZ, 400)
    tested = np.array(HAMMER_TEST_HZ)
    at = coupling.damping_ratios(RAYLEIGH, 2 * np.pi * tested)
    curve = coupling.damping_ratios(RAYLEIGH, 2 * np.pi * f)
    lines = [
        Line(f"alpha = {RAYLEIGH.alpha:g} 1/s, beta = {RAYLEIGH.beta:g} s", f, 100 * curve),
        Line("modes of the hammer test", tested, 100 * at, "o"),
        Line("no oscillation above", f, np.full_like(f, 100.0), "--"),
    ]
    return Panel(
        "Rayleigh damping of the thesis (figure 6.6)", "frequency [Hz]", "damping ratio [%]",
        lines, "xy",
    )  # fmt: skip
