"""Resonance curves of a shaken structure whose contact slips the more the harder it is shaken.

Amplitudes over the shaker's frequency, followed up and down, and over its force, by harmonic
balance (`coupling.resonance`). With little force the contact sticks and the structure is tied to
the arm; with much it slips and the structure moves as it would alone. Two points are marched in
time as well.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beadwave.coupling.continuation import before_striker, cold_state
from beadwave.coupling.errors import CouplingError
from beadwave.coupling.resonance import CurvePoint, HarmonicBalance, curve
from beadwave.coupling.stuck_wall import stuck_wall
from beadwave.dem import UnstableStep
from beadwave.dem.friction import stick_stiffness
from beadwave.dem.spheres import hertz_overlap
from beadwave.workflows.evidence.study import concluded, counted
from beadwave.workflows.evidence.thesis.friction import MarchedRig, name_of, rig_of
from beadwave.workflows.report.finding import Finding
from beadwave.workflows.report.plots import Line, Panel, panels
from beadwave.workflows.report.tables import Table
from beadwave.workflows.scene import InvalidScene, Scene
from beadwave.workflows.scene.places import has_friction
from beadwave.workflows.stages.progress import Progress

SCENE = "rig-shaker"
COLUMNS = (
    "force_N", "peak_hz", "motion_um", "per_force_um_N", "slip_um", "friction_N", "loop_uJ",
    "cycle", "damping", "mode_hz", "up_down",
)  # fmt: skip
BESIDE = ("force_N", "frequency_hz", "quantity", "balance", "march")


class ResonanceOptions(NamedTuple):
    """What the study varies, and how finely."""

    forces: tuple[float, ...] = (0.1, 0.5, 1.0, 2.0)  # factors on the shaker's
    n_frequencies: int = 13
    beyond: float = 0.15  # of the lower and the higher of the linear resonances, to either side
    checked: tuple[float, ...] = (1.0, 2.0)  # of the forces, at the scene's frequency
    march_error: float = 3e-3
    n_cells: int = 64  # of the march
    balance: HarmonicBalance = HarmonicBalance()


def resonance(
    scene: Scene, progress: Progress, options: ResonanceOptions = ResonanceOptions()
) -> Finding:
    """Resonance curves of the shaken structure from a contact that sticks to one that slips.

    Points follow each other along a curve, up and down: where both ways differ, two states exist at
    one frequency or force. Raises InvalidScene for scenes without one shaker that pushes by a
    force.
    """
    shakers = scene.shakers or ()
    structure = scene.assembly is not None and scene.arm is not None and has_friction(scene)
    if not structure or len(shakers) != 1 or shakers[0].force is None:
        raise InvalidScene(
            f"{scene.name} has no structure with [friction] that one shaker pushes by a force; "
            "take rig-shaker."
        )
    rig = rig_of(scene, progress)
    body = rig.body(scene.friction.coefficient, options.n_cells)

    # [Hz] of the mode that the shaker moves most across at the contact: without friction, and on a
    # contact that sticks
    free, stuck = (equivalent_frequency(rig, k) for k in (0.0, rest_stiffness(rig)))
    low, high = (1.0 - options.beyond) * min(free, stuck), (1.0 + options.beyond) * max(free, stuck)
    frequencies = np.linspace(low, high, options.n_frequencies)

    def follow(f: Sequence[float], forces: Sequence[float]) -> list[CurvePoint]:
        """Periodic states at frequencies (n,) [Hz] and forces (n,) [N], each from the last."""
        try:
            return curve(body, f, forces, options.balance)
        except CouplingError as why:
            raise InvalidScene(f"{scene.name}: {why}") from None

    rows, curves = [], []  # curves under each force, up and down, in order of frequency
    for factor in counted(options.forces, progress, "{:g} of the force".format):
        force = factor * scene.shakers[0].force
        up = follow(frequencies, [force] * len(frequencies))
        down = follow(frequencies[::-1], [force] * len(frequencies))
        curves.append((force, up, down[::-1]))
        peak = max(up, key=lambda point: point.motion)
        apart = max(abs(a.motion - b.motion) for a, b in zip(up, down[::-1], strict=True))
        rows.append(
            (force, peak.frequency, 1e6 * peak.motion, 1e6 * peak.motion / force, 1e6 * peak.slip,
             peak.friction, 1e6 * peak.energy, name_of(peak.stick), peak.damping,
             equivalent_frequency(rig, peak.stiffness), apart / peak.motion)
        )  # fmt: skip

    # the scene's frequency, over the force up and down, and marched in time
    frequency = scene.shakers[0].frequency
    forces = scene.shakers[0].force * np.geomspace(min(options.forces), max(options.forces), 9)
    with progress("level"):
        rising = follow([frequency] * len(forces), forces)
        falling = follow([frequency] * len(forces), forces[::-1])[::-1]
    marched = []
    for factor in counted(options.checked, progress, "march at {:g} of the force".format):
        marched += marched_beside(scene, rig, factor, options)

    figure = panels_of(curves, rising, falling, frequency)
    return concluded(
        __file__, COLUMNS, tuple(rows), figure, Table("march", BESIDE, tuple(marched)),
        free=free, stuck=stuck, rows=rows, options=options,
        marched=[abs(row[3] / row[4] - 1.0) for row in marched if row[4]],
        frequency=frequency, scene=scene,
    )  # fmt: skip


def rest_stiffness(rig: MarchedRig) -> float:
    """[N/m] of the contact at rest, across, all of it sticking."""
    body = rig.body(1.0, 16)
    overlap = hertz_overlap(float(body.prepared.static.force[-1]), rig.start.chain.A[-1])
    return float(stick_stiffness(rig.last.law, np.sqrt(rig.last.law.radius * float(overlap))))


def equivalent_frequency(rig: MarchedRig, stiffness: float) -> float:
    """[Hz] of the mode that the shaker moves most, its contact a spring across [N/m]."""
    wall = stuck_wall(rig.wall, stiffness, rig.last, rig.start.chain)
    moved = np.abs(wall.load[:, 0]) / np.maximum(wall.omega, 1.0) ** 2
    moved[wall.omega < 1.0] = 0.0
    return float(wall.omega[moved.argmax()]) / (2.0 * np.pi)


def marched_beside(
    scene: Scene, rig: MarchedRig, factor: float, options: ResonanceOptions
) -> list[tuple[float, float, str, float, float]]:
    """Rows of the scene's frequency by harmonic balance and by the march in time; nan where it
    finds no periodic state."""
    shaker = scene.shakers[0]
    force = factor * shaker.force
    forced = rig._replace(shakers=rig.shakers._replace(force=np.array([force])))
    body = forced.body(scene.friction.coefficient, options.n_cells)
    point = curve(body, [shaker.frequency], [force], options.balance)[0]
    before = before_striker(
        body, rig.start.velocity, upstream_held=scene.friction.upstream == "held"
    )
    try:
        state = cold_state(
            body, before, error=options.march_error, speed=float(np.abs(rig.start.velocity).max())
        )
        marched = (1e6 * state.slip, state.friction, 1e6 * state.energy)
    except UnstableStep:
        marched = (float("nan"),) * 3
    balanced = (1e6 * point.slip, point.friction, 1e6 * point.energy)
    return [
        (force, shaker.frequency, name, a, b)
        for name, a, b in zip(("slip_um", "friction_N", "loop_uJ"), balanced, marched, strict=True)
    ]


def panels_of(
    curves: list[tuple[float, list[CurvePoint], list[CurvePoint]]],
    rising: list[CurvePoint],
    falling: list[CurvePoint],
    frequency: float,
) -> bytes:
    """Motion and loop over frequency, and over the force at the scene's frequency."""
    over, loops = [], []
    for i, (force, up, down) in enumerate(curves):
        f = np.array([point.frequency for point in up])
        for points, style in ((up, "-"), (down, "o")):
            name = f"{force:g} N" if style == "-" else None
            per_force = np.array([1e6 * point.motion for point in points]) / force
            over.append(Line(name, f, per_force, style, i, 1.2))
            energy = np.array([1e6 * point.energy for point in points])
            loops.append(Line(name, f, np.maximum(energy, 1e-6), style, i, 1.2))
    level, damping = [], []
    for name, points, style in (("up", rising, "-"), ("down", falling, "o")):
        forces, motion = np.array([(p.force, 1e6 * p.motion) for p in points]).T
        level.append(Line(name, forces, motion, style, 0, 1.2))
        ratio = np.array([max(p.damping, 1e-6) for p in points])
        damping.append(Line(name, forces, ratio, style, 1, 1.2))
    sets = [
        Panel("lines up, marks down", "frequency [Hz]", "motion over force [µm/N]", over),
        Panel("", "frequency [Hz]", "loop of a period [µJ]", loops, "y"),
        Panel(f"at {frequency:g} Hz", "force [N]", "motion [µm]", level, "xy"),
        Panel(f"at {frequency:g} Hz", "force [N]", "damping ratio by friction", damping, "xy"),
    ]
    return panels(sets, columns=2, size=(5.5, 3.2))
