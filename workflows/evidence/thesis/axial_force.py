"""A beam that is pulled and pressed: the first reflected wave, and those that come later.

The force changes what is slow, the lowest modes; a contact lasts a tenth of a millisecond. Velocity
differences to the beam without a force, over the striker's, until the first reflected wave has
passed the observed spheres, and after.
"""

from typing import NamedTuple

from workflows.evidence.prose import rendered
from workflows.evidence.thesis import bent
from workflows.evidence.thesis.observed_run import Observed
from workflows.evidence.thesis.wave_distance import NOTICED, felt
from workflows.files.run_folder import Picture
from workflows.report.finding import Finding
from workflows.report.plots import Line, Panel, panels
from workflows.report.tables import Table
from workflows.scene import InvalidScene, Scene
from workflows.stages import bending
from workflows.stages.pipeline import Progress

SCENE = "slender-beam"
SHARES = (0.9, 0.5, 0.0, -0.3, -0.6, -0.8, -0.9)  # of the buckling load, < 0 presses
SMALL = -1e-6  # of E A: presses a beam that does not notice it, for the buckling load
COLUMNS = ("share", "force_N", "first_mode_hz", "tof_us", "arr", "first_wave", "later", "later_ms")


class Case(NamedTuple):
    """A share of the buckling load, the force, the first mode and the run."""

    share: float
    force: float  # [N]
    first_mode: float  # [Hz]
    run: Observed


def axial_force(scene: Scene, progress: Progress) -> Finding:
    """What axial force up to 0.9 of buckling does to the first reflected wave and to later ones."""
    bent.require(scene, "beam")
    load, cases = buckling_load(scene), []
    for share in SHARES:
        with progress(f"{share:g} of the buckling load"):
            cases.append(_case(scene, share, share * load))
    free = cases[SHARES.index(0.0)].run
    seen = [felt(free, case.run) for case in cases]
    rows = tuple(
        (c.share, c.force, c.first_mode, 1e6 * c.run.contact.tof, c.run.contact.arr, f.first,
         f.later, 1e3 * f.at)
        for c, f in zip(cases, seen, strict=True)
    )  # fmt: skip
    numbers = {
        "load": load,
        "first": max(f.first for f in seen),
        "later": max(f.later for f in seen),
        "at": min((1e3 * f.at for f in seen if f.at == f.at), default=None),
        "noticed": NOTICED,
        "tof": [1e6 * (c.run.contact.tof - free.contact.tof) for c in cases],
        "arr": [c.run.contact.arr / free.contact.arr - 1 for c in cases],
        "hz": [cases[-1].first_mode, cases[SHARES.index(0.0)].first_mode],
    }
    picture = Picture("study_axial_force", _picture(cases))
    found = rendered(__file__, **numbers)
    return Finding((Table("axial-force", COLUMNS, rows),), found, (picture,))


def buckling_load(scene: Scene) -> float:
    """[N]; raises InvalidScene for a beam that can move as a rigid body."""
    if scene.beam.floats:
        raise InvalidScene(f"the beam of {scene.name} can move as a rigid body; hold an end.")
    small = SMALL * scene.beam.young * bending.section(scene.beam).area
    pressed = scene.but(beam={"axial_force": small})
    return -small / bending.model(pressed).load_factor


def _case(scene: Scene, share: float, force: float) -> Case:
    loaded = scene.but(beam={"axial_force": force})
    return Case(share, force, bent.first_mode(loaded), bent.run(loaded, bent.wall(loaded)))


def _picture(cases: list[Case]) -> bytes:
    sphere = max(cases[0].run.labels)
    lines = [
        Line(f"{c.share:g} of buckling", c.run.milliseconds, c.run.velocity(sphere), "-", i, 1.0)
        for i, c in enumerate(cases)
    ]
    title = f"sphere {sphere}"
    return panels([Panel(title, "time [ms]", "velocity [m/s]", lines)], size=(8, 4))
