"""A beam that is pulled and pressed: the first reflected wave, and those that come later.

The force changes what is slow, the lowest modes; a contact lasts a tenth of a millisecond. Velocity
differences to the beam without a force, over the striker's, until the first reflected wave has
passed the observed spheres, and after.
"""

from typing import NamedTuple

from workflows.evidence.study import concluded, counted
from workflows.evidence.thesis import bent
from workflows.evidence.thesis.observed_run import Observed
from workflows.evidence.thesis.wave_distance import felt
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.scene import InvalidScene, Scene
from workflows.stages import bending
from workflows.stages.progress import Progress

SCENE = "slender-beam"
COLUMNS = ("share", "force_N", "first_mode_hz", "tof_us", "arr", "first_wave", "later", "later_ms")


class AxialForceOptions(NamedTuple):
    """What the study varies, and what it tells apart."""

    # of the buckling load, 0 among them; < 0 presses
    shares: tuple[float, ...] = (0.9, 0.5, 0.0, -0.3, -0.6, -0.8, -0.9)
    noticed: float = 0.01  # of the striker's velocity: a difference; not varied


class AxialLoad(NamedTuple):
    """A share of the buckling load, the force, the first mode and the run."""

    share: float
    force: float  # [N]
    first_mode: float  # [Hz]
    run: Observed


def axial_force(
    scene: Scene, progress: Progress, options: AxialForceOptions = AxialForceOptions()
) -> Finding:
    """What axial force up to 0.9 of buckling does to the first reflected wave and to later ones."""
    bent.require(scene, "beam")
    if scene.beam.floats:
        raise InvalidScene(f"the beam of {scene.name} can move as a rigid body; hold an end.")

    # the buckling load [N], from a pressure so small that the beam does not notice it
    small = -1e-6 * scene.beam.young * bending.section(scene.beam).area
    pressed = scene.but(beam={"axial_force": small})
    buckling_load = -small / bending.model(pressed).load_factor

    cases = []
    for share in counted(options.shares, progress, "{:g} of the buckling load".format):
        force = share * buckling_load
        loaded = scene.but(beam={"axial_force": force})
        run = bent.run(loaded, bent.wall(loaded))
        cases.append(AxialLoad(share, force, bent.first_mode(loaded), run))
    free = cases[options.shares.index(0.0)]

    # velocity differences to the beam without a force
    differences = [felt(free.run, case.run, options.noticed) for case in cases]
    rows = tuple(
        (c.share, c.force, c.first_mode, 1e6 * c.run.contact.tof, c.run.contact.arr, d.first,
         d.later, 1e3 * d.at)
        for c, d in zip(cases, differences, strict=True)
    )  # fmt: skip
    contact = free.run.contact

    sphere = max(free.run.labels)
    lines = [
        Line(f"{c.share:g} of buckling", c.run.milliseconds, c.run.velocity(sphere), "-", i, 1.0)
        for i, c in enumerate(cases)
    ]
    figure = [Panel(f"sphere {sphere}", "time [ms]", "velocity [m/s]", lines)]
    return concluded(
        __file__,
        COLUMNS,
        rows,
        panels(figure, size=(8, 4)),
        load=buckling_load,
        first=max(d.first for d in differences),
        later=max(d.later for d in differences),
        at=min((1e3 * d.at for d in differences if d.at == d.at), default=None),  # nan: never
        noticed=options.noticed,
        tof=[1e6 * (case.run.contact.tof - contact.tof) for case in cases],
        arr=[case.run.contact.arr / contact.arr - 1 for case in cases],
        hz=[cases[-1].first_mode, free.first_mode],
    )
