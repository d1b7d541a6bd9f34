"""The first screen of the report page: a sentence on chain, wall and first reflected waves, and the
main numbers. Its frame is the section `answer` of `page/page.html.jinja`."""

from pathlib import Path

import numpy as np

from beadwave.workflows.report.number_format import NONE, digits, grouped, percent, si
from beadwave.workflows.report.summary import Summary
from beadwave.workflows.report.summary_rows import (
    ERROR_OF,
    crystal_rows,
    measured_modes,
    run_seconds,
)
from beadwave.workflows.scene import (
    DashpotWall,
    HalfSpaceWall,
    MeasuredWall,
    OneDofWall,
    RigidWall,
    RomWall,
    Scene,
)

MODES = "measured modes, computed"


def chain_words(scene: Scene) -> str:
    """The first sentence's beginning: what strikes what."""
    chain = scene.chain
    radii = np.unique(chain.radius)
    size = " to ".join(si(2 * R, "m") for R in (radii[0], radii[-1])[: len(radii)])
    row = f"{grouped(chain.count)} sphere{'s' if chain.count > 1 else ''} of {size} diameter"
    if scene.striker is None and scene.chain.initial_velocity is None:
        return f"{row} pressed, at rest along the chain, on"
    if scene.striker is None:
        return f"{row} start with velocities of their own{' and lean on' if scene.wall else ''}"
    speed, drop = si(scene.striker.velocity, "m/s"), scene.striker.drop
    leans = "" if scene.wall is None else ", and the last one leans on"
    falls = f"falls {si(drop, 'm')} and " if drop else ""
    if chain.count == 1 and scene.wall is not None:
        return f"{row} {falls}moves at {speed} towards"
    return f"{row}: the first one {falls}strikes the row at {speed}{leans}"


def chains_words(scene: Scene, summary: Summary) -> str:
    """The first sentence of several chains: what strikes where, and on what they lean."""
    parts = []
    for row, one in zip(scene.chains, scene.of_each_chain.values(), strict=True):
        where = f"{row.name} on {row.on}, {grouped(row.count)} spheres"
        if one.striker:
            delay = row.striker.time if row.striker else 0.0
            where += f" struck at {si(one.striker.velocity, 'm/s')}"
            where += f" after {si(delay, 's')}" if delay else ""
        parts.append(where)
    mass = summary.reduction and summary.reduction.mass_kg
    return (
        f"{grouped(len(parts))} chains lean on one assembly of {si(mass, 'kg')} "
        f"({grouped(summary.dofs)} degrees of freedom, reduced to {summary.n_wall_modes} modes): "
        f"{'; '.join(parts)}."
    )


CRYSTALS = {
    "square": "a square packing", "hexagonal": "a hexagonal packing",
    "sc": "a simple cubic packing", "bcc": "a body-centred cubic packing",
    "fcc": "a face-centred cubic packing", "hcp": "a hexagonal close packing",
    "y": "a stem and two branches",
}  # fmt: skip


def crystal_words(scene: Scene, summary: Summary) -> str:
    """The first sentence of a crystal: what strikes what, and what is behind it."""
    crystal, numbers = scene.crystal, summary.crystal
    shape = CRYSTALS.get(crystal.lattice, "a network")
    size = "" if crystal.radius is None else f" of {si(2 * crystal.radius, 'm')} diameter"
    moved = crystal.striker or crystal.drive
    which = "One sphere"
    if moved.at is None:
        which = "A whole row" if moved.row is not None else "A whole layer"
    does = "strikes" if crystal.striker else "shakes"
    speed = f" at {si(crystal.striker.velocity, 'm/s')}" if crystal.striker else ""
    words = (
        f"{which} {does} {shape} of {grouped(numbers.n_spheres)} spheres{size}{speed}; they touch "
        f"in {grouped(numbers.n_contacts)} contacts"
    )
    if scene.wall is None:
        return f"{words}, {wall_words(scene, summary)}"
    return f"{words}, and the last row leans on {wall_words(scene, summary)}"


def wall_words(scene: Scene, summary: Summary) -> str:
    """The wall, to the end of the sentence."""
    match scene.wall:
        case None:
            return "with nothing behind it."
        case RigidWall():
            return "a rigid wall."
        case HalfSpaceWall(young=E):
            return f"a half-space (E = {si(E, 'Pa')})."
        case OneDofWall(frequency=f, mass=m):
            return f"a mass of {si(m, 'kg')} on a spring ({si(f, 'Hz')})."
        case DashpotWall(plate_thickness=h) if h:
            return f"an infinite plate {si(h, 'm')} thick."
        case DashpotWall(coefficient=c):
            return f"a dashpot of {si(c, 'N s/m')}."
        case MeasuredWall(receptance=file):
            return f"a wall known by its measured response ({Path(file).name})."
        case RomWall(file=file) if file:
            return f"a reduced model of {summary.n_wall_modes} modes ({Path(file).name})."
        case wall if not isinstance(wall, RomWall):
            raise NotImplementedError(f"no words for wall.kind = {wall.kind!r} here")
    mass = summary.reduction and summary.reduction.mass_kg
    body = f"a {scene.struck_body}" if scene.bending else "an assembly"
    return (
        f"{body} of {si(mass, 'kg')} ({grouped(summary.dofs)} degrees of freedom, reduced to "
        f"{summary.n_wall_modes} modes)."
    )


def waves_words(summary: Summary) -> str:
    """The first wave at each observed sphere."""
    passing = []
    for sphere, waves in summary.waves.items():
        if waves.arrivals:
            wave = waves.arrivals[0]
            velocity = si(wave.peak_velocity_m_s, "m/s")
            passing.append(f"sphere {sphere} at {si(wave.time_s, 's')} with {velocity}")
    if not passing:
        return "No wave passes the observed spheres."
    return f"The first wave passes {', '.join(passing)}."


def facts(summary: Summary) -> list[tuple[str, str, float | None]]:
    """The few numbers next to the answer, each with its relative error where one is known, several
    with the largest of theirs."""
    rows = []
    if contact := summary.wall_contact:
        speed_in, speed_back = contact.speed_in_m_s, contact.speed_back_m_s
        speeds = si(speed_in, "m/s")
        if speed_in and speed_back:
            speeds = f"{digits(speed_in)}, {si(speed_back, 'm/s')}"
        rows += [
            ("time of flight TOF", si(contact.tof_s, "s")),
            ("amplitude ratio ARR", percent(contact.arr_2_9)),
            ("wave speed in, back", speeds),
            ("peak force at the wall", si(summary.peak_wall_force_N, "N")),
        ]
    if crystal := summary.crystal:
        rows += crystal_rows(crystal)[1:]
    for name, chain in summary.chains.items():
        contact = chain.wall_contact
        rows += [
            (f"{name}: peak force", si(chain.peak_wall_force_N, "N")),
            (f"{name}: TOF", si(contact and contact.tof_s, "s")),
            (f"{name}: ARR", percent(contact and contact.arr_2_9)),
        ]
    if summary.modes_hz:
        rows.append((MODES, measured_modes(summary)))
    seconds = run_seconds(summary)
    spent = f"{digits(seconds)} s" if seconds >= 0.01 else "none, results were kept"
    rows.append(("computing time", spent))
    errors = {label: summary.relative_error(name) for label, name in ERROR_OF.items()}
    of_modes = (summary.relative_error(f"mode {m.number}") for m in summary.modes if m.target)
    errors[MODES] = max((error for error in of_modes if error is not None), default=None)
    return [(label, x, errors.get(label)) for label, x in rows if x not in (NONE, "")]
