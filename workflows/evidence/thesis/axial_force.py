"""A beam that is pulled and pressed: the first reflected wave, and those that come later.

The force changes what is slow, the lowest modes; a contact lasts a tenth of a millisecond. Velocity
differences to the beam without a force, over the striker's, until the first reflected wave has
passed the observed spheres, and after.
"""

from typing import NamedTuple

from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis import bent
from beadwave.workflows.evidence.thesis.wave_distance import felt
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.stages import bending
from beadwave.workflows.stages.progress import Progress

SCENE = "slender-beam"
COLUMNS = ("share", "force_N", "first_mode_hz", "tof_us", "arr", "first_wave", "later", "later_ms")


class AxialForceOptions(NamedTuple):
    """What the study varies, and what it tells apart."""

    # of the buckling load, 0 among them; < 0 presses
    shares: tuple[float, ...] = (0.9, 0.5, 0.0, -0.3, -0.6, -0.8, -0.9)
    noticed: float = 0.01  # of the striker's velocity: a difference; not varied


def axial_force(
    scene: Scene, progress: Progress, options: AxialForceOptions = AxialForceOptions()
) -> Finding:
    """What axial force up to 0.9 of buckling does to the first reflected wave and to later ones."""
    bent.require(scene, "beam")
    if scene.beam.floats:
        raise InvalidScene(f"the beam of {scene.name} can move as a rigid body; hold an end.")

    # the buckling load [N], from a pressure so small that the beam does not notice it: the load
    # factor is the force over the buckling load
    small = -1e-6 * scene.beam.young * bending.section(scene.beam).area
    pressed = scene.but(beam={"axial_force": small})
    buckling_load = -small / bending.model(pressed).load_factor

    forces, hz, runs = [share * buckling_load for share in options.shares], [], []
    for force in counted(
        forces, progress, lambda force: f"{force / buckling_load:g} of the buckling load"
    ):
        loaded = scene.but(beam={"axial_force": force})
        hz.append(bent.first_mode(loaded))
        runs.append(bent.run(loaded, bent.wall(loaded)))
    tof, arr = [1e6 * run.contact.tof for run in runs], [run.contact.arr for run in runs]

    # velocity differences to the beam without a force
    unloaded = options.shares.index(0.0)
    differences = (felt(runs[unloaded], run, options.noticed) for run in runs)
    first, later, at = zip(*differences, strict=True)
    later_ms = [1e3 * t for t in at]
    rows = tuple(zip(options.shares, forces, hz, tof, arr, first, later, later_ms, strict=True))

    sphere = max(runs[0].labels)
    lines = [
        Line(f"{share:g} of buckling", run.milliseconds, run.velocity(sphere), "-", i, 1.0)
        for i, (share, run) in enumerate(zip(options.shares, runs, strict=True))
    ]
    figure = [Panel(f"sphere {sphere}", "time [ms]", "velocity [m/s]", lines)]
    return concluded(
        __file__,
        COLUMNS,
        rows,
        panels(figure, size=(8, 4)),
        load=buckling_load,
        first=max(first),
        later=max(later),
        at=min((ms for ms in later_ms if ms == ms), default=None),  # nan: never
        options=options,
        tof=[each - tof[unloaded] for each in tof],
        arr=[each / arr[unloaded] - 1 for each in arr],
        hz=[hz[-1], hz[unloaded]],
    )
